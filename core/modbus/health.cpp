#include "core/modbus/health.hpp"

#include <algorithm>
#include <sstream>
#include <tuple>
#include <utility>

namespace invar::modbus {

namespace {

using Level = HealthChange::Level;

constexpr Duration patience_at_start = Duration::seconds(2.0);
constexpr Duration patience_with_values = Duration::milliseconds(500);
constexpr Duration patience_with_slowness = Duration::seconds(2.0);
constexpr Duration first_hold = Duration::seconds(1.0);
constexpr Duration longest_hold = Duration::seconds(60.0);
constexpr Duration proof = Duration::seconds(2.0);          // so long without a refusal, after trying again
constexpr Duration habit_window = Duration::seconds(10.0);  // in which it must happen often enough
constexpr Duration habit_pause = Duration::seconds(600.0);  // until it is told again

std::string milliseconds(Duration time) { return std::to_string(time.ns / 1'000'000) + " ms"; }

std::string meaning_of_exception(int code) {
  switch (code) {
    case 1:
      return "it does not know the function; look at `kind` in its map";
    case 2:
      return "it has no such address; look at `address`, `gaps` and `max_registers` in its map";
    case 3:
      return "it does not allow the count or value; look at `max_registers` and `range` in its map";
    case 4:
      return "it has failed itself";
    case 5:
    case 6:
      return "it is busy";
    case 10:
      return "the gateway has no path to it";
    case 11:
      return "the gateway hears nothing of it; look at `unit` in its map, its power and its cable";
    default:
      return "look into its manual";
  }
}

std::string reason(const std::optional<Failure>& failure, const RegisterMap& map) {
  if (!failure) return "nothing was answered yet";
  switch (failure->cause) {
    case Cause::refused:
      return "nobody listens there";
    case Cause::unreachable:
      return "no connection comes about; look at address and cable";
    case Cause::timeout:
      return "connected, and no answer within " + milliseconds(map.answer_timeout);
    case Cause::reset:
      return "it closes the connection instead of an answer; another master may hold its only one";
    case Cause::short_answer:
      return "its answers end in the middle";
    case Cause::malformed:
      return "its answers are wrong in their " + std::string{name_of(failure->flaw)};
    case Cause::exception:
      break;
  }
  return "exception " + std::to_string(failure->exception) + ", " + meaning_of_exception(failure->exception);
}

/// Why a register has no value. A device that answers has a connection: that one failed earlier explains nothing.
std::string reason_of(const Device& device, const Register& reg) {
  const auto failure = device.last_failure();
  const bool no_connection =
      failure && (failure->cause == Cause::refused || failure->cause == Cause::unreachable);
  if (device.is_online() && (!failure || no_connection))
    return "no answer came within " + milliseconds(reg.stale_after) + "; the others take the time";
  return reason(failure, device.map());
}

/// The counts since the start that are not 0.
std::string counts(const DeviceCounters& device, const LinkCounters& link) {
  std::uint64_t exceptions = 0;
  for (const std::uint64_t count : device.exceptions) exceptions += count;
  const std::pair<const char*, std::uint64_t> all[] = {{"timeouts", device.timeouts},
                                                       {"refused connections", link.refused},
                                                       {"failed connections", link.unreachable},
                                                       {"lost connections", link.losses},
                                                       {"malformed answers", device.malformed},
                                                       {"cut answers", device.short_answers},
                                                       {"late answers", link.late},
                                                       {"exceptions", exceptions}};
  std::string text;
  for (const auto& [name, count] : all)
    if (count > 0) text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + name;
  return text.empty() ? "" : " (since the start: " + text + ")";
}

}  // namespace

bool Health::Lasting::begins(bool holds, Instant now, Duration patience) {
  if (!holds) {
    since.reset();
    return false;
  }
  if (!since) since = now;
  return !told && now - *since >= patience && (told = true);
}

bool Health::Lasting::ends(bool holds) { return !holds && std::exchange(told, false); }

std::string Health::subject(const Device& device) const {
  return "the " + device.map().device + " at " + where_;
}

void Health::look_at_readings(const Device& device, const LinkCounters& link, Instant now) {
  const auto& registers = device.map().registers;
  std::optional<std::size_t> stale;
  std::optional<std::size_t> outside;
  for (std::size_t i = 0; i < registers.size(); ++i) {
    if (!registers[i].readable) continue;
    const Reading reading = device.value(i);
    if (reading.stale && !stale) stale = i;
    if (!reading.stale && reading.out_of_range && !outside) outside = i;
  }
  if (lost_.begins(stale.has_value(), now, was_well_ ? Duration{} : patience_at_start)) {
    // Of a device that answers, one register may be missing, or all come too seldom.
    const bool slow = device.is_online() && device.round() > registers[*stale].stale_after;
    std::string text = subject(device);
    if (slow)
      text += " does not answer fast enough: its requests take " + milliseconds(device.round()) +
              ", and its values are stale after " + milliseconds(registers[*stale].stale_after);
    else
      text += " does not answer" +
              (device.is_online() ? " for `" + registers[*stale].name + "`" : std::string{}) + ": " +
              reason_of(device, registers[*stale]);
    say(Level::fault, text + counts(device.counters(), link));
  }
  if (lost_.ends(stale.has_value())) say(Level::note, subject(device) + " answers again");
  was_well_ = was_well_ || !stale;

  if (outside_.begins(outside.has_value(), now, patience_with_values)) {
    const Register& reg = registers[*outside];
    std::ostringstream text;
    text << subject(device) << " shows " << device.value(*outside).value << " in `" << reg.name
         << "`, outside its range of " << reg.range.lower << " to " << reg.range.upper
         << " (SI): an open sensor, or a wrong `word_order`, `type` or `address` in the map";
    say(Level::fault, text.str());
  }
  if (outside_.ends(outside.has_value()))
    say(Level::note,
        "what the " + device.map().device + " at " + where_ + " shows is inside its ranges again");
}

void Health::look_at_writes(const Device& device, Instant now) {
  const auto& registers = device.map().registers;
  std::optional<std::size_t> failed;
  std::uint64_t newest = judged_;
  for (std::size_t i = 0; i < registers.size(); ++i) {
    if (!registers[i].writable) continue;
    const WriteReport report = device.last_write(i);
    if (report.state != WriteState::refused && report.state != WriteState::mismatched) continue;
    if (report.number <= newest) continue;
    newest = report.number;
    failed = i;
  }
  judged_ = newest;
  if (failed) {
    if (now >= hold_until_) hold_ = told_refusal_ ? std::min(hold_ * 2, longest_hold) : first_hold;
    hold_until_ = now + hold_;
    if (!std::exchange(told_refusal_, true)) {
      const WriteReport report = device.last_write(*failed);
      std::ostringstream text;
      text << subject(device) << " does not take " << report.wanted << " (SI) in `" << registers[*failed].name
           << "`: ";
      if (report.state == WriteState::refused)
        text << "it answers with exception " << report.exception << ", "
             << meaning_of_exception(report.exception);
      else
        text << "it acknowledges the write and shows another value";
      text << "; its actuator is off, and the device is tried again later";
      say(Level::fault, text.str());
    }
  } else if (told_refusal_ && !lost_.told && now >= hold_until_ + proof) {
    told_refusal_ = false;
    say(Level::note, subject(device) + " takes writes again");
  }
  refuses_ = told_refusal_ && now < hold_until_;
}

void Health::tell_habit(Habit& habit, std::uint64_t count, std::uint64_t enough, Instant now,
                        const std::string& text) {
  const bool lost = lost_.since.has_value();  // why nothing comes is told instead
  const bool over = lost || now < habit.quiet_until || now - habit_window > habit.since;
  if (count == habit.begun || (enough > 1 && over)) {
    habit.begun = count;
    habit.since = now;
    return;
  }
  if (lost || now < habit.quiet_until || count - habit.begun < enough) return;
  habit.begun = count;
  habit.quiet_until = now + habit_pause;
  say(Level::warning, text);
}

/// What a device does now and then, by its cause, while its readings come.
void Health::look_at_habits(const Device& device, const LinkCounters& link, Instant now) {
  const DeviceCounters counts = device.counters();
  const RegisterMap& map = device.map();
  const std::string name = subject(device);
  constexpr std::uint64_t several = 3;  // once or twice is an accident
  const std::string flaw{name_of(device.last_failure().value_or(Failure{}).flaw)};
  const std::tuple<std::uint64_t, std::uint64_t, std::string> all[] = {
      {link.one_answer ? 1 : 0, 1, " closes the connection after each answer: each request gets a new one"},
      {link.one_answer ? 0 : link.closings, several,
       " closes the connection between requests: it is made anew before the next"},
      {counts.asked_again, several, " says that it is busy (exceptions 5 and 6): it is asked again"},
      {link.late, several,
       " answers later than `timeouts.answer` of " + milliseconds(map.answer_timeout) +
           ": late answers are dropped, and it is waited for longer"},
      {link.stray, several, " sends bytes that answer nothing: they are dropped"},
      {counts.splits, 1,
       " refuses reads of several registers: they are parted; say `max_registers` or `gaps` in its map"},
      {counts.malformed, several, " gives answers that are wrong in their " + flaw + ": they are dropped"},
      {counts.short_answers + counts.resets, several,
       " ends connections in the middle of an answer: they are made anew"},
      {counts.timeouts, several,
       " leaves requests without answer for " + milliseconds(map.answer_timeout) + ": they are asked again"}};
  static_assert(std::size(all) == std::tuple_size_v<decltype(habits_)>);
  for (std::size_t i = 0; i < habits_.size(); ++i) {
    const auto& [count, enough, text] = all[i];
    tell_habit(habits_[i], count, enough, now, name + text);
  }
  const Duration round = device.round();
  if (slow_.begins(round > map.poll && !lost_.told, now, patience_with_slowness))
    say(Level::warning, name + " answers slowly: its requests take " + milliseconds(round) +
                            ", and `poll` of its map is " + milliseconds(map.poll));
  if (slow_.ends(round * 2 > map.poll)) say(Level::note, name + " answers quickly again");
}

std::vector<HealthChange> Health::look(const Device& device, const LinkCounters& link, Instant now) {
  changes_.clear();
  look_at_readings(device, link, now);
  look_at_writes(device, now);
  look_at_habits(device, link, now);
  return changes_;
}

}  // namespace invar::modbus

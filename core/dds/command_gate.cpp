#include "core/dds/command_gate.hpp"

#include <algorithm>

#include "core/base/clock.hpp"
#include "core/dds/clock_offset.hpp"

namespace invar::dds {

namespace {
constexpr Duration between_alarms = Duration::milliseconds(5000);
constexpr std::size_t most_told = 1000;  // writers of which it is remembered what was told

std::string seconds(Duration time) { return seconds_text(time); }
}  // namespace

CommandGate::CommandGate(std::string topic, const Profile& profile, Discovery& discovery,
                         std::function<void()> refused, Duration clock_patience)
    : topic_{std::move(topic)},
      exclusive_{profile.exclusive},
      lifespan_{profile.lifespan},
      clock_patience_{clock_patience},
      discovery_{discovery},
      refused_{std::move(refused)},
      ownership_{profile.lease,
                 [&discovery](const Claimant& owner) { return discovery.is_gone(owner.participant); }} {}

/// Refuses what is older than the lifespan, by the clock of the sender less what that one is apart.
bool CommandGate::is_too_late(const Claimant& who, Duration age, Sender sender) {
  if (lifespan_.ns <= 0) return false;
  if (age <= lifespan_ && age >= -lifespan_) {
    if (!late_.empty()) late_.erase(who.writer);
    return false;
  }
  if (sender == Sender::of_cell) {
    tell(who, too_far(age));
    return true;
  }
  const Instant now = monotonic_now();
  auto least = least_.find(who.writer);
  const bool is_new = now - who.found < lifespan_;
  if (least == least_.end() && (age < -lifespan_ || is_new)) {
    least = take_clock(who, age, now);
    raise("a sample of `" + discovery_.name_of(who.participant) + "` on `" + topic_ + "` " +
          (age.ns < 0 ? "was sent in the future" : "seems old") + " and is taken; " +
          clocks_apart("the sender's PC", Duration{} - age, "this one"));
  }
  // Clocks drift apart, by less than a thousandth.
  if (least != least_.end()) {
    Least& youngest = least->second;
    youngest = {std::min(youngest.age + (now - youngest.at) / 1000, age), now};
    if (age - youngest.age <= lifespan_) {
      late_.erase(who.writer);
      return false;
    }
  }
  if (was_set(who, age, now)) return false;
  tell(who, least == least_.end()
                ? too_far(age)
                : "it came " + seconds(age - least->second.age) +
                      " later after it was sent than others of this sender, and is not obeyed after " +
                      seconds(lifespan_) + " (lifespan)");
  return true;
}

std::string CommandGate::too_far(Duration age) const {
  if (age.ns < 0)
    return "its stamp lies " + seconds(Duration{} - age) +
           " in the future, though the clock of its host is known: start the program that sends it anew";
  return "it was sent " + seconds(age) + " before it arrived, and is not obeyed after " + seconds(lifespan_) +
         " (lifespan); " + clocks_apart("the sender's PC", Duration{} - age, "this one") +
         ", or look for what holds samples up";
}

CommandGate::Leasts::iterator CommandGate::take_clock(const Claimant& who, Duration age, Instant now) {
  if (least_.size() >= most_told && !least_.contains(who.writer)) least_.clear();
  return least_.insert_or_assign(who.writer, Least{age, now}).first;
}

/// A queue that was held up runs empty, and ages fall; a clock that somebody set back makes all samples old by the same.
bool CommandGate::was_set(const Claimant& who, Duration age, Instant now) {
  if (late_.size() >= most_told && !late_.contains(who.writer)) late_.clear();
  Late& late = late_.try_emplace(who.writer, Late{age, age, now}).first->second;
  if (age - late.first > lifespan_ || late.first - age > lifespan_) late = {age, age, now};
  late.youngest = std::min(late.youngest, age);
  if (now - late.since < clock_patience_) return false;
  (void)take_clock(who, late.youngest, now);
  late_.erase(who.writer);
  raise("samples of `" + discovery_.name_of(who.participant) + "` on `" + topic_ + "` have seemed old for " +
        seconds(clock_patience_) + " and are taken from now on: somebody set its clock; " +
        clocks_apart("the sender's PC", Duration{} - age, "this one"));
  return true;
}

bool CommandGate::passes(const std::string& writer, Instant sent, Sender sender) {
  const std::lock_guard lock{mutex_};
  const Claimant who = discovery_.claimant(writer);
  if (is_too_late(who, sender == Sender::of_cell ? utc_now() - sent : age_by_nearer_clock(sent), sender))
    return false;
  if (!exclusive_) return true;
  const Instant now = monotonic_now();
  const Claimant* owner = ownership_.claim(who, now);
  if (owner == nullptr) {
    if (follower_.obeyed) follower_.obeyed(who);
    return true;
  }
  tell(who, "`" + discovery_.name_of(owner->participant) + "` commands there, with ownership strength " +
                std::to_string(owner->strength) + ", last " + seconds(now - ownership_.last()) +
                " ago; this one has strength " + std::to_string(who.strength) +
                ": end the other, or give more to the one that shall win");
  return false;
}

void CommandGate::refuse(const std::string& writer, const std::string& why) {
  const std::lock_guard lock{mutex_};
  tell(discovery_.claimant(writer), why);
}

void CommandGate::gone(const std::string& writer) {
  const std::lock_guard lock{mutex_};
  if (ownership_.release(writer) && follower_.gone) follower_.gone();
  told_.erase(writer);
}

void CommandGate::tell(const Claimant& who, const std::string& why) {
  ++refusals_;
  if (refused_) refused_();
  if (told_.size() >= most_told && !told_.contains(who.writer)) told_.clear();
  Told& told = told_[who.writer];
  const Instant now = monotonic_now();
  if (now - told.at < between_alarms) {
    ++told.since;
    return;
  }
  const std::string more = told.since == 0 ? "" : " (and " + std::to_string(told.since) + " before)";
  raise(std::string{exclusive_ ? "a command" : "a sample"} + " of `" + discovery_.name_of(who.participant) +
        "` on `" + topic_ + "` was not " + (exclusive_ ? "obeyed" : "taken") + more + ": " + why);
  told = {now, 0};
}

void CommandGate::raise(const std::string& text) { discovery_.raise({topic_, text, false}); }

}  // namespace invar::dds

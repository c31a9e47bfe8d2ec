#include "core/modbus/health.hpp"

#include <algorithm>
#include <sstream>
#include <utility>

namespace invar::modbus {

namespace {

constexpr Duration patience_at_start = Duration::seconds(2.0);
constexpr Duration patience_with_values = Duration::milliseconds(500);
constexpr Duration first_hold = Duration::seconds(1.0);
constexpr Duration longest_hold = Duration::seconds(60.0);
constexpr Duration proof = Duration::seconds(2.0);  // so long without a refusal, after trying again

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

void Health::look_at_readings(const Device& device, const LinkCounters& link, Instant now) {
  const auto& registers = device.map().registers;
  bool stale = false;
  std::optional<std::size_t> outside;
  for (std::size_t i = 0; i < registers.size(); ++i) {
    if (!registers[i].readable) continue;
    const Reading reading = device.value(i);
    stale = stale || reading.stale;
    if (!reading.stale && reading.out_of_range && !outside) outside = i;
  }
  const DeviceCounters counts = device.counters();
  if (lost_.begins(stale, now, was_well_ ? Duration{} : patience_at_start)) {
    std::ostringstream text;
    text << "the " << device.map().device << " at " << where_ << " does not answer: " << counts.timeouts
         << " timeouts, " << link.refused + link.unreachable << " connections refused, " << link.losses
         << " lost, " << counts.malformed + counts.short_answers << " answers malformed since the start";
    say(false, text.str());
  }
  if (lost_.ends(stale)) say(true, "the " + device.map().device + " at " + where_ + " answers again");
  was_well_ = was_well_ || !stale;

  if (outside_.begins(outside.has_value(), now, patience_with_values)) {
    const Register& reg = registers[*outside];
    std::ostringstream text;
    text << "the " << device.map().device << " at " << where_ << " shows " << device.value(*outside).value
         << " in `" << reg.name << "`, outside its range of " << reg.range.lower << " to " << reg.range.upper
         << " (SI): an open sensor, or a wrong `word_order`, `type` or `address` in the map";
    say(false, text.str());
  }
  if (outside_.ends(outside.has_value()))
    say(true, "what the " + device.map().device + " at " + where_ + " shows is inside its ranges again");
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
      text << "the " << device.map().device << " at " << where_ << " does not take " << report.wanted
           << " (SI) in `" << registers[*failed].name << "`: ";
      if (report.state == WriteState::refused)
        text << "it answers with exception " << report.exception;
      else
        text << "it acknowledges the write and shows another value";
      text << "; what it drives is let go, and tried again later";
      say(false, text.str());
    }
  } else if (told_refusal_ && !lost_.told && now >= hold_until_ + proof) {
    told_refusal_ = false;
    say(true, "the " + device.map().device + " at " + where_ + " takes writes again");
  }
  refuses_ = told_refusal_ && now < hold_until_;
}

std::vector<HealthChange> Health::look(const Device& device, const LinkCounters& link, Instant now) {
  changes_.clear();
  look_at_readings(device, link, now);
  look_at_writes(device, now);
  return changes_;
}

}  // namespace invar::modbus

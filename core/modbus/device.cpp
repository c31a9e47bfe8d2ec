#include "core/modbus/device.hpp"

#include <unistd.h>

#include <cmath>
#include <ctime>
#include <limits>

#include "core/base/clock.hpp"
#include "core/base/contract.hpp"
#include "core/modbus/read_back.hpp"

namespace invar::modbus {

std::string_view name_of(WriteState state) {
  constexpr std::array<std::string_view, 9> names{"none",    "queued",    "written", "confirmed", "refused",
                                                  "expired", "uncertain", "lost",    "mismatched"};
  return names[static_cast<std::size_t>(state)];
}

Device::Device(RegisterMap map)
    : map_{std::move(map)},
      samples_(map_.registers.size(), Sample{std::numeric_limits<double>::quiet_NaN(), {}, false, false}),
      writes_(map_.registers.size()) {}
Device::~Device() = default;

std::size_t Device::index(std::string_view name) const {
  const auto found = map_.find(name);
  INVAR_EXPECTS(found.has_value(), map_.device, name);
  return *found;
}

Reading Device::value(std::size_t reg) const {
  INVAR_EXPECTS(reg < map_.registers.size(), map_.device, reg);
  const std::lock_guard lock{mutex_};
  const Sample& sample = samples_[reg];
  if (!sample.seen) return {sample.value, Duration{std::numeric_limits<std::int64_t>::max()}, true, false};
  const Duration since = age(sample);
  return {sample.value, since, since > map_.registers[reg].stale_after, sample.out_of_range};
}

Duration Device::age(const Sample& sample) const {
  return (threaded_ ? monotonic_now() : polled_now_) - sample.stamp;
}

/// A device whose requests take longer than its poll has no time for what it shows already.
bool Device::is_needed(std::size_t reg, double value) const {
  const WriteReport& last = writes_[reg].report;
  if (round_ <= map_.poll || last.state != WriteState::confirmed || last.wanted != value) return true;
  const std::size_t by = *map_.registers[reg].read_back;
  const Sample& shown = samples_[by];
  return age(shown) > map_.registers[by].stale_after ||
         !shows(map_.registers[reg], value, map_.registers[by], shown.value);
}

Result<std::uint64_t, WriteRefusal> Device::write(std::size_t reg, double value) {
  INVAR_EXPECTS(reg < map_.registers.size() && map_.registers[reg].writable, map_.device, reg);
  if (!map_.registers[reg].range.contains(value)) return WriteRefusal::out_of_range;
  const std::lock_guard lock{mutex_};
  Pending& slot = writes_[reg];
  if (!is_needed(reg, value)) {
    ++counters_.writes_unneeded;
    return slot.report.number;
  }
  if (slot.report.state == WriteState::queued) ++counters_.writes_superseded;
  const auto unshown_since = value == slot.report.wanted ? slot.unshown_since : std::nullopt;
  slot = {{++written_, WriteState::queued, value, 0}, {}, false, unshown_since, slot.busy_since};
  has_queued_ = true;
  if (threaded_) {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto ignored = ::write(wake_, &one, sizeof one);  // full means it is awake already
  }
  return slot.report.number;
}

WriteReport Device::last_write(std::size_t reg) const {
  INVAR_EXPECTS(reg < map_.registers.size(), map_.device, reg);
  const std::lock_guard lock{mutex_};
  return writes_[reg].report;
}

void Device::forget_writes() {
  const std::lock_guard lock{mutex_};
  for (Pending& slot : writes_) {
    slot = Pending{};
    slot.report.number = ++written_;  // one that is on its way is none of these
  }
  has_queued_ = false;
}

void Device::refresh() {
  const std::lock_guard lock{mutex_};
  refreshed_ = true;
}

bool Device::is_online() const {
  const std::lock_guard lock{mutex_};
  return online_;
}

DeviceCounters Device::counters() const {
  const std::lock_guard lock{mutex_};
  return counters_;
}

std::optional<Failure> Device::last_failure() const {
  const std::lock_guard lock{mutex_};
  return last_failure_;
}

Duration Device::round() const {
  const std::lock_guard lock{mutex_};
  return round_;
}

}  // namespace invar::modbus

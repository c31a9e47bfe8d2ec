#include "core/modbus/device_io.hpp"

#include <algorithm>
#include <cmath>

#include "core/modbus/codec.hpp"

namespace invar::modbus {

namespace {

std::size_t longest_answer(const std::vector<ReadRequest>& plan) {
  std::size_t longest = 0;
  for (const auto& request : plan) longest = std::max<std::size_t>(longest, request.count);
  return longest;
}

/// Whether `shown` in register `by` is what `wanted` written to `reg` should look like.
bool shows(const Register& reg, double wanted, const Register& by, double shown) {
  const Words words = encode(reg, wanted);
  const double arrived = decode(reg, words.word);
  if (&reg == &by) return shown == arrived;
  const auto half_count = [](const Register& r) {
    return r.type == Type::float32 ? 0.0 : 0.5 * std::abs(r.scale);
  };
  return std::abs(shown - arrived) <= half_count(reg) + half_count(by) + 1e-6 * std::abs(arrived);
}

/// The range of a register as values on the wire can show it: a bound may lie between two counts.
Range shown(const Register& reg) {
  const double slack = reg.type == Type::float32
                           ? 1e-6 * std::max(std::abs(reg.range.lower), std::abs(reg.range.upper))
                           : 0.5001 * std::abs(reg.scale);
  return {reg.range.lower - slack, reg.range.upper + slack};
}

/// Keeps the rhythm, but does not catch up on what was missed.
Instant next_in_rhythm(Instant last, Duration period, Instant now) {
  return last + period > now ? last + period : now + period;
}

}  // namespace

DeviceIo::DeviceIo(Device& device, Backoff backoff, Duration answer_timeout)
    : device_{device},
      backoff_{backoff},
      answer_timeout_{answer_timeout},
      plan_{plan_reads(device.map())},
      words_(longest_answer(plan_)),
      read_in_round_(device.map().registers.size()) {
  for (const auto& request : plan_) {
    auto& fields = fields_.emplace_back();
    for (const std::size_t index : request.registers) {
      const Register& reg = device.map().registers[index];
      fields.push_back({reg, static_cast<std::uint16_t>(reg.address - request.address), index, shown(reg)});
    }
  }
}

void DeviceIo::take_in(Instant now) {
  const std::lock_guard lock{device_.mutex_};
  if (device_.refreshed_ && device_.map_.heartbeat) {
    if (now > beat_until_) next_beat_ = now;  // it had stopped: do not wait for the old schedule
    beat_until_ = now + device_.map_.heartbeat->refresh_within;
  }
  device_.refreshed_ = false;
  queue_.clear();
  if (!device_.has_queued_) return;
  for (std::size_t i = 0; i < device_.writes_.size(); ++i) {
    auto& slot = device_.writes_[i];
    if (slot.report.state != WriteState::queued) continue;
    if (!slot.stamped) {
      slot.due = now + device_.map_.write_deadline;
      slot.stamped = true;
    }
    if (now > slot.due) {
      slot.report.state = WriteState::expired;
      ++device_.counters_.writes_expired;
    } else {
      queue_.push_back(i);
    }
  }
  device_.has_queued_ = !queue_.empty();
  std::sort(queue_.begin(), queue_.end(), [&](std::size_t a, std::size_t b) {
    return device_.writes_[a].report.number < device_.writes_[b].report.number;
  });
}

bool DeviceIo::beats(Instant now) const { return device_.map().heartbeat && now <= beat_until_; }

bool DeviceIo::has_something_to_do(Instant now) const {
  return !queue_.empty() || now >= next_poll_ || (beats(now) && now >= next_beat_);
}

Instant DeviceIo::next_due(Instant now) const {
  Instant due = std::max(next_poll_, backoff_.retry_at());
  if (beats(now)) due = std::min(due, std::max(next_beat_, backoff_.retry_at()));
  // Writes that wait for a lost link are dropped in time even while nothing can be sent.
  return std::min(due, now + device_.map().poll);
}

Outcome DeviceIo::counted(Outcome outcome, Instant now) {
  const bool answered = !outcome || outcome->cause == Cause::exception;
  if (answered)
    backoff_.succeeded();
  else
    backoff_.failed(now);
  const std::lock_guard lock{device_.mutex_};
  auto& counters = device_.counters_;
  ++counters.requests;
  device_.online_ = answered;
  if (answered)
    ++counters.answers;
  else  // the device may have started anew: what it does not show yet is no fault of it
    for (auto& slot : device_.writes_) slot.unshown_since.reset();
  if (!outcome) return outcome;
  switch (outcome->cause) {
    case Cause::exception:
      ++counters.exceptions[static_cast<std::size_t>(outcome->exception)];
      break;
    case Cause::timeout:
      ++counters.timeouts;
      break;
    case Cause::short_answer:
      ++counters.short_answers;
      break;
    case Cause::malformed:
      ++counters.malformed;
      break;
    default:
      ++counters.resets;
  }
  return outcome;
}

Outcome DeviceIo::beat(Link& link, Instant now) {
  const Heartbeat& heartbeat = *device_.map().heartbeat;
  const Register& reg = device_.map().registers[heartbeat.reg];
  const double step = std::abs(reg.scale);
  const double values = std::floor(reg.range.width() / step) + 1.0;
  beat_count_ = beat_count_ + 1.0 < values ? beat_count_ + 1.0 : 0.0;
  const Words words = encode(reg, reg.range.lower + step * beat_count_);
  next_beat_ = next_in_rhythm(next_beat_, heartbeat.period, now);
  const auto failed = counted(link.write(reg.kind, reg.address, {words.word.data(), reg.width()}), now);
  if (!failed) {
    const std::lock_guard lock{device_.mutex_};
    ++device_.counters_.heartbeats;
  }
  return failed;
}

Outcome DeviceIo::write_next(Link& link, const Clock& clock) {
  const std::size_t index = queue_.front();
  queue_.erase(queue_.begin());
  const Register& reg = device_.map().registers[index];
  WriteReport report;
  {
    const std::lock_guard lock{device_.mutex_};
    auto& slot = device_.writes_[index];
    slot.report.state = WriteState::uncertain;  // what it is if we hear no more of it
    slot.stamped = false;
    report = slot.report;
    ++device_.counters_.writes;
  }
  const Words words = encode(reg, report.wanted);
  const auto failed = counted(link.write(reg.kind, reg.address, {words.word.data(), reg.width()}), clock());

  const std::lock_guard lock{device_.mutex_};
  if (!failed) {
    report.state = WriteState::written;
  } else if (failed->cause == Cause::exception) {
    report.state = WriteState::refused;
    report.exception = failed->exception;
    ++device_.counters_.writes_refused;
  } else {
    ++device_.counters_.writes_uncertain;
  }
  auto& slot = device_.writes_[index];
  if (slot.report.number != report.number) return failed;  // the owner wants something newer by now
  slot.report = report;
  if (report.state == WriteState::refused || !reg.read_back) return failed;
  if (report.state == WriteState::written) {
    if (!slot.unshown_since) slot.unshown_since = clock();
    slot.due = *slot.unshown_since + device_.map_.read_back_deadline;
    slot.stamped = true;
  }
  if (std::find(unresolved_.begin(), unresolved_.end(), index) == unresolved_.end())
    unresolved_.push_back(index);
  return failed;
}

Outcome DeviceIo::read_all(Link& link, const Clock& clock, bool& refused) {
  ++round_;
  for (std::size_t i = 0; i < plan_.size(); ++i) {
    const ReadRequest& request = plan_[i];
    const std::span words{words_.data(), request.count};
    const auto result = link.read(request.kind, request.address, words);
    const Instant now = clock();
    if (const auto failed = counted(result, now)) {
      if (failed->cause != Cause::exception) return failed;
      refused = true;
      continue;
    }
    const std::lock_guard lock{device_.mutex_};
    for (const Field& field : fields_[i]) {
      auto& sample = device_.samples_[field.reg];
      sample.value = decode(field.how, words.subspan(field.at));
      sample.out_of_range = !field.shown.contains(sample.value);
      if (sample.out_of_range) ++device_.counters_.values_out_of_range;
      sample.stamp = now;
      sample.seen = true;
      read_in_round_[field.reg] = round_;
    }
  }
  judge_read_backs(clock());
  return std::nullopt;
}

void DeviceIo::judge_read_backs(Instant now) {
  const auto& registers = device_.map().registers;
  const std::lock_guard lock{device_.mutex_};
  ++device_.counters_.polls;
  std::erase_if(unresolved_, [&](std::size_t index) {
    auto& slot = device_.writes_[index];
    auto& state = slot.report.state;
    if (state != WriteState::written && state != WriteState::uncertain) return true;
    const std::size_t by = *registers[index].read_back;
    if (read_in_round_[by] != round_) return false;
    if (shows(registers[index], slot.report.wanted, registers[by], device_.samples_[by].value)) {
      state = WriteState::confirmed;
      slot.unshown_since.reset();
      return true;
    }
    if (!slot.stamped) {  // the first sight of the device since the answer was lost
      slot.due = now + device_.map_.read_back_deadline;
      slot.stamped = true;
    }
    if (now < slot.due) return false;
    if (state == WriteState::written) {
      state = WriteState::mismatched;
      ++device_.counters_.read_back_mismatches;
    } else {
      state = WriteState::lost;
      ++device_.counters_.writes_lost;
    }
    return true;
  });
}

DeviceIo::Done DeviceIo::exchange(Link& link, const Clock& clock, Reads reads) {
  Done done = Done::all;
  const auto fails = [&](const Outcome& outcome) {
    if (!outcome) return false;
    if (outcome->cause == Cause::exception) {
      done = Done::refused;
      return false;
    }
    return true;
  };
  link.address(device_.map().unit, answer_timeout_);
  const Instant now = clock();
  if (beats(now) && now >= next_beat_ && fails(beat(link, now))) return Done::failed;
  while (!queue_.empty())
    if (fails(write_next(link, clock))) return Done::failed;
  if (reads == Reads::none || (reads == Reads::if_due && now < next_poll_)) return done;
  next_poll_ = next_in_rhythm(next_poll_, device_.map().poll, now);
  bool refused = false;
  if (read_all(link, clock, refused)) return Done::failed;
  return refused ? Done::refused : done;
}

void DeviceIo::offline() {
  const std::lock_guard lock{device_.mutex_};
  device_.online_ = false;
}

}  // namespace invar::modbus

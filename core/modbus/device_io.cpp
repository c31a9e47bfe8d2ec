#include "core/modbus/device_io.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/modbus/codec.hpp"
#include "core/modbus/read_back.hpp"

namespace invar::modbus {

namespace {

std::size_t longest_answer(const std::vector<ReadRequest>& plan) {
  std::size_t longest = 0;
  for (const auto& request : plan) longest = std::max<std::size_t>(longest, request.count);
  return longest;
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

constexpr Duration first_pause = Duration::milliseconds(20);  // of a device that is busy, then twice as long
constexpr unsigned most_busy_answers = 3;  // to the reads of one poll; then the next poll asks

bool is_busy(int exception) { return exception == 5 || exception == 6; }
/// The gateway answers, the device behind it does not.
bool is_out_of_reach(int exception) { return exception == 10 || exception == 11; }

}  // namespace

DeviceIo::DeviceIo(Device& device, Backoff backoff, Duration answer_timeout)
    : device_{device},
      backoff_{backoff},
      answer_timeout_{answer_timeout},
      whole_plan_{plan_reads(device.map())},
      words_(longest_answer(whole_plan_)),
      read_in_round_(device.map().registers.size()) {
  plan(whole_plan_);
}

void DeviceIo::plan(std::vector<ReadRequest> requests) {
  plan_ = std::move(requests);
  fields_.clear();
  pending_.assign(plan_.size(), false);
  for (const auto& request : plan_) {
    auto& fields = fields_.emplace_back();
    for (const std::size_t index : request.registers) {
      const Register& reg = device_.map().registers[index];
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
  const bool reads_left = std::find(pending_.begin(), pending_.end(), true) != pending_.end();
  return (now >= busy_until_ && (!queue_.empty() || reads_left)) || now >= next_poll_ ||
         (beats(now) && now >= next_beat_);
}

Instant DeviceIo::next_due(Instant now) const {
  Instant due = std::max(next_poll_, backoff_.retry_at());
  if (beats(now)) due = std::min(due, std::max(next_beat_, backoff_.retry_at()));
  if (busy_until_ > now) due = std::min(due, busy_until_);
  // Writes that wait for a lost link are dropped in time even while nothing can be sent.
  return std::min(due, now + device_.map().poll);
}

Outcome DeviceIo::counted(Outcome outcome, Instant now) {
  const bool answered =
      !outcome || (outcome->cause == Cause::exception && !is_out_of_reach(outcome->exception));
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
  if (outcome) count(*outcome);
  return outcome;
}

void DeviceIo::count(const Failure& failure) {
  auto& counters = device_.counters_;
  device_.last_failure_ = failure;
  const auto code = static_cast<std::size_t>(failure.exception);
  switch (failure.cause) {
    case Cause::exception:
      ++counters.exceptions[code < counters.exceptions.size() ? code : 0];
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
    case Cause::reset:
      ++counters.resets;
      break;
    case Cause::refused:
    case Cause::unreachable:
      ++counters.unconnected;
  }
}

/// Writes once; again, by the function for several values, where the device has none for one.
Outcome DeviceIo::put(Link& link, const Register& reg, std::span<const std::uint16_t> words,
                      const Clock& clock) {
  const auto once = [&] { return counted(link.write(reg.kind, reg.address, words, multiple_), clock()); };
  const auto is_unknown = [](const Outcome& outcome) {
    return outcome && outcome->cause == Cause::exception && outcome->exception == 1;
  };
  auto failed = once();
  if (multiple_ || words.size() > 1 || !is_unknown(failed)) return failed;
  multiple_ = true;
  failed = once();
  multiple_ = !is_unknown(failed);
  return failed;
}

Outcome DeviceIo::beat(Link& link, const Clock& clock) {
  const Heartbeat& heartbeat = *device_.map().heartbeat;
  const Register& reg = device_.map().registers[heartbeat.reg];
  const double step = std::abs(reg.scale);
  const double values = std::floor(reg.range.width() / step) + 1.0;
  beat_count_ = beat_count_ + 1.0 < values ? beat_count_ + 1.0 : 0.0;
  const Words words = encode(reg, reg.range.lower + step * beat_count_);
  next_beat_ = next_in_rhythm(next_beat_, heartbeat.period, clock());
  const auto failed = put(link, reg, {words.word.data(), reg.width()}, clock);
  if (failed && failed->exception == 6) next_beat_ = clock() + first_pause;
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
    if (slot.report.state != WriteState::queued) return std::nullopt;  // forgotten since
    slot.report.state = WriteState::uncertain;                         // what it is if we hear no more of it
    slot.stamped = false;
    report = slot.report;
    ++device_.counters_.writes;
  }
  const Words words = encode(reg, report.wanted);
  const auto failed = put(link, reg, {words.word.data(), reg.width()}, clock);
  const Instant now = clock();

  const std::lock_guard lock{device_.mutex_};
  auto& slot = device_.writes_[index];
  const bool is_latest = slot.report.number == report.number;  // or the owner wants something newer by now
  const int exception = failed && failed->cause == Cause::exception ? failed->exception : 0;
  if (exception != 6) slot.busy_since.reset();
  if (exception == 6) {
    busy_until_ = now + first_pause;
    ++device_.counters_.asked_again;
    if (!slot.busy_since) slot.busy_since = now;
    if (now - *slot.busy_since < device_.map_.read_back_deadline) {
      if (is_latest) slot.report.state = WriteState::queued;
      device_.has_queued_ = true;
      return failed;
    }
  }
  if (!failed || exception == 5) {  // 5: it is carried out, and takes a while
    report.state = WriteState::written;
  } else if (exception != 0 && exception != 11) {
    report.state = WriteState::refused;
    report.exception = exception;
    ++device_.counters_.writes_refused;
  } else {  // also where a gateway heard no answer of the device behind it
    ++device_.counters_.writes_uncertain;
  }
  if (!is_latest) return failed;
  slot.report = report;
  if (report.state == WriteState::refused || !reg.read_back) return failed;
  if (report.state == WriteState::written) {
    if (!slot.unshown_since) slot.unshown_since = now;
    slot.due = *slot.unshown_since + device_.map_.read_back_deadline;
    slot.stamped = true;
  }
  if (std::find(unresolved_.begin(), unresolved_.end(), index) == unresolved_.end())
    unresolved_.push_back(index);
  return failed;
}

void DeviceIo::take_answer(std::size_t request, std::span<const std::uint16_t> words, Instant now) {
  const std::lock_guard lock{device_.mutex_};
  for (const Field& field : fields_[request]) {
    auto& sample = device_.samples_[field.reg];
    sample.value = decode(field.how, words.subspan(field.at));
    sample.out_of_range = !std::isfinite(sample.value) || !field.shown.contains(sample.value);
    if (sample.out_of_range) ++device_.counters_.values_out_of_range;
    sample.stamp = now;
    sample.seen = true;
    read_in_round_[field.reg] = round_;
  }
}

/// Whether a read that was refused stays to be asked again in this poll.
bool DeviceIo::ask_again(std::size_t request, int exception, Instant now) {
  if (exception == 2 || exception == 3) refused_.push_back(request);
  if (!is_busy(exception) || ++busy_answers_ > most_busy_answers) return false;
  busy_until_ = now + first_pause * (1 << (busy_answers_ - 1));
  const std::lock_guard lock{device_.mutex_};
  ++device_.counters_.asked_again;
  return true;
}

Outcome DeviceIo::read_pending(Link& link, const Clock& clock, bool& refused) {
  ++round_;
  for (std::size_t i = 0; i < plan_.size(); ++i) {
    if (!pending_[i]) continue;
    const ReadRequest& request = plan_[i];
    const std::span words{words_.data(), request.count};
    const auto result = link.read(request.kind, request.address, words);
    const Instant now = clock();
    if (const auto failed = counted(result, now)) {
      if (failed->cause != Cause::exception || is_out_of_reach(failed->exception)) return failed;
      refused = true;
      pending_[i] = ask_again(i, failed->exception, now);
      continue;
    }
    pending_[i] = false;
    take_answer(i, words, now);
  }
  judge_read_backs(clock());
  part_refused();
  return std::nullopt;
}

/// A device that allows fewer registers a request, or has holes where the map has none, is asked in smaller parts. One that
/// refuses everything says nothing of its map: then the requests are made whole again.
void DeviceIo::part_refused() {
  if (refused_.empty() || std::find(pending_.begin(), pending_.end(), true) != pending_.end()) return;
  std::vector<ReadRequest> parts;
  if (refused_.size() == plan_.size() && plan_.size() > whole_plan_.size()) {
    parts = whole_plan_;
  } else {
    for (std::size_t i = 0; i < plan_.size(); ++i) {
      const bool part = std::find(refused_.begin(), refused_.end(), i) != refused_.end();
      for (auto& request : part ? parted(device_.map(), plan_[i]) : std::vector{plan_[i]})
        parts.push_back(std::move(request));
    }
    const std::lock_guard lock{device_.mutex_};
    device_.counters_.splits += parts.size() - plan_.size();
  }
  refused_.clear();
  if (parts.size() != plan_.size()) plan(std::move(parts));
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

/// A device that answered late once is waited for half as long again, within what its values may be old.
void DeviceIo::learn_delay(const Link& link) {
  const LinkCounters& counters = link.counters();
  if (std::exchange(late_, counters.late) == counters.late) return;
  Duration longest = device_.map().answer_timeout;
  for (const Register& reg : device_.map().registers) longest = std::max(longest, reg.stale_after);
  answer_timeout_ = std::max(answer_timeout_, std::min(counters.latest * 3 / 2, longest));
}

DeviceIo::Done DeviceIo::exchange(Link& link, const Clock& clock, Reads reads) {
  Done done = Done::all;
  const auto fails = [&](const Outcome& outcome) {
    if (!outcome) return false;
    done = Done::refused;
    return outcome->cause != Cause::exception || is_out_of_reach(outcome->exception);
  };
  learn_delay(link);
  link.address(device_.map().unit, answer_timeout_);
  const Instant now = clock();
  if (beats(now) && now >= next_beat_ && fails(beat(link, clock))) return Done::failed;
  while (!queue_.empty() && now >= busy_until_)
    if (fails(write_next(link, clock))) return Done::failed;
  if (reads == Reads::none) return done;
  const bool is_due = reads == Reads::now || now >= next_poll_;
  if (is_due) {
    next_poll_ = next_in_rhythm(next_poll_, device_.map().poll, now);
    pending_.assign(plan_.size(), true);
    refused_.clear();
    busy_answers_ = 0;
  } else if (now < busy_until_ || std::find(pending_.begin(), pending_.end(), true) == pending_.end()) {
    return done;
  }
  bool refused = false;
  if (read_pending(link, clock, refused)) return Done::failed;
  if (is_due) {
    const std::lock_guard lock{device_.mutex_};
    device_.round_ = clock() - now;
  }
  return refused ? Done::refused : done;
}

void DeviceIo::offline(const Failure& why) {
  const std::lock_guard lock{device_.mutex_};
  device_.online_ = false;
  device_.last_failure_ = why;
}

}  // namespace invar::modbus

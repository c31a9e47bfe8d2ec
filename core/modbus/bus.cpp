#include "core/modbus/bus.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>

#include "core/base/clock.hpp"
#include "core/base/contract.hpp"
#include "core/modbus/device_io.hpp"

namespace invar::modbus {

Bus::Bus(BusOptions options)
    : options_{std::move(options)},
      link_{options_.host, options_.port},
      link_backoff_{options_.first_retry, options_.longest_retry},
      wake_{eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)} {
  INVAR_EXPECTS(options_.first_retry.ns > 0 && options_.first_retry <= options_.longest_retry);
  if (wake_ < 0) throw std::system_error{errno, std::generic_category(), "eventfd"};
}

Bus::~Bus() {
  stop();
  ::close(wake_);
}

Device& Bus::add(RegisterMap map) {
  INVAR_EXPECTS(!thread_.joinable() && !polled_);
  devices_.push_back(std::make_unique<Device>(std::move(map)));
  Device& device = *devices_.back();
  ios_.push_back(std::make_unique<DeviceIo>(device, Backoff{options_.first_retry, options_.longest_retry},
                                            options_.answer_timeout.value_or(device.map().answer_timeout)));
  return device;
}

void Bus::start() {
  INVAR_EXPECTS(!thread_.joinable() && !polled_);
  for (const auto& device : devices_) {
    const std::lock_guard lock{device->mutex_};
    device->threaded_ = true;
    device->wake_ = wake_;
  }
  stopping_ = false;
  thread_ = std::thread{[this] { run(); }};
}

void Bus::stop() {
  if (!thread_.joinable()) return;
  stopping_ = true;
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto ignored = ::write(wake_, &one, sizeof one);
  thread_.join();
}

bool Bus::exchange(Instant now) {
  set_polled(now);
  return round(now, Part::all);
}

bool Bus::send(Instant now) {
  set_polled(now);
  return round(now, Part::writes_only);
}

LinkCounters Bus::counters() const {
  const std::lock_guard lock{counters_mutex_};
  return counters_;
}

void Bus::set_polled(Instant now) {
  INVAR_EXPECTS(!thread_.joinable());
  polled_ = true;
  for (const auto& device : devices_) {
    const std::lock_guard lock{device->mutex_};
    device->polled_now_ = now;
  }
}

bool Bus::connect(Instant now) {
  if (!link_backoff_.may_try(now)) return false;
  const auto failed = link_.open(options_.connect_timeout);
  connected_ = !failed;
  if (failed)
    link_backoff_.failed(polled_ ? now : monotonic_now());
  else
    link_backoff_.succeeded();
  const std::lock_guard lock{counters_mutex_};
  if (!failed)
    ++counters_.connects;
  else if (failed->cause == Cause::refused)
    ++counters_.refused;
  else
    ++counters_.unreachable;
  return !failed;
}

bool Bus::round(Instant now, Part part) {
  const Clock clock = [this, now] { return polled_ ? now : monotonic_now(); };
  bool all_answered = true;
  for (const auto& io : ios_) io->take_in(now);
  const std::size_t begin = first_;
  for (std::size_t i = 0; i < ios_.size(); ++i) {
    const std::size_t which = (begin + i) % ios_.size();
    DeviceIo& io = *ios_[which];
    if (part == Part::due && !io.has_something_to_do(now)) continue;
    if (!io.may_try(now)) {
      all_answered = false;
      continue;
    }
    if (!link_.is_open() && !connect(now)) {
      io.offline();
      all_answered = false;
      continue;
    }
    const auto reads = part == Part::all   ? DeviceIo::Reads::now
                       : part == Part::due ? DeviceIo::Reads::if_due
                                           : DeviceIo::Reads::none;
    const auto done = io.exchange(link_, clock, reads);
    all_answered = all_answered && done == DeviceIo::Done::all;
    if (done != DeviceIo::Done::failed) continue;
    link_.close();
    connected_ = false;
    first_ = (which + 1) % ios_.size();  // its neighbours go before it next time
    const std::lock_guard lock{counters_mutex_};
    ++counters_.losses;
  }
  return all_answered;
}

void Bus::run() {
  while (!stopping_) {
    round(monotonic_now(), Part::due);
    const Instant now = monotonic_now();
    Instant due = now + Duration::seconds(1);
    for (const auto& io : ios_) due = std::min(due, io->next_due(now));
    // With no connection nothing is polled; wake all the same to drop writes at their deadlines.
    if (!link_.is_open())
      due = std::max(due, std::min(link_backoff_.retry_at(), now + Duration::milliseconds(50)));
    wait_until(due);
  }
  if (link_.is_open()) round(monotonic_now(), Part::writes_only);
}

void Bus::wait_until(Instant when) const {
  const Duration left = std::max(when - monotonic_now(), Duration{0});
  const timespec span{left.ns / 1'000'000'000, left.ns % 1'000'000'000};
  pollfd woken{wake_, POLLIN, 0};
  if (ppoll(&woken, 1, &span, nullptr) <= 0) return;
  std::uint64_t count = 0;
  [[maybe_unused]] const auto ignored = ::read(wake_, &count, sizeof count);
}

}  // namespace invar::modbus

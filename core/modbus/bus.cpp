#include "core/modbus/bus.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <system_error>
#include <utility>

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
  const std::lock_guard io{io_mutex_};
  devices_.push_back(std::make_unique<Device>(std::move(map)));
  Device& device = *devices_.back();
  ios_.push_back(std::make_unique<DeviceIo>(device, Backoff{options_.first_retry, options_.longest_retry},
                                            options_.answer_timeout.value_or(device.map().answer_timeout)));
  const std::lock_guard lock{device.mutex_};
  device.threaded_ = is_started();
  device.wake_ = wake_;
  return device;
}

void Bus::remove(Device& device) {
  const std::lock_guard io{io_mutex_};
  const auto found =
      std::find_if(devices_.begin(), devices_.end(), [&](const auto& one) { return one.get() == &device; });
  INVAR_EXPECTS(found != devices_.end());
  if (connected_ && !polled_) round(monotonic_now(), Part::writes_only, &device);
  ios_.erase(ios_.begin() + (found - devices_.begin()));
  devices_.erase(found);
  first_ = 0;
}

void Bus::start() {
  INVAR_EXPECTS(!thread_.joinable() && !polled_);
  const std::lock_guard io{io_mutex_};
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

bool Bus::exchange(Instant now, const Device* only) {
  const std::lock_guard io{io_mutex_};
  set_polled(now, only);
  return round(now, Part::all, only);
}

bool Bus::send(Instant now, const Device* only) {
  const std::lock_guard io{io_mutex_};
  set_polled(now, only);
  return round(now, Part::writes_only, only);
}

LinkCounters Bus::counters() const {
  const std::lock_guard lock{counters_mutex_};
  return counters_;
}

void Bus::set_polled(Instant now, const Device* only) {
  INVAR_EXPECTS(!thread_.joinable());
  polled_ = true;
  for (const auto& device : devices_) {
    if (only != nullptr && device.get() != only) continue;
    const std::lock_guard lock{device->mutex_};
    device->polled_now_ = now;
  }
}

Outcome Bus::connect(Instant now) {
  if (!link_backoff_.may_try(now)) return unconnected_;
  const auto failed = link_.open(options_.connect_timeout);
  connected_ = !failed;
  if (failed)
    link_backoff_.failed(polled_ ? now : monotonic_now());
  else
    link_backoff_.succeeded();
  if (failed) unconnected_ = *failed;
  return failed;
}

bool Bus::round(Instant now, Part part, const Device* only) {
  const Clock clock = [this, now] { return polled_ ? now : monotonic_now(); };
  bool all_answered = true;
  const auto is_meant = [&](const DeviceIo& io) { return only == nullptr || &io.device() == only; };
  for (const auto& io : ios_)
    if (is_meant(*io)) io->take_in(now);
  const std::size_t begin = first_;
  for (std::size_t i = 0; i < ios_.size(); ++i) {
    const std::size_t which = (begin + i) % ios_.size();
    DeviceIo& io = *ios_[which];
    if (!is_meant(io)) continue;
    if (part == Part::due && !io.has_something_to_do(now)) continue;
    if (!io.may_try(now)) {
      all_answered = false;
      continue;
    }
    if (!link_.is_open()) {
      if (const auto failed = connect(now)) {
        io.offline(*failed);
        all_answered = false;
        continue;
      }
    }
    const auto reads = part == Part::all   ? DeviceIo::Reads::now
                       : part == Part::due ? DeviceIo::Reads::if_due
                                           : DeviceIo::Reads::none;
    const auto done = io.exchange(link_, clock, reads);
    all_answered = all_answered && done == DeviceIo::Done::all;
    if (done != DeviceIo::Done::failed) continue;
    connected_ = link_.is_open();
    first_ = (which + 1) % ios_.size();  // its neighbours go before it next time
  }
  const std::lock_guard lock{counters_mutex_};
  counters_ = link_.counters();
  return all_answered;
}

void Bus::run() {
  while (!stopping_) wait_until(work());
  const std::lock_guard io{io_mutex_};
  if (connected_) round(monotonic_now(), Part::writes_only);
}

/// What is due now; gives when to look again.
Instant Bus::work() {
  const std::lock_guard io{io_mutex_};
  round(monotonic_now(), Part::due);
  const Instant now = monotonic_now();
  Instant due = now + Duration::seconds(1);
  for (const auto& io_of : ios_) due = std::min(due, io_of->next_due(now));
  // With no connection nothing is polled; wake all the same to drop writes at their deadlines.
  if (!link_.is_open())
    due = std::max(due, std::min(link_backoff_.retry_at(), now + Duration::milliseconds(50)));
  return due;
}

void Bus::wait_until(Instant when) const {
  const Duration left = std::max(when - monotonic_now(), Duration{0});
  const timespec span{left.ns / 1'000'000'000, left.ns % 1'000'000'000};
  pollfd woken{wake_, POLLIN, 0};
  if (ppoll(&woken, 1, &span, nullptr) <= 0) return;
  std::uint64_t count = 0;
  [[maybe_unused]] const auto ignored = ::read(wake_, &count, sizeof count);
}

std::shared_ptr<Bus> shared_bus(const BusOptions& options, bool stepped) {
  static std::mutex mutex;
  static std::map<std::pair<std::string, std::uint16_t>, std::weak_ptr<Bus>> buses;
  const std::lock_guard lock{mutex};
  auto& known = buses[{options.host == "localhost" ? "127.0.0.1" : options.host, options.port}];
  std::shared_ptr<Bus> bus = known.lock();
  if (bus) return bus;
  bus = std::make_shared<Bus>(options);
  if (!stepped) bus->start();
  known = bus;
  return bus;
}

}  // namespace invar::modbus

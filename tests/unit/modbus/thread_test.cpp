// The client's I/O thread in real time: polls, heartbeat, a device that goes and comes back. Waits are bounded by a
// watchdog and end as soon as the fact is there.
#include <gmock/gmock.h>

#include <atomic>
#include <functional>
#include <thread>

#include "core/base/clock.hpp"
#include "core/modbus/bus.hpp"
#include "core/modbus/server.hpp"

namespace invar::modbus {
namespace {

RegisterMap map_with(const std::string& poll) {
  return parse_map(
      "invar_modbus_map: 1\ndevice: lamp\npoll: " + poll +
          "\n"
          "timeouts: {answer: 5, stale: 3600, read_back: 3600}\n"
          "heartbeat: {register: heartbeat, period: 0.05, refresh_within: 0.2, timeout: 0.4}\n"
          "comm_loss: {set: {brightness: 0}, flag: comm_lost}\n"
          "registers:\n"
          "  brightness: {address: 0, kind: holding, type: uint16, range: [0, 100],\n"
          "               access: read_write, role: actuator, read_back: self}\n"
          "  heartbeat: {address: 1, kind: holding, type: uint16, access: read_write, role: setting}\n"
          "  steps: {address: 0, kind: input, type: uint32, access: read}\n"
          "  comm_lost: {address: 0, kind: discrete, type: bool, access: read}\n",
      "lamp.yaml");
}

bool comes_true(const std::function<bool()>& fact) {
  const Instant watchdog = monotonic_now() + Duration::seconds(60);
  while (!fact()) {
    if (monotonic_now() > watchdog) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
  return true;
}

/// A lamp that steps every few milliseconds in a thread of its own.
class Lamp {
 public:
  explicit Lamp(std::uint16_t port = 0) : server_{map_with("0.02"), {.port = port}} {
    thread_ = std::thread{[this] {
      for (unsigned steps = 1; !stop_; ++steps) {
        server_.set("steps", steps);
        server_.exchange(monotonic_now());
        brightness = server_.value("brightness");
        comm_lost = server_.comm_lost();
        std::this_thread::sleep_for(std::chrono::milliseconds{2});
      }
    }};
  }
  ~Lamp() {
    stop_ = true;
    thread_.join();
  }
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }

  std::atomic<double> brightness{0.0};
  std::atomic<bool> comm_lost{true};

 private:
  Server server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// An owner that refreshes until it dies.
class Owner {
 public:
  explicit Owner(Device& device) {
    thread_ = std::thread{[this, &device] {
      while (!dead_) {
        device.refresh();
        std::this_thread::sleep_for(std::chrono::milliseconds{5});
      }
    }};
  }
  void die() {
    dead_ = true;
    if (thread_.joinable()) thread_.join();
  }
  ~Owner() { die(); }

 private:
  std::atomic<bool> dead_{false};
  std::thread thread_;
};

TEST(BusThread, PollsByItselfAndReadsFreshValues) {
  Lamp lamp;
  Bus bus{{.port = lamp.port()}};
  Device& device = bus.add(map_with("0.02"));
  bus.start();
  ASSERT_TRUE(comes_true([&] { return device.value("steps").value > 0; }));
  const double before = device.value("steps").value;
  EXPECT_TRUE(comes_true([&] { return device.value("steps").value > before; }));
  EXPECT_FALSE(device.value("steps").stale);
}

TEST(BusThread, LampGoesOutWhenItsOwnerDies) {
  Lamp lamp;
  Bus bus{{.port = lamp.port()}};
  Device& device = bus.add(map_with("0.02"));
  bus.start();
  Owner owner{device};
  ASSERT_TRUE(comes_true([&] { return !lamp.comm_lost; }));
  ASSERT_TRUE(comes_true([&] {  // again and again: on a busy host the lamp may have missed a heartbeat
    (void)device.write("brightness", 80);
    return lamp.brightness == 80.0;
  }));
  owner.die();
  EXPECT_TRUE(comes_true([&] { return lamp.brightness == 0.0; }));
  EXPECT_TRUE(comes_true([&] { return device.value("comm_lost").value == 1.0; }));
  EXPECT_TRUE(bus.is_connected());  // the thread lives on and reads: only its owner is dead
}

TEST(BusThread, ComesBackWhenTheDeviceWasGone) {
  auto lamp = std::make_unique<Lamp>();
  const std::uint16_t port = lamp->port();
  Bus bus{{.port = port, .longest_retry = Duration::milliseconds(200)}};
  Device& device = bus.add(map_with("0.02"));
  bus.start();
  ASSERT_TRUE(comes_true([&] { return device.is_online() && device.value("steps").value > 20; }));
  lamp.reset();
  ASSERT_TRUE(comes_true([&] { return !device.is_online() && bus.counters().refused > 1; }));
  EXPECT_GT(device.value("steps").value, 20);  // the last value stays, and its age tells
  lamp = std::make_unique<Lamp>(port);
  EXPECT_TRUE(comes_true([&] { return device.is_online() && bus.counters().connects == 2; }));
  EXPECT_TRUE(comes_true([&] { return device.value("steps").age < Duration::seconds(1); }));
}

TEST(BusThread, AWriteDoesNotWaitForTheNextPoll) {
  Lamp lamp;
  Bus bus{{.port = lamp.port()}};
  Device& device = bus.add(map_with("1000"));
  bus.start();
  Owner owner{device};
  ASSERT_TRUE(comes_true([&] { return !lamp.comm_lost; }));
  (void)device.write("brightness", 50);
  EXPECT_TRUE(comes_true([&] { return device.last_write("brightness").state == WriteState::written; }));
  EXPECT_LE(device.counters().polls, 1U);
}

TEST(BusThread, StopSendsWhatIsQueuedAndEndsTheHeartbeat) {
  Lamp lamp;
  Bus bus{{.port = lamp.port()}};
  Device& device = bus.add(map_with("0.02"));
  bus.start();
  Owner owner{device};
  ASSERT_TRUE(comes_true([&] { return !lamp.comm_lost; }));
  ASSERT_TRUE(comes_true([&] { return device.value("steps").value > 0; }));
  (void)device.write("brightness", 30);
  bus.stop();
  const auto last = device.last_write("brightness").state;
  EXPECT_TRUE(last == WriteState::written || last == WriteState::confirmed) << name_of(last);
  EXPECT_TRUE(comes_true([&] { return lamp.comm_lost && lamp.brightness == 0.0; }));
}

TEST(BusThread, SeveralMastersAreServedAtOnce) {
  Lamp lamp;
  std::vector<std::unique_ptr<Bus>> buses;
  std::vector<Device*> devices;
  for (int i = 0; i < 8; ++i) {
    buses.push_back(std::make_unique<Bus>(BusOptions{.port = lamp.port()}));
    devices.push_back(&buses.back()->add(map_with("0.02")));
    buses.back()->start();
  }
  for (auto* device : devices) EXPECT_TRUE(comes_true([&] { return device->counters().polls > 5; }));
}

}  // namespace
}  // namespace invar::modbus

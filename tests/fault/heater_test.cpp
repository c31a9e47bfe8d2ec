// The heater's owner dies by SIGKILL: the device's own watchdog switches the heater off.
#include <gmock/gmock.h>

#include <functional>
#include <thread>

#include "core/base/clock.hpp"
#include "core/modbus/server.hpp"
#include "tests/support/process.hpp"

namespace invar {
namespace {

TEST(HeaterFault, HeaterGoesOffWhenItsOwnersProcessIsKilledAndOnAgainWithANewOne) {
  modbus::Server device{modbus::load_map(INVAR_SOURCE_DIR "/deployment/maps/heater.yaml"), {}};
  const auto comes_true = [&](const std::function<bool()>& fact) {
    const Instant watchdog = monotonic_now() + Duration::seconds(90);
    while (!fact()) {
      if (monotonic_now() > watchdog) return false;
      device.set("slide_resistance", 1000.0);  // 25 degC: the loop wants power
      device.set("ready", 1.0);
      device.exchange(monotonic_now());
      std::this_thread::sleep_for(std::chrono::milliseconds{5});
    }
    return true;
  };
  const auto heats = [&] { return device.value("enable") == 1.0 && device.value("power") > 1.0; };
  EXPECT_FALSE(comes_true([&, rounds = 0]() mutable { return heats() || ++rounds > 20; }) && heats());

  for (int life = 0; life < 2; ++life) {
    test::Process owner{{INVAR_HEATER_OWNER, std::to_string(device.port())}};
    ASSERT_EQ(owner.line(), "running");
    ASSERT_TRUE(comes_true(heats)) << "life " << life;
    owner.kill();
    const Instant killed = monotonic_now();
    ASSERT_TRUE(comes_true([&] { return device.comm_lost(); })) << "life " << life;
    EXPECT_EQ(device.value("power"), 0.0);
    EXPECT_EQ(device.value("enable"), 0.0);
    // Not at once either: it was the watchdog, after the map's second since the last heartbeat.
    EXPECT_GT((monotonic_now() - killed).in_seconds(), 0.5);
  }
}

}  // namespace
}  // namespace invar

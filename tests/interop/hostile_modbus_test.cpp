// A heater loop against controllers that misbehave: none gets power by a reading that it did not give, and the others heat.
#include <gmock/gmock.h>

#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "components/thermal/thermal.hpp"
#include "core/base/clock.hpp"
#include "idl/event.h"
#include "tests/support/changed_map.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::thermal {
namespace {

using nlohmann::json;

/// A loop on one device, and what it said.
struct Owner final : Component {
  Input<NodeTemperature> state{*this, "state"};
  Inbox<event::Notice> notices{*this, "notices", {}, 256};
  Thermal::Parameters parameters;
  std::unique_ptr<Thermal> thermal;
  std::string said;
  double worst = 0.0;  // farthest that a sound reading was from the truth [K]
  bool sound = false;  // at least once

  Owner(std::int64_t port, const std::filesystem::path& map) {
    parameters.modbus.port = port;
    parameters.modbus.map = map;
    parameters.setpoint = 50.0;
    thermal = std::make_unique<Thermal>(parameters);
    thermal->configure();
    static_cast<OutputPort*>(thermal->find_port("state"))->connect(state);
    static_cast<OutputPort*>(thermal->find_port("notices"))->connect(notices);
    thermal->activate();
  }
  void step(const Tick& tick) noexcept override {
    thermal->set_now(tick.now);
    thermal->step(tick);
    event::Notice notice;
    while (notices.take(notice)) said += std::string{notice.text().c_str()} + "\n";
    const NodeTemperature& sample = *state.latest();
    if (sample.stale()) return;
    sound = true;
    worst = std::max(worst, std::abs(sample.temperature() - 25.0));
  }
};

TEST(HostileModbus, NoDeviceHeatsByWhatItDidNotSayAndEachIsNamedByItsCause) {
  const invar::testing::TemporaryFolder folder;
  // So many devices behind one Python process answer slowly.
  const auto map =
      test::changed_map(folder, "heater.yaml",
                        {{"poll: {value: 100, unit: ms}", "poll: {value: 300, unit: ms}"},
                         {"answer: {value: 250, unit: ms}", "answer: {value: 2, unit: s}"},
                         {"stale: {value: 500, unit: ms}", "stale: {value: 9, unit: s}"},
                         {"read_back: {value: 500, unit: ms}", "read_back: {value: 2, unit: s}"}});
  test::Process devices{{"/usr/bin/python3", INVAR_SOURCE_DIR "/tests/interop/hostile_devices.py"}};
  const json table = json::parse(devices.line());
  ASSERT_GE(table.size(), 34U);
  std::map<std::string, std::unique_ptr<Owner>> owners;
  for (const auto& [name, device] : table.items())
    owners[name] = std::make_unique<Owner>(device[0].get<std::int64_t>(), map);

  json seen;
  const auto is_complete = [&] {
    for (const auto& [name, device] : table.items()) {
      if (owners[name]->said.find(device[2].get<std::string>()) == std::string::npos) return false;
      if (device[1] == true && seen[name][0] == 0) return false;
    }
    return true;
  };
  const Instant begin = monotonic_now();
  for (std::uint64_t cycle = 0;; ++cycle) {
    const Tick tick{monotonic_now(), 0.2, cycle};
    for (auto& [name, owner] : owners) owner->step(tick);
    std::this_thread::sleep_for(std::chrono::milliseconds{200});
    if (cycle % 5 != 4) continue;
    devices.send("");
    seen = json::parse(devices.line());
    const double ran = (monotonic_now() - begin).in_seconds();
    if (ran > 60.0 || (ran > 6.0 && is_complete())) break;
  }
  for (const auto& [name, device] : table.items()) {
    const Owner& owner = *owners[name];
    EXPECT_LT(owner.worst, 1e-3) << name << " was believed a wrong temperature";
    EXPECT_THAT(owner.said, ::testing::HasSubstr(device[2].get<std::string>())) << name;
    EXPECT_GT(seen[name][1].get<int>(), 0) << name;
    if (device[1].is_null()) continue;  // its readings are true, and it does what it is told
    if (device[1].get<bool>()) {
      EXPECT_TRUE(owner.sound) << name << "\n" << owner.said;
      EXPECT_GT(seen[name][0].get<int>(), 0) << name << " does not heat\n" << owner.said;
    } else {
      EXPECT_EQ(seen[name][0].get<int>(), 0) << name << " heats\n" << owner.said;
    }
  }
  std::cout << table.size() << " devices\n";
  for (auto& [name, owner] : owners) owner->thermal->cleanup();
}

}  // namespace
}  // namespace invar::thermal

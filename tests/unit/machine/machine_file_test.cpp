#include "core/machine/machine_file.hpp"
#include "core/machine/heat_growth.hpp"
#include "tests/support/fault_of.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

namespace invar::machine {
namespace {

using ::testing::HasSubstr;

std::string fault_of(const std::string& text) {
  return invar::testing::fault_of([&] {
    const auto yaml = config::Yaml::parse(text, "m.yaml");
    (void)read_machine(yaml.root());
    yaml.finish();
  });
}

TEST(MachineFile, ReadsTheHiddenErrorsOfASimulatedMachine) {
  const auto yaml = config::Yaml::parse(R"(
invar_machine: 1
chain: [y, x]
travel: {x: [0, 0.2], y: [-0.1, 0.1]}
tool: {z: -0.05}
resolution: {x: 1e-6}
errors:
  EXX: {polynomial: [0, 5e-5], harmonics: [{amplitude: 2e-6, period: 0.1, phase: 0.5}]}
  ECX: {table: {position: [0, 0.1, 0.2], value: [0, 4e-6, 8e-6]}}
  EC0Y: {value: 100, unit: arcsec}
  reversal: {x: 2e-6, y: {polynomial: [1e-6, 2e-5]}}
)",
                                        "m.yaml");
  const auto machine = read_machine(yaml.root());
  yaml.finish();
  EXPECT_EQ(machine.chain.axes, 2);
  EXPECT_EQ(machine.chain.order[0], 1);
  EXPECT_DOUBLE_EQ(machine.travel[1].lower, -0.1);
  EXPECT_DOUBLE_EQ(machine.tool.z(), -0.05);
  const auto& errors = *machine.errors;
  EXPECT_NEAR(errors.functions[0](0.03), 1.5e-6 + 2e-6 * std::sin(2 * std::numbers::pi * 0.3 + 0.5), 1e-18);
  EXPECT_NEAR(errors.functions[5](0.15), 6e-6, 1e-18);
  EXPECT_NEAR(errors.squareness[0], -std::sin(100 * 4.84813681e-6), 1e-11);
  const auto directions = metrology::axis_directions(machine.chain, errors.squareness);
  const auto e = metrology::simulated_error(machine, directions, {0.03, 0.0, 0.0}, {0, 0, 0}, {1, 0, 0});
  EXPECT_NEAR(e.x(), errors.functions[0](0.03) + 1e-6 - 0.03 * (1 - directions(0, 0)), 1e-12);
  EXPECT_NEAR(errors.reversal[1](0.1), 3e-6, 1e-18);  // over position
}

TEST(MachineFile, HeatStretchesAndBowsTheScaleAndStretchesTheBase) {
  const auto yaml = config::Yaml::parse(R"(
invar_machine: 1
chain: [x]
travel: {x: [0, 0.2]}
errors:
  reference_temperature: 26.8
  expansion: {x: {value: -19, unit: um/(m*K)}}
  bending: {x: 4e-7}
  base_expansion: {x: 5e-6}
  scale_lag: 90
)",
                                        "m.yaml");
  const auto machine = read_machine(yaml.root(), 1);
  yaml.finish();
  EXPECT_EQ(machine.errors->scale_lag, 90.0);
  // At a quarter of the travel the bow is three quarters of its depth.
  const Eigen::Vector3d growth = heat_growth(machine, {0.05, 0.0, 0.0}, 28.8, 27.8);
  EXPECT_NEAR(growth.x(), 2.0 * (-19e-6 * 0.05 + 0.75 * 4e-7) + 1.0 * 5e-6 * 0.05, 1e-18);
  EXPECT_EQ(growth.y(), 0.0);
}

TEST(MachineFile, NamesEachFault) {
  const std::string head = "invar_machine: 1\n";
  const std::string travel = "travel: {x: [0, 0.2], y: [0, 0.2]}\n";
  EXPECT_THAT(fault_of(head + "chain: [y, x, w]\n" + travel), HasSubstr("`w` is no axis"));
  EXPECT_THAT(fault_of(head + "chain: [y, y]\n" + travel), HasSubstr("twice"));
  EXPECT_THAT(fault_of(head + "chain: [y, x]\ntravel: {x: [0, 0], y: [0, 1]}\n"), HasSubstr("travel.x"));
  EXPECT_THAT(fault_of(head + "chain: [y, x]\ntravle: {x: [0, 1], y: [0, 1]}\n"), HasSubstr("travel"));
  EXPECT_THAT(fault_of(head + "chain: [y, x]\n" + travel + "errors: {EXZ: {polynomial: [1]}}\n"),
              HasSubstr("no axis z"));
  EXPECT_THAT(fault_of("chain: [y, x]\n" + travel), HasSubstr("invar_machine"));
}

}  // namespace
}  // namespace invar::machine

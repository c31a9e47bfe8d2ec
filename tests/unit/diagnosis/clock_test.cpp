// A column of time in another unit than its header says is refused; a machine that is only other than believed is not.
#include "core/diagnosis/checks/clock.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "tests/support/fault_of.hpp"
#include "tests/support/mismatch/marks.hpp"
#include "tests/support/model_of.hpp"

namespace invar::test::mismatch {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// The machine's recordings, their time read as `factor` times what it is.
std::string said_of(Machine machine, double factor) {
  return testing::fault_of([&] {
    const auto model = model_of(machine);
    for (auto& table : machine.recordings)
      for (auto& column : table.columns)
        if (column.name == model.signal("time")->column)
          for (double& t : column.values) t *= factor;
    diagnosis::check_clock(diagnosis::make_case(model, machine.recordings));
  });
}

TEST(Clock, NoMachineIsRefusedForWhatItsModelLeavesOut) {
  for (const char* plant : {"thermal", "sensor", "equations"})
    for (const auto& effect : effects(plant))
      for (const unsigned seed : {401U, 402U})
        EXPECT_EQ(said_of(make(plant, effect, 2.0, seed), 1.0), "accepted")
            << plant << ' ' << effect << ' ' << seed;
}

TEST(Clock, HeatWhoseTimeIsInAnotherUnitIsRefused) {
  for (const unsigned seed : {411U, 412U, 413U, 414U}) {
    const auto machine = make("thermal", "none", 1.0, seed);
    SCOPED_TRACE(machine.yaml);
    EXPECT_THAT(said_of(machine, 1e3),
                AllOf(HasSubstr("were the time 1000 times shorter"), HasSubstr(" [ms]` for ")));
    EXPECT_THAT(said_of(machine, 1e-3), HasSubstr("were the time 1000 times longer"));
    EXPECT_THAT(said_of(machine, 1.0 / 60.0), HasSubstr("were the time 60 times longer"));
    EXPECT_THAT(said_of(machine, 1.0 / 3600.0), HasSubstr("were the time 3600 times longer"));
  }
}

TEST(Clock, OwnEquationsAreRefusedTooThoughTheyLackADelay) {
  for (const char* effect : {"none", "delay"}) {
    const auto machine = make("equations", effect, 1.0, 421);
    SCOPED_TRACE(machine.yaml);
    EXPECT_THAT(said_of(machine, 1e3), HasSubstr("were the time 1000 times shorter"));
    EXPECT_THAT(said_of(machine, 1e-3), HasSubstr("were the time 1000 times longer"));
  }
}

/// A tank of which the user knows each number to its own size alone, and whose time constant is four times as long.
TEST(Clock, OwnEquationsWithUnsureNumbersAreRetunedFirst) {
  const auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
      "states: {x: {derivative: 'k*u - x/T', initial: {value: 0, sigma: 0}}}\n"
      "outputs: {y: {column: y, expression: x}}\n"
      "parameters: {k: {value: 1, sigma: 1}, T: {value: 2, sigma: 3}}\n");
  for (const double factor : {1.0, 1e3, 1e-3}) {
    recording::Table table;
    std::vector<double> time, drive, level;
    double x = 0.0, u = 0.0;
    for (int i = 0; i < 800; ++i) {
      if (i % 40 == 0) u = std::sin(1.7 * i);
      time.push_back(factor * 0.1 * i), drive.push_back(u), level.push_back(x);
      x = 12.0 * u + (x - 12.0 * u) * std::exp(-0.1 / 8.0);
    }
    table.add("t", "s", time);
    table.add("u", "", drive);
    table.add("y", "", level);
    const auto said =
        testing::fault_of([&] { diagnosis::check_clock(diagnosis::make_case(model, {table})); });
    EXPECT_THAT(said, HasSubstr(factor == 1.0  ? "accepted"
                                : factor > 1.0 ? "1000 times shorter"
                                               : "1000 times longer"));
  }
}

TEST(Clock, WhereNumbersOfTheModelAreStartValuesTheFitDecides) {
  auto machine = make("thermal", "none", 1.0, 411);
  auto model = model_of(machine);
  model.parameters.front().sigma.reset();
  auto data = diagnosis::make_case(model, machine.recordings);
  for (auto& recording : data.recordings) {
    for (double& t : recording.inputs.time) t *= 1e3;
    recording.simulation = physics::prepare(model, recording.inputs);
  }
  EXPECT_NO_THROW(diagnosis::check_clock(data));
}

/// An axis without controller, 2 x'' = 6 u - 8 x', at rest for 0.3 s and then under steps of current; exact.
Machine pushed_axis() {
  std::mt19937 random{5};
  std::uniform_real_distribution<double> currents{-1.0, 1.0};
  std::normal_distribution<double> noise{0.0, 1e-6};
  constexpr double rate = 4.0, gain = 3.0, period = 2e-3;
  const double kept = std::exp(-rate * period);
  double x = 0.0, v = 0.0, u = 0.0;
  recording::Table table;
  std::vector<double> time, current, position;
  for (int k = 0; k < 4000; ++k) {
    if (k >= 150 && k % 100 == 50) u = currents(random);
    time.push_back(k * period), current.push_back(u), position.push_back(x + noise(random));
    const double end = gain / rate * u;
    x += end * period + (v - end) * (1.0 - kept) / rate;
    v = end + (v - end) * kept;
  }
  table.add("t", "s", time);
  table.add("u", "A", current);
  table.add("y", "m", position);
  Machine machine;
  machine.yaml =
      "invar_model: 1\nplant: axis\ncolumns: {time: t, position: y, current: u}\nparameters:\n"
      "  mass: {value: 2, unit: kg, sigma: 0.02}\n  motor_constant: {value: 6, unit: N/A, sigma: 0.05}\n"
      "  viscous_damping: {value: 8, unit: N s/m, sigma: 0.4}\n";
  machine.recordings = {table};
  return machine;
}

TEST(Clock, AnAxisWhoseTimeIsInAnotherUnitIsRefused) {
  EXPECT_EQ(said_of(pushed_axis(), 1.0), "accepted");
  EXPECT_THAT(said_of(pushed_axis(), 1e3), HasSubstr("were the time 1000 times shorter"));
  EXPECT_THAT(said_of(pushed_axis(), 1e-3), HasSubstr("were the time 1000 times longer"));
  EXPECT_THAT(said_of(pushed_axis(), 1.0 / 60.0), HasSubstr("were the time 60 times longer"));
}

TEST(Clock, RowsThatAreNoTicksOfTheControllerAreRefused) {
  const auto machine = make("axis", "none", 1.0, 421);
  for (const double factor : {1e3, 1e-3, 3600.0})
    EXPECT_THAT(said_of(machine, factor), HasSubstr("apart, the model's controller has a period of 1 ms"));
  EXPECT_EQ(said_of(machine, 10.0), "accepted");  // each tenth cycle alone was written down
}

}  // namespace
}  // namespace invar::test::mismatch

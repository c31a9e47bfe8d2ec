// A column of time in another unit than its header says is refused; a machine that is only other than believed is not.
#include "tools/diagnose/clock.hpp"

#include <gmock/gmock.h>

#include "tests/support/fault_of.hpp"
#include "tests/support/mismatch/marks.hpp"

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
    diagnose::check_clock(diagnose::make_case(model, machine.recordings));
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

TEST(Clock, WhereNumbersOfTheModelAreStartValuesTheFitDecides) {
  auto machine = make("thermal", "none", 1.0, 411);
  auto model = model_of(machine);
  model.parameters.front().sigma.reset();
  auto data = diagnose::make_case(model, machine.recordings);
  for (auto& recording : data.recordings) {
    for (double& t : recording.inputs.time) t *= 1e3;
    recording.simulation = physics::prepare(model, recording.inputs);
  }
  EXPECT_NO_THROW(diagnose::check_clock(data));
}

TEST(Clock, RowsThatAreNoTicksOfTheControllerAreRefused) {
  const auto machine = make("axis", "none", 1.0, 421);
  for (const double factor : {1e3, 1e-3, 3600.0})
    EXPECT_THAT(said_of(machine, factor), HasSubstr("apart, the model's controller has a period of 1 ms"));
  EXPECT_EQ(said_of(machine, 10.0), "accepted");  // each tenth cycle alone was written down
}

}  // namespace
}  // namespace invar::test::mismatch

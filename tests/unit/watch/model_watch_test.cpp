// A stage and its model that part while the axis works: noticed, placed, and not noticed where there is nothing.
#include "components/watch/model_watch.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <map>
#include <optional>

#include "tests/support/real_time_guard.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::watch {
namespace {

using ::testing::HasSubstr;

const std::filesystem::path machines = std::filesystem::path{INVAR_SOURCE_DIR} / "deployment" / "machines";

struct Human final : Component {
  Output<compensation::ModelCommand> model{*this, "model", "command"};
  Inbox<event::Notice> notices{*this, "notices", {.profile = "event"}};
  void step(const Tick&) noexcept override {}
};

/// What an axis really is.
struct Truth {
  std::string terms;  // YAML of the list
  double mass = 3.2, motor_constant = 12.0, viscous_damping = 18.0;
};

/// The axis of deployment/mismatch.yaml with other physics inside, going forth and back at three speeds.
class WatchedAxis {
 public:
  WatchedAxis(const testing::TemporaryFolder& folder, const std::optional<Truth>& later, double at,
              const Truth& first = {})
      : axis_{world_parameters(folder, later, at, first), stage_parameters()} {
    wired_.join(axis_.stage, "state", watch_, "state");
    wired_.join(human_, "model", watch_, "model");
    wired_.join(watch_, "notices", human_, "notices");
    wired_.add(axis_.world);
    wired_.add(axis_.stage);
    wired_.add(watch_);
    wired_.add(axis_.hand);
    wired_.add(human_);
    wired_.start();
    wired_.step();
    tell(stage::AXIS_COMMAND_ENABLE, 0.0, 0.0);
  }

  /// Works for so long and returns what was noticed, with the times.
  std::map<double, std::string> work(double seconds) {
    std::map<double, std::string> heard;
    const double until = wired_.time() + seconds;
    constexpr double speeds[] = {0.06, 0.15, 0.1};
    while (wired_.time() < until) {
      const support::RealTimeGuard guard;
      wired_.step();
      violations_ += guard.violations();
      event::Notice notice;
      while (human_.notices.take(notice)) heard[wired_.time()] = notice.text().c_str();
      if (axis_.hand.state.latest()->command_done() &&
          axis_.hand.state.latest()->mode() == stage::AXIS_MODE_HOLDING) {
        tell(stage::AXIS_COMMAND_MOVE, moves_ % 2 == 0 ? 0.16 : 0.02, speeds[(moves_ / 2) % 3]);
        ++moves_;
      }
    }
    return heard;
  }
  void give_model(const std::filesystem::path& file) {
    for (const auto kind : {compensation::MODEL_STAGE, compensation::MODEL_ACTIVATE}) {
      compensation::ModelCommand command;
      command.id(++id_);
      command.kind(kind);
      command.path(file.string());
      human_.model.write(command);
      wired_.step();
    }
  }
  /// Allocations and locks of all steps so far.
  [[nodiscard]] std::uint64_t violations() const { return violations_; }
  [[nodiscard]] const ModelWatch& watch() const { return watch_; }

  static std::filesystem::path write(const testing::TemporaryFolder& folder, const std::string& name,
                                     const Truth& truth) {
    const auto file = folder / (name + ".yaml");
    std::ofstream{file}
        << "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: y, current: u}\n"
        << "controller: {kind: pid, rate: 1000.0, kp: 4.0e4, ki: 8.0e5, kd: 300.0, limit: 10.0}\n"
        << "parameters: {mass: {value: " << truth.mass
        << ", unit: kg}, motor_constant: {value: " << truth.motor_constant
        << ", unit: N/A}, viscous_damping: {value: " << truth.viscous_damping << ", unit: N s/m}}\nterms: ["
        << truth.terms << "]\n";
    return file;
  }

 private:
  static world::SimulatedStage::Parameters world_parameters(const testing::TemporaryFolder& folder,
                                                            const std::optional<Truth>& later, double at,
                                                            const Truth& first) {
    world::SimulatedStage::Parameters p;
    p.machine = machines / "linear-axis.yaml";
    p.x.model = write(folder, "first", first);
    if (later) p.x.changed = write(folder, "later", *later);
    p.x.change_at = at;
    return p;
  }
  static stage::Stage::Parameters stage_parameters() {
    stage::Stage::Parameters p;
    p.control.ki = 8e5;
    p.model = machines / "linear-axis-believed.yaml";
    return p;
  }
  static ModelWatch::Parameters watch_parameters() {
    ModelWatch::Parameters p;
    p.model = machines / "linear-axis-believed.yaml";
    return p;
  }
  void tell(stage::AxisCommandKind kind, double position, double velocity) {
    axis_.tell(kind, position, velocity);
    wired_.step();
    wired_.step();
  }

  support::WiredAxis axis_;
  support::Wired& wired_ = axis_.wired;
  ModelWatch::Parameters of_watch_ = watch_parameters();
  ModelWatch watch_{of_watch_};
  Human human_;
  std::uint64_t id_ = 0;
  int moves_ = 0;
  std::uint64_t violations_ = 0;
};

TEST(ModelWatch, IsSilentForTwentyMinutesWhereTheModelIsRightWithinItsSigmas) {
  const testing::TemporaryFolder folder;
  // Each parameter of the machine is one sigma off what the model says.
  WatchedAxis axis{folder, std::nullopt, 1e9, {"", 3.25, 12.1, 19.0}};
  const auto heard = axis.work(1200.0);
  EXPECT_TRUE(heard.empty()) << heard.begin()->second;
  EXPECT_LT(axis.watch().over_noise(), 2.0);
  EXPECT_GT(axis.watch().over_noise(), 0.0);
  EXPECT_FALSE(axis.watch().parted());
}

struct Effect {
  const char* name;
  Truth truth;
  const char *site, *depends_on;
};

class Beginning : public ::testing::TestWithParam<Effect> {};

TEST_P(Beginning, IsNoticedWithinSecondsAndPlaced) {
  const testing::TemporaryFolder folder;
  WatchedAxis axis{folder, GetParam().truth, 60.0};
  const auto heard = axis.work(80.0);
  ASSERT_EQ(heard.size(), 1U);
  const auto& [time, text] = *heard.begin();
  std::cout << time - 60.0 << " s: " << text << '\n';
  EXPECT_GT(time, 60.0);
  EXPECT_LT(time, 68.0);  // after 4 s of motion
  EXPECT_THAT(text, HasSubstr(std::string{GetParam().site} + ", goes with " + GetParam().depends_on));
  EXPECT_TRUE(axis.watch().parted());
  EXPECT_EQ(axis.violations(), 0U);
}

INSTANTIATE_TEST_SUITE_P(
    Effects, Beginning,
    ::testing::Values(
        Effect{"DryFriction",
               {"{term: coulomb_friction, level: {value: 2.0, unit: N}}"},
               "axis.force",
               "direction"},
        Effect{"ForceRipple",
               {"{term: force_ripple, amplitude: {value: 2.4, unit: N}, pitch: {value: 0.0317, unit: m}, "
                "phase: {value: "
                "0.7, unit: rad}}"},
               "axis.force",
               "position"},
        Effect{"Tilt", {"{term: constant_force, force: {value: 3.0, unit: N}}"}, "axis.force", "nothing"},
        Effect{"WeakMagnets", {"", 3.2, 6.0, 18.0}, "axis.actuator", "current"},
        Effect{"Grease", {"", 3.2, 12.0, 60.0}, "axis.force", "velocity"},
        Effect{"Pulsation",
               {"{term: periodic_disturbance, frequency: {value: 7.3, unit: Hz}, amplitude: {value: 3.0, "
                "unit: N}, phase: {value: 0, unit: rad}}"},
               "axis.disturbance",
               "time"}),
    [](const auto& effect) { return std::string{effect.param.name}; });

TEST(ModelWatch, TakesItBackWithHysteresisWhenTheModelHasTheEffect) {
  const testing::TemporaryFolder folder;
  const Truth rubbing{"{term: coulomb_friction, level: {value: 2.0, unit: N}}"};
  WatchedAxis axis{folder, std::nullopt, 1e9, rubbing};
  auto heard = axis.work(20.0);
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_THAT(heard.begin()->second, HasSubstr("axis and model part"));
  axis.give_model(WatchedAxis::write(folder, "patched", rubbing));
  heard = axis.work(60.0);
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_THAT(heard.begin()->second, HasSubstr("another model"));
  EXPECT_FALSE(axis.watch().parted());
}

TEST(ModelWatch, RefusesAModelOfAnotherPlant) {
  const testing::TemporaryFolder folder;
  ModelWatch::Parameters parameters;
  parameters.model = folder / "room.yaml";
  std::ofstream{parameters.model}
      << "invar_model: 1\nplant: thermal\ncolumns: {time: t}\nambient: T\nnodes: {a: {column: "
         "a, capacity: {value: 1, unit: J/K}, loss: {value: 1, unit: W/K}}}\n";
  ModelWatch watch{parameters};
  try {
    watch.configure();
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("it is a model of plant thermal, not of an axis"));
  }
}

}  // namespace
}  // namespace invar::watch

// The jobs of an axis on simulated devices: what the ripple's feedforward and the fused position are worth.
#include "components/calibration/axis_trial.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <optional>

#include "core/model/model_file.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/trial_cell.hpp"

namespace invar::calibration {
namespace {

using support::machines;

class Cell : public support::TrialCell<AxisTrial> {
 public:
  Cell(world::SimulatedStage::Parameters of_world, stage::Stage::Parameters of_stage,
       AxisTrial::Parameters of)
      : TrialCell{std::move(of_world), std::move(of_stage), std::move(of)} {
    wired.join(axis.stage, "model_status", trial, "model_status");
    wired.join(trial, "model", axis.stage, "model");
  }
};

TEST(AxisTrial, IdentifiesTheRippleAndLowersTheFollowingErrorOfRunsNotFitted) {
  auto of_world = support::trial_world();
  of_world.z.model = (machines / "axis-rippled.yaml").string();
  stage::Stage::Parameters of_stage;
  of_stage.axis = 2;
  of_stage.control.ki = 8e5;
  of_stage.model = machines / "axis-nominal.yaml";
  AxisTrial::Parameters of_trial;
  of_trial.axis = 2;
  const invar::testing::TemporaryFolder folder;
  const auto out = folder / "ripple";
  of_trial.ripple.resize(1);
  of_trial.ripple[0].name = "ripple";
  of_trial.ripple[0].model = machines / "axis-nominal.yaml";
  of_trial.ripple[0].from = 0.01;
  of_trial.ripple[0].to = 0.19;
  of_trial.ripple[0].out = out.string();
  Cell cell{of_world, of_stage, of_trial};
  cell.bring_up();
  const auto status = cell.run("ripple");
  EXPECT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
  std::cout << status.text().c_str() << '\n';
  const auto model = model::load(out / "patched.yaml");
  ASSERT_GE(model.terms.size(), 2U);
  EXPECT_NEAR(model.terms[0].values[0], 2.4, 0.1);  // the truth in axis-rippled.yaml
  EXPECT_NEAR(model.terms[0].values[1], 0.0317, 3e-5);
  const auto rms = [&](const char* file) {
    const auto table = recording::Table::read(out / file);
    const auto error = table.in("following_error", "m"), reference = table.in("reference", "m");
    double sum = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < error.size(); ++i) {
      if (reference[i] < 0.03 || reference[i] > 0.17) continue;
      sum += error[i] * error[i];
      ++count;
    }
    return std::sqrt(sum / count);
  };
  EXPECT_LT(rms("ripple_after.csv"), 0.5 * rms("ripple_before.csv"));
}

TEST(AxisTrial, FusedTrackingBeatsTheEncoderAlone) {
  double rms[2];
  for (const bool fused : {false, true}) {
    AxisTrial::Parameters of_trial;
    const invar::testing::TemporaryFolder folder;
    const auto out = folder / "tracking";
    of_trial.tracking.resize(1);
    of_trial.tracking[0].name = "track";
    of_trial.tracking[0].periods = {3.0};
    of_trial.tracking[0].out = out.string();
    Cell cell{support::coarse_world(), support::coarse_stage(), of_trial};
    support::FusedTachometer pair;
    pair.of_tachometer.latency = 0.003;
    pair.of_tachometer.noise_level = 0.2;
    pair.of_fusion.sensors[1].delay_sigma = 0.005;
    std::optional<support::FusedX> between;
    if (fused) between.emplace(cell.axis, pair);
    cell.bring_up();
    const auto status = cell.run("track");
    EXPECT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
    std::cout << (fused ? "fused: " : "encoder: ") << status.text().c_str() << '\n';
    const auto table = recording::Table::read(out / "tracking.csv");
    const auto laser = table.in("laser", "m"), reference = table.in("reference", "m");
    double sum = 0.0, mean = 0.0, count = 0.0;
    for (std::size_t i = 0; i < laser.size(); ++i)
      if (std::isfinite(laser[i])) {
        mean += laser[i] - reference[i];
        sum += std::pow(laser[i] - reference[i], 2);
        count += 1.0;
      }
    rms[fused ? 1 : 0] = std::sqrt(sum / count - std::pow(mean / count, 2));
  }
  EXPECT_LT(rms[1], 0.5 * rms[0]);
}

/// Tachometers that nobody calibrated, quiet enough to be believed: the axis must neither trip nor follow much worse than the
/// encoder alone would let it (0.28 mm).
TEST(AxisTrial, NoTachometerMakesTheAxisLoseItsEncoder) {
  struct Tachometer {
    double gain, droop, latency, noise;
  };
  for (const Tachometer& of : {Tachometer{1.0, 0.6, 0.003, 0.02},
                               {0.92, 0.6, 0.0, 0.02},
                               {0.92, 0.6, 0.003, 0.1},
                               {0.8, 0.0, 0.003, 0.02},
                               {0.8, 0.8, 0.003, 0.1},
                               {1.25, 0.0, 0.0, 0.1}}) {
    SCOPED_TRACE("gain " + std::to_string(of.gain) + ", less by " + std::to_string(of.droop) +
                 " per m/s, noise " + std::to_string(of.noise));
    AxisTrial::Parameters of_trial;
    const invar::testing::TemporaryFolder folder;
    of_trial.tracking.resize(1);
    of_trial.tracking[0].name = "track";
    of_trial.tracking[0].periods = {3.0, 1.3};
    of_trial.tracking[0].out = (folder / "tracking").string();
    Cell cell{support::coarse_world(), support::coarse_stage(), of_trial};
    support::FusedTachometer pair;
    pair.of_tachometer.gain = of.gain;
    pair.of_tachometer.gain_droop = of.droop;
    pair.of_tachometer.latency = of.latency;
    pair.of_tachometer.noise_level = of.noise;
    support::FusedX fused{cell.axis, pair};
    cell.bring_up();
    const auto status = cell.run("track");
    ASSERT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
    std::cout << status.text().c_str() << '\n';
    const auto table = recording::Table::read(folder / "tracking" / "tracking.csv");
    const auto laser = table.in("laser", "m"), reference = table.in("reference", "m");
    std::vector<double> errors;
    for (std::size_t i = 0; i < laser.size(); ++i)
      if (std::isfinite(laser[i])) errors.push_back(laser[i] - reference[i]);
    EXPECT_LT(size_of(errors).rms, 0.6e-3);
  }
}

TEST(AxisTrial, SaysWhyAJobCannotRun) {
  AxisTrial::Parameters of_trial;
  of_trial.tracking.resize(1);
  of_trial.tracking[0].name = "track";
  const invar::testing::TemporaryFolder folder;
  of_trial.tracking[0].out = (folder / "fails").string();
  stage::Stage::Parameters of_stage;  // no more than 0.1 m/s
  Cell cell{support::trial_world(), of_stage, of_trial};
  cell.bring_up();
  EXPECT_STREQ(cell.run("nonsense").text().c_str(), "`nonsense` is no job of this component");
  for (const char* arguments : {"{velocities: [-1], from: .nan}", "["}) {
    EXPECT_STREQ(cell.run("track", arguments).text().c_str(),
                 "job `track` takes no arguments; leave them out, or change the cell file");
    EXPECT_EQ(cell.axis.hand.state.latest()->mode(), stage::AXIS_MODE_DISABLED);
  }
  const auto status = cell.run("track");
  EXPECT_EQ(status.phase(), job::JOB_FAILED);
  EXPECT_STREQ(status.text().c_str(), "axis x refused a motion of the job");
}

TEST(AxisTrial, AJobAfterATripSaysSoAtOnce) {
  AxisTrial::Parameters of_trial;
  of_trial.tracking.resize(1);
  of_trial.tracking[0].name = "track";
  of_trial.tracking[0].periods = {5.0};
  const invar::testing::TemporaryFolder folder;
  of_trial.tracking[0].out = (folder / "trips").string();
  stage::Stage::Parameters of_stage = support::coarse_stage();
  of_stage.following_error = 1e-7;
  Cell cell{support::trial_world(), of_stage, of_trial};
  cell.bring_up();
  EXPECT_THAT(cell.run("track").text().c_str(), ::testing::HasSubstr("tripped while moving"));
  const Instant asked = cell.trial.now();
  EXPECT_THAT(cell.run("track").text().c_str(),
              ::testing::HasSubstr("tripped before the job: mend the cause"));
  EXPECT_LT((cell.trial.now() - asked).in_seconds(), 2.0);
}

/// The job `track` with a servo and an axis that do not go together.
std::string tracked(const stage::Stage::Parameters& of_stage, double mass) {
  AxisTrial::Parameters of_trial;
  of_trial.tracking.resize(1);
  of_trial.tracking[0].name = "track";
  of_trial.tracking[0].periods = {3.0};
  const invar::testing::TemporaryFolder folder;
  of_trial.tracking[0].out = (folder / "track").string();
  auto of_world = support::trial_world();
  of_world.x.mass = mass;
  Cell cell{of_world, of_stage, of_trial};
  cell.bring_up();
  const auto status = cell.run("track");
  return (status.phase() == job::JOB_FAILED ? "failed: " : "") + std::string{status.text().c_str()};
}

TEST(AxisTrial, ALoopAtItsCurrentLimitOrThatSwingsFailsItsJobWithTheFigure) {
  stage::Stage::Parameters sound;
  sound.travel = {-0.005, 0.205};
  sound.limits = {0.65, 5.0, 100.0};
  sound.control.feedforward_velocity = 25.0 / 12.0;
  sound.control.feedforward_acceleration = 3.2 / 12.0;
  EXPECT_EQ(tracked(sound, 3.2).find("failed"), std::string::npos) << tracked(sound, 3.2);

  auto weak = sound;  // a motor that cannot follow
  weak.control.limit = 0.35;
  weak.following_error = 0.1;
  EXPECT_THAT(tracked(weak, 3.2), ::testing::HasSubstr("axis x: current at its limit of 0.35 A for"));

  auto swings = sound;  // a motor that is told to move thrice of what it moves, and gains for that
  swings.control.kp = 4e5;
  swings.control.kd = 3000;
  swings.following_error = 0.1;
  EXPECT_THAT(tracked(swings, 1.0), ::testing::AllOf(::testing::HasSubstr("failed: axis x"),
                                                     ::testing::HasSubstr("current at its limit of 10 A"),
                                                     ::testing::HasSubstr("Hz")));
}

}  // namespace
}  // namespace invar::calibration

// A model given to the fusion while it runs, and its weights learnt again beside a laser.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "components/fusion/fusion.hpp"
#include "core/compensation/fusion_file.hpp"
#include "core/metrology/fusion/weight_identification.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/wired.hpp"

namespace invar::fusion {
namespace {

using ::testing::HasSubstr;

constexpr double dt = 1e-3;

double truth(double t) { return 0.1 * (1.0 - std::cos(2.0 * std::numbers::pi * t / 4.0)); }

/// Two position sensors of a sinusoid and a laser that looks the other way.
struct Ends final : Component {
  Output<sensing::AxisReading> a{*this, "a"}, b{*this, "b"};
  Output<sensing::DisplacementReading> laser{*this, "laser", "calibration"};
  Output<compensation::ModelCommand> model{*this, "model", "command"};
  Input<compensation::ModelStatus> status{*this, "status", {.profile = "state"}};
  Input<sensing::FusedPosition> fused{*this, "fused"};
  void step(const Tick& tick) noexcept override {
    const double x = truth(tick.now.in_seconds());
    sensing::AxisReading reading;
    stamp(reading);
    reading.position(x + 1e-4 * normal(random));
    a.write(reading);
    reading.position(x + noise * normal(random));
    b.write(reading);
    if (!laser_reads) return;
    sensing::DisplacementReading displacement;
    stamp(displacement);
    displacement.beam_start() = {0.0, 0.3, 0.0};
    displacement.beam_direction() = {0.0, -1.0, 0.0};
    displacement.displacement(0.3 - x);
    displacement.valid(true);
    laser.write(displacement);
  }
  double noise = 3e-5;
  bool laser_reads = false;
  std::mt19937 random{7};
  std::normal_distribution<double> normal;
};

class GivenModel : public ::testing::Test {
 protected:
  GivenModel() {
    parameters.axis = 1;
    parameters.sensors.resize(2);
    parameters.sensors[0].name = "a";
    parameters.sensors[1].name = "b";
    parameters.sensors[0].noise = parameters.sensors[1].noise = 1e-4;
    parameters.learning.memory = 2.0;
  }
  void bring_up() {
    fusion.emplace(parameters);
    wired.join(ends, "a", *fusion, "sensor_a");
    wired.join(ends, "b", *fusion, "sensor_b");
    wired.join(ends, "laser", *fusion, "reference");
    wired.join(ends, "model", *fusion, "model");
    wired.join(*fusion, "model_status", ends, "status");
    wired.join(*fusion, "fused", ends, "fused");
    wired.add(ends);
    wired.add(*fusion);
    wired.start();
  }
  /// RMS error of the last half of so many seconds [m].
  double work(double seconds) {
    double squares = 0.0, count = 0.0;
    for (const double begun = wired.time(); wired.time() < begun + seconds;) {
      const double x = truth(wired.time());
      const double before = ends.fused.latest() != nullptr ? ends.fused.latest()->position() : x;
      wired.step();
      const double now = ends.fused.latest()->position();
      largest_step = std::max(largest_step, std::abs(now - before));
      if (wired.time() < begun + 0.5 * seconds) continue;
      squares += std::pow(now - x, 2);
      count += 1.0;
    }
    return std::sqrt(squares / count);
  }
  std::string give(const std::filesystem::path& file) {
    for (const auto kind : {compensation::MODEL_STAGE, compensation::MODEL_ACTIVATE}) {
      compensation::ModelCommand command;
      command.id(next++);
      command.kind(kind);
      command.path(file.string());
      ends.model.write(command);
      wired.step();
      wired.step();
      if (ends.status.latest()->state() == compensation::MODEL_REFUSED)
        return ends.status.latest()->text().c_str();
    }
    return {};
  }
  /// A model of the two sensors as they are at first, for these names.
  std::filesystem::path weights_of(const std::string& first, const std::string& second) {
    std::vector<metrology::FusionRun> runs;
    for (int r = 0; r < 4; ++r) {
      const Eigen::Index n = 4000;
      metrology::FusionRun run{
          Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::MatrixXd(n, 2), Eigen::MatrixXd(n, 0), {}, {}};
      for (Eigen::Index i = 0; i < n; ++i) {
        run.time(i) = dt * static_cast<double>(i);
        run.reference(i) = truth((0.8 + 0.1 * r) * run.time(i));
        run.positions(i, 0) = run.reference(i) + 1e-4 * ends.normal(ends.random);
        run.positions(i, 1) = run.reference(i) + 3e-5 * ends.normal(ends.random);
      }
      runs.push_back(run);
    }
    metrology::FusionModel sensors;
    sensors.position_names = {first, second};
    sensors.positions = {{0.0, 0.0, 0.0, 0.0, 1e-4}, {0.0, 0.0, 0.0, 0.0, 3e-5}};
    sensors.start_sigma = 1e-4;
    compensation::ModelText text{"fusion", {}};
    compensation::write_fusion(text, {"weights", false, sensors, metrology::identify_weights(runs), ""});
    const auto file = folder / (first + second + ".yaml");
    text.write(file);
    return file;
  }

  const invar::testing::TemporaryFolder folder;
  Fusion::Parameters parameters;
  support::Wired wired{dt};
  Ends ends;
  std::optional<Fusion> fusion;
  double largest_step = 0.0;
  std::uint64_t next = 1;
};

TEST_F(GivenModel, IsUsedFromThenOnAndWeighsAgainWhatAgesWhileALaserReads) {
  bring_up();
  work(1.0);
  EXPECT_EQ(give(weights_of("a", "b")), "");
  largest_step = 0.0;
  EXPECT_LT(work(2.0), 3.3e-5);  // inverse variances: 0.0287 mm
  EXPECT_LT(largest_step, 0.4e-3) << "the way of a period is 0.16 mm, noise 0.03 mm";
  EXPECT_NEAR(ends.fused.latest()->weights()[1], 0.917, 0.03);
  ends.noise = 3e-4;  // it ages: worth 0.1 now, which leaves 0.095 mm
  EXPECT_GT(work(4.0), 0.2e-3);
  ends.laser_reads = true;
  work(12.0);
  EXPECT_NEAR(ends.fused.latest()->weights()[1], 0.917 - 0.5, 0.03) << "the bound of `most`";
}

TEST_F(GivenModel, MayLearnAsFarAsItIsLet) {
  parameters.learning.most = 1.0;
  parameters.model = weights_of("a", "b");
  bring_up();
  ends.noise = 3e-4;
  ends.laser_reads = true;
  EXPECT_LT(work(24.0), 0.11e-3);
  EXPECT_NEAR(ends.fused.latest()->weights()[1], 0.1, 0.07);
}

TEST_F(GivenModel, OfOtherSensorsIsRefusedAndTheOldOneStays) {
  bring_up();
  work(1.0);
  EXPECT_THAT(give(weights_of("a", "c")), HasSubstr("is of the sensors a, c"));
  EXPECT_LT(work(1.0), 1e-4);
}

}  // namespace
}  // namespace invar::fusion

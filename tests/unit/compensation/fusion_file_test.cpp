// Fusion and trajectory models read back as they were written.
#include "core/compensation/fusion_file.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/compensation/trajectory_file.hpp"

namespace invar::compensation {
namespace {

config::Yaml parsed(const ModelText& text) {
  auto yaml = config::Yaml::parse(text.sealed(), "compensation.yaml");
  (void)yaml.root().integer("invar_compensation", 1, 1);
  (void)yaml.root().text("kind");
  (void)yaml.root().text("checksum");
  return yaml;
}

FusionFile fusion() {
  FusionFile file;
  file.sensors.position_names = {"encoder"};
  file.sensors.velocity_names = {"tacho"};
  file.sensors.positions = {{2e-3, 1.0 / 3.0e4, 1e-4, 2e-4, 2e-6, 0}};
  file.sensors.velocities.resize(1);
  file.sensors.velocities[0].gains = {0.99, -0.1, 1.0 / 7.0, 0.0};
  file.sensors.start_sigma = 1e-4;
  file.weights.positions = file.weights.velocities = 1;
  numerics::RbfNetwork network;
  network.range = {{0.0, 0.6}, {0.05, 10.0}};
  network.input_offset = network.slope = Eigen::VectorXd::Zero(2);
  network.input_scale = Eigen::Vector2d{0.2, 5.7};
  network.centres = network.widths = Eigen::MatrixXd::Constant(2, 3, 0.7);
  network.weights = Eigen::Vector3d{0.1, -1.0 / 3.0, 0.4};
  network.constant = 0.5;
  file.weights.weights = {network};
  file.weights.delays = {0.0, 1e-3 / 3.0};
  file.weights.noise = {{0.02, 0.6}, {-7.0, -20.0 / 3.0}};
  file.weights.polynomial = {2, 0.05, 0.06, 1e-3, Eigen::VectorXd::LinSpaced(6, -1e-5, 1e-5)};
  return file;
}

TEST(FusionFile, ReadsBackBitForBitWithEitherMethod) {
  for (const char* method : {"observer", "weights"}) {
    FusionFile file = fusion();
    file.method = method;
    ModelText text{"fusion", {}};
    write_fusion(text, file);
    const auto yaml = parsed(text);
    const FusionFile back = read_fusion(yaml.root());
    yaml.finish();
    EXPECT_EQ(back.sensors.position_names, file.sensors.position_names);
    const auto one = make_estimator(file);
    const auto other = make_estimator(back);
    metrology::FusionSample sample;
    for (int i = 0; i < 500; ++i) {
      const double t = 2e-3 * i;
      sample.period = i == 0 ? 0.0 : 2e-3;
      sample.positions[0] = 2e-3 * std::round(50.0 * (1.0 - std::cos(2.0 * t)));
      sample.velocities[0] = 0.2 * std::sin(2.0 * t) + 1e-3 * std::sin(1e5 * t);
      EXPECT_EQ(one->step(sample).position, other->step(sample).position);
    }
  }
}

TEST(FusionFile, KeepsTheFurtherSelectorOfTheWeights) {
  FusionFile file = fusion();
  file.method = "weights";
  file.selector = "load";
  auto& network = file.weights.weights.front();
  network.range.push_back({0.0, 5.0});
  network.input_offset = network.slope = Eigen::VectorXd::Zero(3);
  network.input_scale = Eigen::Vector3d{0.2, 5.7, 2.5};
  network.centres = network.widths = Eigen::MatrixXd::Constant(3, 3, 0.7);
  ModelText text{"fusion", {}};
  write_fusion(text, file);
  const auto yaml = parsed(text);
  const FusionFile back = read_fusion(yaml.root());
  yaml.finish();
  EXPECT_EQ(back.selector, "load");
  const Eigen::Vector3d at{0.3, 0.2, 4.0};
  EXPECT_EQ(metrology::weights_at(back.weights, at), metrology::weights_at(file.weights, at));
}

TEST(FusionFile, RefusesAMethodThatIsNone) {
  FusionFile file = fusion();
  file.method = "guess";
  ModelText text{"fusion", {}};
  write_fusion(text, file);
  const auto yaml = parsed(text);
  (void)read_fusion(yaml.root());
  EXPECT_THROW(yaml.finish(), InputError);
}

TEST(TrajectoryFile, ReadsBackBitForBit) {
  metrology::DropletTrajectory path;
  path.placement << 2e-6, 118.2e-6 / 3.0;
  path.slope << 5.3e-3, 9e-5;
  path.covariance << 1e-12, -1e-11, -1e-11, 1e-8;
  path.slowness = 0.5;
  path.slowness_sigma = 0.01;
  ModelText text{"dispenser", {}};
  write_trajectory(text, path);
  const auto yaml = parsed(text);
  const auto back = read_trajectory(yaml.root());
  yaml.finish();
  EXPECT_EQ(back.offset(3e-3, {0.07, 0.01}), path.offset(3e-3, {0.07, 0.01}));
  EXPECT_EQ(back.sigma(7e-3), path.sigma(7e-3));
  EXPECT_EQ(back.slowness_sigma, path.slowness_sigma);
}

}  // namespace
}  // namespace invar::compensation

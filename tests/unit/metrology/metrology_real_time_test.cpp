// What the loop calls of core/metrology neither allocates nor locks.
#include <gmock/gmock.h>

#include <cmath>

#include "core/metrology/fusion/fusion_observer.hpp"
#include "core/metrology/fusion/weighted_fusion.hpp"
#include "core/metrology/thermal/thermal_error.hpp"
#include "tests/support/real_time_guard.hpp"

namespace invar::metrology {
namespace {

FusionModel two_sensors() {
  FusionModel model;
  model.position_names = {"encoder"};
  model.velocity_names = {"speed"};
  model.positions = {{2e-3, 0.0, 1e-4, 2e-4, 2e-6, 0}};
  model.velocities.resize(1);
  model.start_sigma = 1e-4;
  return model;
}

WeightModel two_weights() {
  WeightModel model;
  model.positions = model.velocities = 1;
  numerics::RbfNetwork half;
  half.range = {{0.0, 0.6}, {0.05, 10.0}};
  half.input_offset = half.slope = Eigen::VectorXd::Zero(2);
  half.input_scale = Eigen::VectorXd::Ones(2);
  half.centres = half.widths = Eigen::MatrixXd::Ones(2, 1);
  half.weights = Eigen::VectorXd::Constant(1, 0.1);
  half.constant = 0.5;
  model.weights = {half};
  return model;
}

/// Sound readings, then a dead velocity, then none, then a stuck encoder: every branch of the estimators.
void run_through_faults(FusionEstimator& estimator) {
  FusionSample sample;
  sample.noise_level = 0.1;
  for (int i = 0; i < 4000; ++i) {
    const double t = 1e-3 * i;
    sample.period = i == 0 ? 0.0 : 1e-3;
    sample.positions[0] = i < 3000 ? 2e-3 * std::round(50.0 * (1.0 - std::cos(2.0 * t))) : 0.1;
    sample.velocities[0] = 0.2 * std::sin(2.0 * t) + 1e-3 * std::sin(1e5 * t);
    if (i > 1000 && i < 1500) sample.velocities[0] = 0.0;
    if (i >= 1500 && i < 2000) sample.velocities[0] = std::nan("");
    (void)estimator.step(sample);
  }
}

TEST(FusionEstimators, NeitherAllocateNorLockWhateverFails) {
  FusionObserver observer{two_sensors()};
  WeightedFusion weighted{two_weights()};
  const support::RealTimeGuard guard;
  run_through_faults(observer);
  run_through_faults(weighted);
  observer.reset();
  weighted.reset();
  EXPECT_EQ(guard.violations(), 0U);
}

TEST(CompiledThermalError, NeitherAllocatesNorLocks) {
  ThermalError model;
  model.x = {0.0, 0.2};
  model.temperature = {27.0, 30.0};
  model.heating_rate = {0.0, 0.0};
  model.terms.push_back({ThermalFactor::temperature, -0.02, 0.02, Eigen::MatrixXd::Constant(13, 1, 1e-6)});
  model.sigma_table = {{numerics::GridAxis{model.x, 1}, numerics::GridAxis{model.temperature, 1},
                        numerics::GridAxis{model.heating_rate, 1}},
                       std::vector<double>{1e-7}};
  CompiledThermalError compiled{model, 1e-9};
  double sum = 0.0;
  const support::RealTimeGuard guard;
  for (int i = 0; i < 100; ++i) {
    compiled.set(27.0 + 0.03 * i, 0.0);
    sum += compiled.value(0.002 * i) + compiled.sigma(0.002 * i);
  }
  EXPECT_EQ(guard.violations(), 0U);
  EXPECT_GT(sum, 0.0);
}

}  // namespace
}  // namespace invar::metrology

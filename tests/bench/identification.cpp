// Timing of networks, their tables, the fusion step and the thermal correction; each beside its plain rival.
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>

#include "core/metrology/fusion/fusion_observer.hpp"
#include "core/metrology/thermal/thermal_error.hpp"
#include "core/numerics/lookup_table.hpp"
#include "core/numerics/rbf_ridge.hpp"

namespace {

using invar::numerics::RbfNetwork;

Eigen::MatrixXd positions() { return Eigen::VectorXd::LinSpaced(41, 0.0, 0.2).transpose(); }

Eigen::VectorXd errors(unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  Eigen::VectorXd y(41);
  for (Eigen::Index i = 0; i < 41; ++i)
    y(i) = 2e-6 * std::sin(20.0 * positions()(0, i) + seed) + 0.46e-6 * normal(random);
  return y;
}

void eighteen_networks_of_41_samples(benchmark::State& state) {
  for (auto _ : state)
    for (unsigned k = 0; k < 18; ++k)
      benchmark::DoNotOptimize(invar::numerics::fit_ridge(positions(), errors(k)).ridge);
}
BENCHMARK(eighteen_networks_of_41_samples)->Unit(benchmark::kMillisecond);

void gaussian_sum_at_a_point(benchmark::State& state) {
  const RbfNetwork network = invar::numerics::fit_ridge(positions(), errors(1)).network;
  double x = 0.0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(network(x));
    x = x < 0.19 ? x + 1e-4 : 0.0;
  }
}
BENCHMARK(gaussian_sum_at_a_point);

void compiled_table_at_a_point(benchmark::State& state) {
  const auto compiled =
      invar::numerics::compile<1>(invar::numerics::fit_ridge(positions(), errors(1)).network, 5e-9);
  double x = 0.0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(compiled.table({x}));
    x = x < 0.19 ? x + 1e-4 : 0.0;
  }
  state.counters["bytes"] = static_cast<double>(compiled.table.size() * sizeof(double));
  state.counters["bound_nm"] = 1e9 * compiled.bound;
}
BENCHMARK(compiled_table_at_a_point);

void fusion_step_of_encoder_and_velocity(benchmark::State& state) {
  invar::metrology::FusionModel model;
  model.position_names = {"encoder"};
  model.velocity_names = {"speed"};
  model.positions = {{2e-3, 0.0, 0.0, 0.0, 2e-6, 0}};
  model.velocities.resize(1);
  model.start_sigma = 1e-4;
  invar::metrology::FusionObserver observer{model};
  invar::metrology::FusionSample sample;
  std::mt19937 random{1};
  std::normal_distribution<double> normal;
  std::vector<double> noise(4096);
  for (double& value : noise) value = 0.02 * normal(random);
  std::size_t i = 0;
  for (auto _ : state) {
    const double t = 1e-3 * static_cast<double>(i);
    sample.period = i == 0 ? 0.0 : 1e-3;
    sample.positions[0] = 2e-3 * std::round(50.0 * (1.0 - std::cos(2.0 * t)));
    sample.velocities[0] = 0.2 * std::sin(2.0 * t) + noise[i % noise.size()];
    benchmark::DoNotOptimize(observer.step(sample).position);
    ++i;
  }
}
BENCHMARK(fusion_step_of_encoder_and_velocity);

}  // namespace

BENCHMARK_MAIN();

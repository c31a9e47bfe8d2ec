// Speed of the correction at a point against a plain Gaussian sum and a 3-D table, and of a whole identification.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <vector>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "core/metrology/geometric/volumetric_table.hpp"
#include "core/numerics/lookup_table.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::metrology {
namespace {

struct Setup {
  Machine machine;
  std::vector<DisplacementLine> lines;
  GeometricModel model;
  std::vector<Eigen::Vector3d> places;
};

const Setup& setup() {
  static const Setup made = [] {
    Setup s;
    std::mt19937_64 random{1};
    s.machine = testing::random_machine({{1, 0, 2}, 3}, {0.2, 0.2, 0.2}, random);
    auto plan = recipe_lines(s.machine, 1);
    plan.resize(15);
    for (const auto& one : plan)
      s.lines.push_back(testing::measure(s.machine, one.name, one.from, one.to, 41, one.tool, random));
    s.model = identify(s.machine, s.lines).model;
    std::uniform_real_distribution<double> at{0.0, 0.2};
    for (int i = 0; i < 4096; ++i) s.places.emplace_back(at(random), at(random), at(random));
    return s;
  }();
  return made;
}

/// Times single calls too, for the percentiles.
template <class F>
void at_points(benchmark::State& state, F correction) {
  const auto& places = setup().places;
  std::size_t i = 0;
  for (auto _ : state) {
    Eigen::Vector3d e = correction(places[i++ & 4095U]);
    benchmark::DoNotOptimize(e);
  }
  std::vector<double> each;
  for (int k = 0; k < 20000; ++k) {
    const auto start = std::chrono::steady_clock::now();
    Eigen::Vector3d e = correction(places[i++ & 4095U]);
    benchmark::DoNotOptimize(e);
    each.push_back(
        std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(each.begin(), each.end());
  state.counters["p50_ns_with_clock"] = each[each.size() / 2];
  state.counters["p99.9_ns_with_clock"] = each[each.size() * 999 / 1000];
}

void table_of_components(benchmark::State& state) {
  const VolumetricTable table{setup().model, 3e-8};
  at_points(state, [&](const Eigen::Vector3d& p) { return table.error(p); });
  state.counters["bytes"] = static_cast<double>(8 * table.size());
  state.counters["bound_nm"] = 1e9 * table.bound();
}
BENCHMARK(table_of_components);

/// The same field as 18 Gaussian sums of 41 centres, evaluated as printed in the thesis.
void gaussian_sums(benchmark::State& state) {
  const auto& model = setup().model;
  std::vector<double> weights(18 * 41, 1e-7);
  const auto directions = axis_directions(model.chain, model.squareness);
  at_points(state, [&](const Eigen::Vector3d& p) {
    ErrorMotions motions;
    for (int c = 0; c < error_motion_count; ++c) {
      double sum = 0.0;
      const double q = p[axis_of(c)];
      for (int k = 0; k < 41; ++k) {
        const double z = (q - 0.005 * k) / 0.01;
        sum += weights[static_cast<std::size_t>(41 * c + k)] * std::exp(-0.5 * z * z);
      }
      auto& motion = motions[static_cast<std::size_t>(axis_of(c))];
      (is_rotation(c) ? motion.rotation : motion.translation)[direction_of(c)] = sum;
    }
    return linear_error(model.chain, directions, p, motions, model.tool);
  });
  state.counters["bytes"] = static_cast<double>(8 * 2 * weights.size());
}
BENCHMARK(gaussian_sums);

/// Three tables over the volume with nodes as close as the component tables'.
void volume_table(benchmark::State& state) {
  const auto& model = setup().model;
  const auto nodes = static_cast<std::size_t>(state.range(0));
  const numerics::GridAxis axis{{0.0, 0.2}, nodes};
  std::vector<numerics::LookupTable<3>> tables;
  for (int k = 0; k < 3; ++k)
    tables.emplace_back(std::array<numerics::GridAxis, 3>{axis, axis, axis},
                        [&](const std::array<double, 3>& x) {
                          return model.error({x[0], x[1], x[2]}, model.tool)[k];
                        });
  double worst = 0.0;
  for (const auto& p : setup().places)
    worst = std::max(worst, std::abs(tables[0]({p[0], p[1], p[2]}) - model.error(p, model.tool)[0]));
  at_points(state, [&](const Eigen::Vector3d& p) {
    const std::array<double, 3> x{p[0], p[1], p[2]};
    return Eigen::Vector3d{tables[0](x), tables[1](x), tables[2](x)};
  });
  state.counters["bytes"] = static_cast<double>(3 * 8 * tables[0].size());
  state.counters["worst_nm"] = 1e9 * worst;
}
BENCHMARK(volume_table)->Arg(41)->Arg(101);

void identify_fifteen_lines(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(identify(setup().machine, setup().lines).misfit);
}
BENCHMARK(identify_fifteen_lines)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace invar::metrology

BENCHMARK_MAIN();

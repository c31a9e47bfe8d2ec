// Monte Carlo of the identification on random machines (docs/explanation/geometric.md#simulated-machines): error left
// in the volume by line set.
//
//     build/bin/bench_geometric_monte_carlo [machines] [rows that contain this text] [whole]
//
// `whole`: curves of the first four whole waves of the travel, with the slopes that they have.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/identifiability.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "core/metrology/geometric/line_search.hpp"
#include "tests/unit/metrology/geometric/left_over.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::metrology {
namespace {

using testing::Left;
using testing::left_over;

struct Ends {
  Eigen::Vector3d from, to;  // in travels
};

const std::vector<Ends> xy4{
    {{0, 0, 0}, {1, 0, 0}}, {{0, 0, 0}, {0, 1, 0}}, {{1, 0, 0}, {1, 1, 0}}, {{0, 0, 0}, {1, 1, 0}}};
const Ends anti{{0, 1, 0}, {1, 0, 0}};
const Ends half{{0, 0, 0}, {1, .5, 0}};
const Ends steep{{0, 0, 0}, {.5, 1, 0}};

const std::vector<Ends> seed15{{{0, 0, 0}, {1, 0, 0}},   {{0, 0, 0}, {0, 1, 0}}, {{0, 0, 0}, {0, 0, 1}},
                               {{0, 1, 0}, {1, 1, 0}},   {{0, 0, 1}, {1, 0, 1}}, {{1, 0, 0}, {1, 1, 0}},
                               {{0, 0, 1}, {0, 1, 1}},   {{1, 0, 0}, {1, 0, 1}}, {{0, 1, 0}, {0, 1, 1}},
                               {{0, 0, 0}, {1, 1, 0}},   {{0, 0, 0}, {1, 0, 1}}, {{0, 0, 0}, {0, 1, 1}},
                               {{0, 0, .5}, {1, 1, .5}}, {{0, 0, 1}, {1, 1, 1}}, {{0, 1, 0}, {1, 1, 1}}};
/// Recipe of 3.5 for the chain y, x, z: a = y, b = x, c = z.
const std::vector<Ends> recipe14{{{0, 0, 0}, {0, 1, 0}},  {{0, 0, 0}, {1, 0, 0}},  {{0, 0, 0}, {0, 0, 1}},
                                 {{1, 0, 0}, {1, 1, 0}},  {{0, 0, 1}, {0, 1, 1}},  {{0, 0, 1}, {1, 0, 1}},
                                 {{0, 0, 0}, {1, 1, 0}},  {{0, 0, 0}, {.5, 1, 0}}, {{0, 0, 0}, {0, 1, 1}},
                                 {{0, 0, 0}, {0, 1, .5}}, {{0, 0, 0}, {1, 0, 1}},  {{0, 0, 0}, {1, 0, .5}},
                                 {{1, 0, 0}, {1, 1, 1}},  {{0, 0, 1}, {1, 1, 1}}};
const std::vector<Ends> antis{{{0, 1, 0}, {1, 0, 0}}, {{0, 1, 0}, {0, 0, 1}}, {{1, 0, 0}, {0, 0, 1}}};
const std::vector<Ends> steeps{{{0, 0, 0}, {1, .5, 0}}, {{0, 0, 0}, {0, .5, 1}}, {{0, 0, 0}, {.5, 0, 1}}};

std::vector<Ends> operator+(std::vector<Ends> a, const std::vector<Ends>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::vector<Ends> parallels_and_faces() {
  std::vector<Ends> lines{seed15.begin(), seed15.begin() + 12};
  return lines + antis;
}

std::vector<Ends> edges_faces_bodies() {
  std::vector<Ends> lines;
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 0; i < 4; ++i) {
      Eigen::Vector3d from = Eigen::Vector3d::Zero();
      from[(axis + 1) % 3] = i % 2;
      from[(axis + 2) % 3] = i / 2;
      lines.push_back({from, from + Eigen::Vector3d::Unit(axis)});
    }
  lines = lines + std::vector<Ends>{{{0, 0, 0}, {1, 1, 0}}, {{0, 0, 0}, {1, 0, 1}}, {{0, 0, 0}, {0, 1, 1}}} +
          antis;
  return lines +
         std::vector<Ends>{
             {{0, 0, 0}, {1, 1, 1}}, {{1, 0, 0}, {0, 1, 1}}, {{0, 1, 0}, {1, 0, 1}}, {{0, 0, 1}, {1, 1, 0}}};
}

double quantile(std::vector<double> values, double part) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1) + 0.5)];
}

/// Between what the median of 60 drawn of these machines lies nine times of ten: what a study of 60 machines scatters by.
std::array<double, 2> median_of_sixty(const std::vector<double>& values) {
  std::mt19937_64 random{1};
  std::uniform_int_distribution<std::size_t> any{0, values.size() - 1};
  std::vector<double> medians;
  for (int draw = 0; draw < 2000; ++draw) {
    std::vector<double> drawn;
    for (int i = 0; i < 60; ++i) drawn.push_back(values[any(random)]);
    medians.push_back(quantile(std::move(drawn), 0.5));
  }
  return {quantile(medians, 0.05), quantile(medians, 0.95)};
}

testing::MachineSpread spread;

void row(const std::string& name, const Chain& chain, const std::vector<Ends>& ends,
         IdentificationMethod method, int machines, int points = 41) {
  std::vector<double> before, after, inside, predicted, seconds;
  const int count = chain.axes == 2 ? 21 : 7;
  for (int m = 0; m < machines; ++m) {
    std::mt19937_64 random{static_cast<unsigned>(1000 + m)};
    const Machine machine = testing::random_machine(chain, {0.2, 0.2, 0.2}, random, spread);
    std::vector<DisplacementLine> lines;
    for (std::size_t l = 0; l < ends.size(); ++l)
      lines.push_back(testing::measure(machine, "L" + std::to_string(l), 0.2 * ends[l].from, 0.2 * ends[l].to,
                                       points, Eigen::Vector3d::Zero(), random));
    IdentificationOptions options;
    options.method = method;
    const std::clock_t start = std::clock();
    const Identification found = identify(machine, lines, options);
    seconds.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    before.push_back(left_over(machine, nullptr, count).rms);
    const Left left = left_over(machine, &found.model, count);
    after.push_back(left.rms);
    inside.push_back(left.inside);
    predicted.push_back(
        identifiability(found.basis, found.posterior, found.model.squareness, machine.travel, machine.tool)
            .volumetric_rms);
    if (std::getenv("VERBOSE") != nullptr)
      std::printf(
          "   %5.2f -> %5.2f (predicted %5.2f) in %.2f  amplitude %.2f %.2f %.2f  length %.3f %.3f %.3f "
          "misfit %.3f\n",
          1e6 * before.back(), 1e6 * left.rms, 1e6 * predicted.back(), left.inside,
          1e6 * found.prior.amplitude[0], 1e6 * found.prior.amplitude[1], 1e6 * found.prior.amplitude[2],
          found.prior.length[0], found.prior.length[1], found.prior.length[2], 1e6 * found.misfit);
  }
  double mean_inside = 0.0;
  for (const double i : inside) mean_inside += i / static_cast<double>(inside.size());
  const auto [low, high] = median_of_sixty(after);
  std::printf("%-42s %6.2f %7.2f %6.2f .. %5.2f %7.2f %10.2f %9.3f %8.3f\n", name.c_str(),
              1e6 * quantile(before, 0.5), 1e6 * quantile(after, 0.5), 1e6 * low, 1e6 * high,
              1e6 * quantile(after, 0.9), 1e6 * quantile(predicted, 0.5), mean_inside,
              quantile(seconds, 0.5));
  std::fflush(stdout);
}

}  // namespace
}  // namespace invar::metrology

int main(int argc, char** argv) {
  using namespace invar::metrology;
  const int machines = argc > 1 ? std::atoi(argv[1]) : 60;
  const std::string only = argc > 2 ? argv[2] : "";
  if (argc > 3 && std::string{argv[3]} == "whole") spread.family = {4, 1.5, 1.0, false};
  const Chain xy{{1, 0, 2}, 2};
  const Chain xyz{{1, 0, 2}, 3};
  std::printf("%d machines, 200 mm, six passes of 1 um white and 0.5 um repeatability; um, seeds 1000..\n",
              machines);
  std::printf("%-42s %6s %7s %15s %7s %10s %9s %8s\n", "line set", "before", "median", "of 60, 5-95 %", "p90",
              "predicted", "2 sigma", "CPU s");
  const auto full = IdentificationMethod::full;
  const auto seed = IdentificationMethod::displacement;
  const auto run = [&](const std::string& name, const Chain& chain, const std::vector<Ends>& ends,
                       IdentificationMethod method, int points = 41) {
    if (name.find(only) != std::string::npos) row(name, chain, ends, method, machines, points);
  };
  run("XY thesis, errata applied, 4", xy, xy4, seed);
  run("XY full, same 4 lines", xy, xy4, full);
  run("XY full, 5 (+ anti-diagonal)", xy, xy4 + std::vector<Ends>{anti}, full);
  run("XY full, 5 (+ y = x/2)", xy, xy4 + std::vector<Ends>{half}, full);
  run("XY full, 6 (+ both)", xy, xy4 + std::vector<Ends>{anti, half}, full);
  run("XY full, 7 (+ y = 2x)", xy, xy4 + std::vector<Ends>{anti, half, steep}, full);
  run("XYZ thesis, errata applied, 15", xyz, seed15, seed);
  run("XYZ full, same 15 lines", xyz, seed15, full);
  run("XYZ full, 9 parallels + 6 face (15)", xyz, parallels_and_faces(), full);
  run("XYZ full, 22 (edges, face, body)", xyz, edges_faces_bodies(), full);
  run("XYZ full, recipe 14", xyz, recipe14, full);
  run("XYZ full, recipe + 3 anti-diagonals (17)", xyz, recipe14 + antis, full);
  run("XYZ full, + 3 steep diagonals (20)", xyz, recipe14 + antis + steeps, full);
  // Lines that the planner searched knowing no machine: its expectation beside what happens on sixty of them.
  for (const int level : {0, 1, 2}) {
    for (const Chain& chain : {xy, xyz}) {
      const std::string name = chain.axes == 2 ? "XY searched " : "XYZ searched ";
      if ((name + "999").find(only) == std::string::npos && only.find("searched") == std::string::npos)
        continue;
      Machine any;
      any.chain = chain;
      for (int k = 0; k < chain.axes; ++k) any.travel[static_cast<std::size_t>(k)] = {0.0, 0.2};
      const GeometricPrior prior = assumed_prior(any, 2e-6, 8e-6);
      const Effort effort{0.005, 6, std::hypot(1e-6, 0.5e-6)};
      const std::clock_t started = std::clock();
      const auto lines = search_lines(any, recipe_lines(any, level), effort, prior);
      const double took = static_cast<double>(std::clock() - started) / CLOCKS_PER_SEC;
      std::printf("searched in %.1f s: expects %.2f um, the recipe's %zu lines %.2f um\n", took,
                  1e6 * expect(any, lines, effort, prior).knowledge.volumetric_rms, lines.size(),
                  1e6 * expect(any, recipe_lines(any, level), effort, prior).knowledge.volumetric_rms);
      std::vector<Ends> ends;
      for (const auto& line : lines) ends.push_back({line.from / 0.2, line.to / 0.2});
      run(name + std::to_string(lines.size()), chain, ends, full);
    }
  }
  for (const int points : {21, 11, 9, 6, 5}) {
    run("interval XY 6 lines, " + std::to_string(200 / (points - 1)) + " mm", xy,
        xy4 + std::vector<Ends>{anti, half}, full, points);
    run("interval XYZ 17 lines, " + std::to_string(200 / (points - 1)) + " mm", xyz, recipe14 + antis, full,
        points);
  }
}

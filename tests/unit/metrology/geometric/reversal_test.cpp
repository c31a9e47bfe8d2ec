// Lost motion that varies along the axes: found over position, and never taken for noise. Truth: simulated machines.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <utility>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "tests/unit/metrology/geometric/left_over.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::metrology {
namespace {

using testing::Laser;
using testing::measure;
using testing::random_machine;

const Chain xy{{1, 0, 2}, 2};

Machine machine_with_reversal(double slope, std::mt19937_64& random) {
  Machine machine = random_machine(xy, {0.2, 0.2, 0.0}, random);
  machine.errors->reversal[0] = ErrorFunction{{3e-6, slope}, {}};  // m, m/m
  machine.errors->reversal[1] = ErrorFunction{{2e-6}, {{0.05 * slope, 0.15, 0.4}}};
  return machine;
}

Identification found_on(const Machine& machine, const Laser& laser, std::mt19937_64& random) {
  std::vector<DisplacementLine> lines;
  for (const auto& one : recipe_lines(machine, 1))
    lines.push_back(measure(machine, one.name, one.from, one.to, 21, one.tool, random, laser));
  return identify(machine, lines);
}

TEST(Reversal, ThatVariesIsNoNoise) {
  std::mt19937_64 random{41};
  RecordProperty("seed", 41);
  Laser laser;
  laser.noise = 0.3e-6;
  laser.repeatability = 0.0;
  for (const double slope : {0.0, 5e-5, 2e-4}) {  // up to 40 um over the travel
    const Machine machine = machine_with_reversal(slope, random);
    const auto found = found_on(machine, laser, random);
    EXPECT_NEAR(found.noise, 0.3e-6, 0.03e-6) << slope;
    EXPECT_LT(testing::left_over(machine, &found.model, 9).rms, 0.8e-6) << slope;
    for (int k = 0; k < 2; ++k)
      for (const double q : {0.0, 0.03, 0.1, 0.16, 0.2}) {
        const auto axis = static_cast<std::size_t>(k);
        EXPECT_NEAR(found.model.reversal[axis].value(q), machine.errors->reversal[axis](q), 0.5e-6)
            << slope << " m/m, axis " << k << " at " << q;
      }
  }
}

// A test of few targets or of one cycle has few readings beyond its unknowns: they are no outliers for that.
TEST(Reversal, ThatVariesIsNoNoiseOfAShortTest) {
  std::mt19937_64 random{45};
  RecordProperty("seed", 45);
  std::normal_distribution<double> normal;
  Machine machine;
  machine.chain = {{0, 1, 2}, 1};
  machine.travel[0] = {0.0, 0.2};
  const auto reversal = [](double u) { return 4e-6 + 2e-6 * std::cos(5.0 * u); };
  const auto error = [](double u) { return 8e-6 * u + 3e-6 * std::sin(6.0 * u); };
  for (const auto& [targets, cycles] : {std::pair{5, 2}, {7, 2}, {9, 2}, {5, 3}, {21, 1}, {41, 1}, {41, 3}}) {
    DisplacementLine line{"X", {}};
    for (int go = 0; go < 2 * cycles; ++go)
      for (int i = 0; i < targets; ++i) {
        const int way = go % 2 == 0 ? 1 : -1;
        const double u = static_cast<double>(way > 0 ? i : targets - 1 - i) / (targets - 1);
        Reading reading;
        reading.position = {0.2 * u, 0.0, 0.0};
        reading.direction = way;
        reading.displacement = 0.2 * u + error(u) + 0.5 * way * reversal(u) + 1e-7 * normal(random);
        line.readings.push_back(reading);
      }
    const auto found = identify(machine, {line});
    const std::string what = std::to_string(targets) + " targets, " + std::to_string(cycles) + " cycles";
    EXPECT_EQ(found.lines[0].noise.outliers, 0) << what;
    EXPECT_LT(found.noise, 0.3e-6) << what;
    for (const double u : {0.0, 0.25, 0.5, 0.75, 1.0}) {  // targets of all but the shortest
      EXPECT_NEAR(found.model.reversal[0].value(0.2 * u), reversal(u), 0.5e-6) << what << " at " << u;
      EXPECT_NEAR(found.model.error_motion(0, 0.2 * u) - found.model.error_motion(0, 0.0),
                  error(u) - error(0.0), 0.6e-6)
          << what << " at " << u;
    }
  }
}

// Four readings of each place and three micrometres of noise: the sigma must say how little is known.
TEST(Reversal, ItsSigmaMeansWhatItSays) {
  std::mt19937_64 random{42};
  RecordProperty("seed", 42);
  Laser laser;
  laser.noise = 3e-6;
  laser.passes = 4;
  int inside = 0;
  int all = 0;
  for (int m = 0; m < 10; ++m) {
    const Machine machine = machine_with_reversal(1e-5 * m, random);
    const auto found = found_on(machine, laser, random);
    for (std::size_t k = 0; k < 2; ++k)
      for (int i = 0; i <= 10; ++i) {
        const double q = 0.02 * i;
        const double off = found.model.reversal[k].value(q) - machine.errors->reversal[k](q);
        inside += std::abs(off) <= 2.0 * found.model.reversal[k].sigma_at(q) ? 1 : 0;
        ++all;
      }
  }
  EXPECT_GT(inside, 0.85 * all);
}

TEST(Reversal, LinesReadOneWayTellNone) {
  std::mt19937_64 random{43};
  RecordProperty("seed", 43);
  Laser laser;
  laser.passes = 1;
  const auto found = found_on(machine_with_reversal(1e-4, random), laser, random);
  for (const auto& curve : found.model.reversal) EXPECT_TRUE(curve.empty());
  EXPECT_TRUE(std::isinf(found.model.reversal[0].sigma_at(0.1)));
  EXPECT_EQ(found.model.reversal_at({0.1, 0.1, 0.0}, {1, 1, 0}), Eigen::Vector3d::Zero());
}

}  // namespace
}  // namespace invar::metrology

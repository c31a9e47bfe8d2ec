// Periodic errors of screws whose pitch nobody told. Truth: simulated machines; and curves that have none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "tests/unit/metrology/geometric/left_over.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::metrology {
namespace {

using testing::Laser;
using testing::random_machine;

const Chain xy{{1, 0, 2}, 2};

ErrorFunction wave(double amplitude, double period, double phase) {
  return ErrorFunction{{}, {{amplitude, period, phase}}};
}

/// Two harmonics beside the curve that is there: `measure` adds nothing to a machine, so its reading is completed here.
std::vector<DisplacementLine> read_lines(const Machine& machine, const std::array<ErrorFunction, 2>& screws,
                                         std::mt19937_64& random) {
  Laser laser;
  laser.noise = 0.5e-6;
  laser.repeatability = 0.0;
  std::vector<DisplacementLine> lines;
  for (const auto& one : recipe_lines(machine, 2)) {
    lines.push_back(testing::measure(machine, one.name, one.from, one.to, points_of(one, 0.004), one.tool,
                                     random, laser));
    const Eigen::Vector3d beam = (one.to - one.from).normalized();
    const auto along = [&](const Eigen::Vector3d& at) {
      return beam.x() * screws[0](at.x()) + beam.y() * screws[1](at.y());
    };
    for (Reading& reading : lines.back().readings)
      reading.displacement += along(reading.position) - along(one.from);
  }
  return lines;
}

TEST(Waves, OfTwoScrewsAreFoundBesideABeamBreak) {
  std::mt19937_64 random{51};
  RecordProperty("seed", 51);
  testing::MachineSpread spread;
  spread.pitch = 0.0;
  const Machine machine = random_machine(xy, {0.2, 0.2, 0.0}, random, spread);
  const std::array<ErrorFunction, 2> screws{wave(1.5e-6, 0.0127, 0.3), wave(0.8e-6, 0.01, 2.0)};
  auto lines = read_lines(machine, screws, random);
  for (std::size_t i = 100; i < lines[2].readings.size(); ++i) lines[2].readings[i].displacement += 9e-6;
  const auto found = identify(machine, lines);
  ASSERT_EQ(found.basis.waves.size(), 2U);
  for (const AxisWave& one : found.basis.waves) {
    EXPECT_NEAR(one.period(), one.axis == 0 ? 0.0127 : 0.01, 3e-5);
    EXPECT_NEAR(std::hypot(one.cosine, one.sine), one.axis == 0 ? 1.5e-6 : 0.8e-6, 0.15e-6);
  }
  EXPECT_EQ(found.lines[2].noise.breaks.size(), 1U);
  // The model carries them: its error is that of machine and screws, the mean over each axis aside.
  double square = 0.0;
  double mean = 0.0;
  constexpr int places = 401;
  std::vector<double> off;
  for (int i = 0; i < places; ++i) {
    const double q = 0.2 * i / (places - 1);
    const double truth =
        machine.errors->functions[static_cast<std::size_t>(translation(0, 0))](q) + screws[0](q);
    off.push_back(found.model.error_motion(translation(0, 0), q) - truth);
    mean += off.back() / places;
  }
  for (const double each : off) square += (each - mean) * (each - mean) / places;
  EXPECT_LT(std::sqrt(square), 0.25e-6);
}

TEST(Waves, AreNotFoundWhereThereAreNone) {
  std::mt19937_64 random{52};
  RecordProperty("seed", 52);
  testing::MachineSpread spread;
  spread.pitch = 0.0;
  std::size_t found = 0;
  for (int m = 0; m < 6; ++m) {
    const Machine machine = random_machine(xy, {0.2, 0.2, 0.0}, random, spread);
    found += identify(machine, read_lines(machine, {}, random)).basis.waves.size();
  }
  EXPECT_EQ(found, 0U);
}

TEST(Waves, AFinerSplineIsTheSameCurve) {
  const numerics::CubicBSpline spline{{-0.1, 0.3}, 9};
  Eigen::VectorXd coefficients = Eigen::VectorXd::Random(spline.size());
  const Eigen::VectorXd finer = spline.halved(coefficients);
  for (double q = -0.12; q < 0.32; q += 0.007)
    EXPECT_NEAR(spline.halved().value(finer, q), spline.value(coefficients, q), 1e-14);
}

}  // namespace
}  // namespace invar::metrology

// A rotary axis: identified from readings of a known error, as a file, around the turn, in both directions.
#include "core/compensation/rotary_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <random>
#include <sstream>

#include "core/base/fault.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::compensation {
namespace {

constexpr double turn = 2.0 * std::numbers::pi;
constexpr double arcsec = turn / 360.0 / 3600.0;

/// An eccentric scale with a second harmonic: closed form, rad.
double error(double angle) { return arcsec * (3.0 * std::sin(angle) + 1.2 * std::sin(2.0 * angle + 0.4)); }
double reversal(double angle) { return arcsec * (4.0 + std::cos(angle)); }

metrology::ErrorMotionReadings readings(double step, double end, double noise, bool both, unsigned seed = 4) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  std::vector<double> position, value;
  metrology::ErrorMotionReadings result;
  for (int cycle = 0; cycle < 2; ++cycle)
    for (const int way : {1, -1}) {
      if (way < 0 && !both) continue;
      for (double at = 0.0; at <= end + 1e-9; at += step) {
        position.push_back(at);
        value.push_back(error(at) + 0.5 * way * reversal(at) * (both ? 1.0 : 0.0) + noise * normal(random));
        result.direction.push_back(way);
      }
    }
  if (!both) result.direction.clear();
  result.position = Eigen::Map<Eigen::VectorXd>(position.data(), static_cast<long>(position.size()));
  result.value = Eigen::Map<Eigen::VectorXd>(value.data(), static_cast<long>(value.size()));
  result.state.resize(0, result.position.size());
  return result;
}

TEST(RotaryAxis, IsItsClosedFormInBothDirectionsAndAroundTheTurn) {
  const auto found =
      metrology::identify_rotary('c', readings(turn / 24, turn, 0.05 * arcsec, true), {0.0, turn});
  EXPECT_TRUE(found.axis.comes_round);
  double square = 0.0, told = 0.0;
  int count = 0;
  for (double at = -turn; at < 2.0 * turn; at += 0.13)
    for (const double way : {1.0, 0.0, -1.0}) {
      const double off = found.axis.value(at, way) - error(at) - 0.5 * way * reversal(at);
      EXPECT_LT(std::abs(off), 0.25 * arcsec) << at << ' ' << way;
      square += off * off;
      told += std::pow(found.axis.sigma(at, way), 2);
      ++count;
    }
  EXPECT_LT(std::sqrt(square / count), 0.08 * arcsec);
  EXPECT_NEAR(std::sqrt(square / told), 1.0, 0.6);  // sigma means what it says
  EXPECT_NEAR(found.axis.value(1e-9), found.axis.value(turn - 1e-9), 0.02 * arcsec);
}

TEST(RotaryAxis, GapAtTheSeamIsClosedByTheTurn) {
  // Targets each 15 degrees up to 345: the last 15 come from both sides.
  const auto found =
      metrology::identify_rotary('c', readings(turn / 24, turn * 23 / 24, 0.02 * arcsec, true), {0.0, turn});
  EXPECT_TRUE(found.axis.comes_round);
  EXPECT_NEAR(found.axis.value(turn * 0.98), error(turn * 0.98), 0.1 * arcsec);
}

TEST(RotaryAxis, OfLessThanATurnHoldsItsEnds) {
  const auto found = metrology::identify_rotary('a', readings(0.05, 1.0, 0.02 * arcsec, true), {0.0, 1.0});
  EXPECT_FALSE(found.axis.comes_round);
  EXPECT_NEAR(found.axis.value(1.5), error(1.0), 0.1 * arcsec);
  EXPECT_GT(found.axis.sigma(1.5), 3.0 * found.axis.sigma(0.5));
}

TEST(RotaryAxis, ReadInOneDirectionTellsNoReversal) {
  const auto found =
      metrology::identify_rotary('b', readings(turn / 24, turn, 0.02 * arcsec, false), {0.0, turn});
  EXPECT_TRUE(found.axis.reversal.empty());
  EXPECT_EQ(found.axis.value(1.0, 1.0), found.axis.value(1.0, -1.0));
  EXPECT_TRUE(std::isinf(found.axis.sigma(1.0, 1.0)));
  EXPECT_LT(found.axis.sigma(1.0), 0.1 * arcsec);
}

TEST(RotaryFile, ReadsBackExactlyAndRefusesWhatIsDamaged) {
  const invar::testing::TemporaryFolder folder;
  const auto file = folder / "compensation.yaml";
  for (const bool both : {true, false}) {
    const auto axis =
        metrology::identify_rotary('c', readings(turn / 24, turn, 0.05 * arcsec, both), {0.0, turn}).axis;
    ModelText text{"rotary", {}};
    write_rotary(text, axis);
    text.write(file);
    const auto read = load_rotary(file);
    EXPECT_EQ(read.letter, 'c');
    EXPECT_EQ(read.comes_round, axis.comes_round);
    for (double at = -3.0; at < 9.0; at += 0.37)
      for (const double way : {1.0, 0.0, -1.0}) {
        EXPECT_EQ(read.value(at, way), axis.value(at, way));
        EXPECT_EQ(read.sigma(at, way), axis.sigma(at, way));
      }
  }
  std::ostringstream whole;
  whole << std::ifstream{file}.rdbuf();
  const auto refused = [&](const std::string& from, const std::string& to) {
    std::string broken = whole.str();
    broken.replace(broken.find(from), from.size(), to);
    if (from != "sigma:") broken.resize(broken.find("checksum"));  // edited on purpose
    std::ofstream{file} << broken;
    EXPECT_THROW((void)load_rotary(file), InputError) << to;
  };
  refused("sigma:", "sigma: 1");
  refused("axis: \"c\"", "axis: \"x\"");
  refused("unit: \"rad\"", "unit: \"m\"");
  refused("kind: rotary", "kind: geometric");
  refused("whole turns are taken off", "as you like");
  refused("  inputs: 1", "  inputs: 2");
}

}  // namespace
}  // namespace invar::compensation

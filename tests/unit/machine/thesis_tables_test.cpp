// Simulated tables in the shape of those of the thesis: what they read before, and what is left when their error is
// identified from lines and corrected. Prints the figures of tests/bench/results/thesis_tables.json.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdio>

#include "core/machine/machine_file.hpp"
#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/volumetric_table.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::machine {
namespace {

using Eigen::Vector3d;

struct Path {
  const char* name;
  Vector3d from, to;
};
const Path along_x{"X", {0, 0, 0}, {0.2, 0, 0}};
const Path along_y{"Y", {0, 0, 0}, {0, 0.2, 0}};
const Path along_y_at_x{"Y at x = 200", {0.2, 0, 0}, {0.2, 0.2, 0}};
const Path diagonal{"y = x", {0, 0, 0}, {0.2, 0.2, 0}};
const Path half{"y = 0.5 x", {0, 0, 0}, {0.2, 0.1, 0}};
const Path anti{"anti-diagonal", {0.2, 0, 0}, {0, 0.2, 0}};
const Path parallel{"X at y = 130", {0, 0.13, 0}, {0.2, 0.13, 0}};
const Path steep{"steep", {0.03, 0, 0}, {0.13, 0.2, 0}};

struct Machine {
  metrology::Machine machine;
  Eigen::Matrix3d directions;
  explicit Machine(const std::string& name)
      : machine{load_machine(std::string{INVAR_SOURCE_DIR "/deployment/machines/"} + name + ".yaml")},
        directions{metrology::axis_directions(machine.chain, machine.errors->squareness)} {}

  /// Largest error that a laser along the path reads, up to `range` [m]; commands are whole counts of the encoders.
  double largest(const Path& path, const metrology::VolumetricTable* table, double range = 1.0) const {
    const Vector3d beam = (path.to - path.from).normalized();
    const auto stands = [&](const Vector3d& wanted) -> Vector3d {
      Vector3d command = table == nullptr ? wanted : table->command_for(wanted, machine.tool);
      for (int k = 0; k < 2; ++k) {
        const double count = machine.resolution[static_cast<std::size_t>(k)];
        command[k] = count * std::round(command[k] / count);
      }
      return command + metrology::simulated_error(machine, directions, command, machine.tool);
    };
    const Vector3d start = stands(path.from);
    double most = 0.0;
    for (int i = 0; i <= 200; ++i) {
      const Vector3d wanted = path.from + (path.to - path.from) * i / 200.0;
      const double way = (wanted - path.from).norm();
      if (way > range + 1e-9) break;
      most = std::max(most, std::abs(beam.dot(stands(wanted) - start) - way));
    }
    return most;
  }

  metrology::VolumetricTable identified(const std::vector<Path>& lines,
                                        metrology::IdentificationMethod method) const {
    std::mt19937_64 random{17};
    metrology::testing::Laser laser;
    laser.noise = laser.repeatability = 0.4e-6;
    std::vector<metrology::DisplacementLine> measured;
    for (const Path& line : lines)
      measured.push_back(metrology::testing::measure(machine, line.name, line.from, line.to, 41, machine.tool,
                                                     random, laser));
    metrology::IdentificationOptions options;
    options.method = method;
    return metrology::VolumetricTable{metrology::identify(machine, measured, options).model};
  }
};

const std::vector<Path> four{along_x, along_y, diagonal, along_y_at_x};
const std::vector<Path> six{along_x, along_y, diagonal, along_y_at_x, half, anti};
using enum metrology::IdentificationMethod;

TEST(ThesisTables, AerotechLikeIsRightToTwoMicrometresOnLinesThatWereNotFitted) {
  const Machine table{"aerotech-like"};
  const auto seed = table.identified(four, displacement);
  const auto ours = table.identified(six, full);
  std::printf(
      "largest error along a line [um]: before, the thesis's 4 lines step by step, 6 lines at once\n");
  for (const Path& path : {along_x, along_y, diagonal, parallel, steep}) {
    const double before = table.largest(path, nullptr);
    const double after = table.largest(path, &ours);
    std::printf("  %-14s %6.2f %6.2f %6.2f\n", path.name, 1e6 * before, 1e6 * table.largest(path, &seed),
                1e6 * after);
    EXPECT_LT(after, 2e-6) << path.name;
  }
  EXPECT_NEAR(table.largest(along_x, nullptr), 6e-6, 1.5e-6);
  EXPECT_NEAR(table.largest(along_y, nullptr), 4e-6, 1.5e-6);
  EXPECT_NEAR(table.largest(diagonal, nullptr), 8e-6, 2e-6);
}

TEST(ThesisTables, WinnerMotorLikeIsRightToAFewMicrometresWhereTheThesisLeftATenthOfAMillimetre) {
  const Machine table{"winnermotor-like"};
  const auto seed = table.identified(four, displacement);
  const auto ours = table.identified(six, full);
  std::printf(
      "largest error along a line [um]: before, the thesis's 4 lines step by step, 6 lines at once\n");
  const auto row = [&](const Path& path, double range, double printed) {
    const double before = table.largest(path, nullptr, range);
    const double after = table.largest(path, &ours, range);
    std::printf("  %-14s within %3.0f mm %7.1f %7.2f %7.2f\n", path.name, 1e3 * range, 1e6 * before,
                1e6 * table.largest(path, &seed, range), 1e6 * after);
    if (printed > 0.0) {
      EXPECT_NEAR(before, printed, 0.15 * printed) << path.name;
    }
    EXPECT_LT(after, 10e-6) << path.name;
  };
  row(diagonal, 0.29, 0.43e-3);
  row(diagonal, 0.07, 0.15e-3);
  row(half, 0.29, 0.29e-3);
  row(half, 0.07, 0.12e-3);
  row(parallel, 0.29, 0.0);
  row(steep, 0.29, 0.0);
}

}  // namespace
}  // namespace invar::machine

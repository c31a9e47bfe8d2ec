// Random machines and laser readings for tests and benches: band-limited curves that no estimator's prior knows.
#pragma once

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/metrology/geometric/displacement_line.hpp"
#include "core/metrology/geometric/machine.hpp"

namespace invar::metrology::testing {

/// How the curves of a machine look.
struct CurveFamily {
  int harmonics = 6;
  double falls = 1.5;  // amplitudes as h^-falls
  double base = 2.0;   // the longest wave, in travels
  bool straight =
      true;  // the best straight line is taken away: a slope is squareness, scale or a turned frame
};

struct MachineSpread {
  double straightness = 2e-6;  // m, RMS
  double angle = 8e-6;         // rad, RMS
  double positioning = 2e-6;   // m, RMS, beside
  double slope = 5e-5;         // scale error, one sigma
  double pitch = 0.4e-6;       // m, at 32 mm
  double squareness = 30e-6;   // rad, one sigma
  CurveFamily family;
};

/// A band-limited curve, zero at the start, sampled at 81 places; `rms` about its best straight line.
inline std::vector<double> random_curve(double travel, double rms, const CurveFamily& family,
                                        std::mt19937_64& random, std::vector<double>& places) {
  std::normal_distribution<double> normal;
  constexpr int count = 81;
  std::vector<double> values(count, 0.0);
  places.clear();
  for (int i = 0; i < count; ++i) places.push_back(travel * i / (count - 1));
  for (int h = 1; h <= family.harmonics; ++h) {
    const double in = normal(random) / std::pow(h, family.falls);
    const double out = normal(random) / std::pow(h, family.falls);
    for (std::size_t i = 0; i < count; ++i) {
      const double angle = 6.283185307179586 * h * places[i] / (family.base * travel);
      values[i] += in * std::sin(angle) + out * std::cos(angle);
    }
  }
  double mean = 0.0;
  double slope = 0.0;
  double moment = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double t = places[i] - 0.5 * travel;
    mean += values[i] / count;
    slope += t * values[i];
    moment += t * t;
  }
  slope /= moment;
  double power = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double rest = values[i] - mean - slope * (places[i] - 0.5 * travel);
    power += rest * rest / count;
  }
  const double first = values.front();
  if (!family.straight) slope = 0.0;
  for (std::size_t i = 0; i < count; ++i)
    values[i] = (values[i] - first - slope * places[i]) * rms / std::sqrt(power);
  return values;
}

/// The machine of docs/explanation/geometric.md#simulated-machines.
inline Machine random_machine(const Chain& chain, const std::array<double, 3>& travel,
                              std::mt19937_64& random, const MachineSpread& spread = {}) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  Machine machine;
  machine.chain = chain;
  MachineErrors errors;
  for (int axis = 0; axis < 3; ++axis) {
    if (!chain.has(axis)) continue;
    const auto a = static_cast<std::size_t>(axis);
    machine.travel[a] = {0.0, travel[a]};
    for (int c = 6 * axis; c < 6 * axis + 6; ++c) {
      const double rms =
          is_rotation(c) ? spread.angle : (is_positioning(c) ? spread.positioning : spread.straightness);
      std::vector<double> places;
      std::vector<double> values = random_curve(travel[a], rms, spread.family, random, places);
      std::vector<ErrorFunction::Harmonic> waves;
      std::vector<double> polynomial;
      if (is_positioning(c)) {
        polynomial = {0.0, spread.slope * normal(random)};
        waves.push_back({spread.pitch, 0.032, 6.283185307179586 * uniform(random)});
      }
      errors.functions[static_cast<std::size_t>(c)] = ErrorFunction{polynomial, waves, places, values};
    }
  }
  for (double& s : errors.squareness) s = spread.squareness * normal(random);
  machine.errors = errors;
  return machine;
}

struct Laser {
  double noise = 1e-6;            // m, white, each reading
  double repeatability = 0.5e-6;  // m, of the machine, each stop
  int passes = 6;                 // forward and backward in turn
  double reversal = 0.0;          // m, of each axis
  double drift = 0.0;             // m over the line
  double outliers = 0.0;          // share of readings 20 um off
  double temperature =
      std::numeric_limits<double>::quiet_NaN();  // degC, at the first reading; NaN: not measured
  double warming = 0.0;                          // K, over the line
};

/// What the machine's scales have grown at a temperature [m].
inline Eigen::Vector3d grown(const Machine& machine, const Eigen::Vector3d& position, double temperature) {
  const MachineErrors& errors = *machine.errors;
  return (temperature - errors.reference_temperature) *
         Eigen::Vector3d{errors.expansion[0], errors.expansion[1], errors.expansion[2]}.cwiseProduct(
             position);
}

/// A line of `points` readings from `from` to `to` (m), measured as a laser zeroed at the first one would.
inline DisplacementLine measure(const Machine& machine, const std::string& name, const Eigen::Vector3d& from,
                                const Eigen::Vector3d& to, int points, const Eigen::Vector3d& tool,
                                std::mt19937_64& random, const Laser& laser = {}) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const Eigen::Matrix3d directions = axis_directions(machine.chain, machine.errors->squareness);
  const Eigen::Vector3d beam = (to - from).normalized();
  DisplacementLine line{name, {}};
  double zero = 0.0;
  const int rows = points * laser.passes;
  for (int row = 0; row < rows; ++row) {
    const int pass = row / points;
    const int step = pass % 2 == 0 ? row % points : points - 1 - row % points;
    Reading reading;
    reading.position = from + (to - from) * step / (points - 1);
    reading.tool = tool;
    reading.direction = pass % 2 == 0 ? 1 : -1;
    reading.temperature = laser.temperature + laser.warming * row / rows;
    const double warmth =
        std::isnan(laser.temperature) ? machine.errors->reference_temperature : reading.temperature;
    Eigen::Vector3d moving = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      if (std::abs(beam[k]) > 1e-9) moving[k] = reading.direction * (beam[k] > 0.0 ? 1.0 : -1.0);
    const Eigen::Vector3d actual =
        reading.position + simulated_error(machine, directions, reading.position, tool, moving,
                                           grown(machine, reading.position, warmth));
    double value = beam.dot(actual) + laser.noise * normal(random) + laser.repeatability * normal(random) +
                   0.5 * laser.reversal * beam.cwiseAbs().sum() * reading.direction +
                   laser.drift * row / rows;
    if (row > 0 && uniform(random) < laser.outliers) value += 20e-6;
    if (row == 0) zero = value;
    reading.displacement = value - zero;
    line.readings.push_back(reading);
  }
  return line;
}

}  // namespace invar::metrology::testing

// Random calibrations with an oracle, for benches: machines of any chain, travel and roughness, line sets from too few to
// plenty, lasers with reversal, drift, outliers, beam breaks and missing rows; and kinds of their own, each drawn alone.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/geometric_waves.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::metrology::testing {

using Random = std::mt19937_64;

inline double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>{low, high}(random);
}
inline double log_uniform(Random& random, double low, double high) {
  return std::exp(uniform(random, std::log(low), std::log(high)));
}
inline double normal(Random& random) { return std::normal_distribution<double>{}(random); }
inline bool chance(Random& random, double p) { return uniform(random, 0.0, 1.0) < p; }

inline bool same_waves = false;

/// A family of curves: harmonics of twice the travel (or of 0.5 m) with amplitudes falling as h^-power, a straight line, a pitch error.
struct Family {
  int harmonics = 6;
  double power = 2.0;
  double amplitude = 0.0;  // RMS of the waves over many draws
  double slope = 0.0;      // 1/m or rad/m, sd
  double pitch = 0.0;      // m, amplitude
  double second = 0.0;     // m, of its second harmonic
  double period = 0.02;    // m
};

inline std::vector<double> draw(const Family& family, double travel, const std::vector<double>& places,
                                Random& random) {
  if (same_waves) travel = 0.25;
  double power = 0.0;
  for (int h = 1; h <= family.harmonics; ++h) power += std::pow(h, -2.0 * family.power);
  const double scale = family.amplitude / std::sqrt(power);
  std::vector<double> values(places.size(), 0.0);
  for (int h = 1; h <= family.harmonics; ++h) {
    const double a = scale * normal(random) * std::pow(h, -family.power);
    const double b = scale * normal(random) * std::pow(h, -family.power);
    for (std::size_t i = 0; i < places.size(); ++i) {
      const double angle = 3.141592653589793 * h * places[i] / travel;
      values[i] += a * std::sin(angle) + b * std::cos(angle);
    }
  }
  const double slope = family.slope * normal(random);
  const double in_second = family.second > 0.0 ? family.second * normal(random) : 0.0;
  const double out_second = family.second > 0.0 ? family.second * normal(random) : 0.0;
  const double in = family.pitch * normal(random);
  const double out = family.pitch * normal(random);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double angle = 6.283185307179586 * places[i] / family.period;
    values[i] += slope * places[i] + in * std::sin(angle) + out * std::cos(angle);
    values[i] += in_second * std::sin(2.0 * angle) + out_second * std::cos(2.0 * angle);
  }
  return values;
}

/// What a case is drawn for.
enum class Kind {
  any,       // everything at once
  reversal,  // lost motion that varies along each axis, read both ways
  screws,    // ball screws of any pitch, some with a second harmonic, every 4 or 5 mm, with beam breaks
  pass,      // one pass of 50 to 5000 readings a line
};

struct Case {
  std::string lines_name;
  Machine machine;
  std::array<Family, error_motion_count> families;
  std::array<Family, 3> reversals;  // of the part that varies
  double squareness = 0.0;
  std::vector<DisplacementLine> lines;
  int axes = 3;
};

inline std::vector<double> fine(double travel) {
  std::vector<double> places;
  for (int i = 0; i <= 400; ++i) places.push_back(travel * i / 400);
  return places;
}

inline std::vector<PlannedLine> line_set(const Machine& machine, Random& random, std::string& name) {
  auto lines = recipe_lines(machine, 2);
  const auto all = candidate_lines(machine);
  const int kind = std::uniform_int_distribution<int>{0, machine.chain.axes == 2 ? 4 : 5}(random);
  if (machine.chain.axes == 2) {
    lines.resize(kind == 0 ? 4 : (kind == 1 ? 5 : (kind == 2 ? 6 : 7)));
    name = "xy " + std::to_string(lines.size());
    if (kind == 4) {
      lines.resize(4);
      lines.push_back(recipe_lines(machine, 1).back());
      name = "xy 4+anti";
    }
    return lines;
  }
  if (kind <= 2) {
    lines.resize(kind == 0 ? 14 : (kind == 1 ? 17 : 20));
    name = "xyz " + std::to_string(lines.size());
    return lines;
  }
  // Parallels and diagonals from corner to corner: what is usual, and short of rank.
  std::vector<PlannedLine> usual;
  for (const auto& one : all) {
    const Eigen::Vector3d part = one.to - one.from;
    bool corner = true;
    for (int k = 0; k < 3; ++k) {
      const double width = machine.travel[static_cast<std::size_t>(k)].width();
      corner = corner && (std::abs(part[k]) < 1e-9 || std::abs(std::abs(part[k]) - width) < 1e-9);
      const double at = one.from[k] / width;
      corner = corner && (at < 1e-9 || at > 1.0 - 1e-9);
    }
    if (corner) usual.push_back(one);
  }
  if (kind == 3) {
    std::shuffle(usual.begin(), usual.end(), random);
    usual.resize(15);
    name = "xyz 15 of the usual";
    // The axes themselves are always measured.
    const auto axes = recipe_lines(machine, 0);
    for (std::size_t i = 0; i < 3; ++i) usual[i] = axes[i];
    return usual;
  }
  if (kind == 4) {
    name = "xyz usual " + std::to_string(usual.size());
    return usual;
  }
  usual.resize(std::min<std::size_t>(usual.size(), 19));
  usual.push_back(lines[7]);
  usual.push_back(lines[9]);
  name = "xyz usual and half slopes";
  return usual;
}

inline DisplacementLine read_line(const Case& one, const PlannedLine& planned, double interval, double noise,
                                  double repeatability, bool counts, double drift, double outliers,
                                  double missing, bool broken, int passes, int many, Random& random) {
  const Machine& machine = one.machine;
  const Eigen::Matrix3d directions = axis_directions(machine.chain, machine.errors->squareness);
  const Eigen::Vector3d beam = (planned.to - planned.from).normalized();
  const int points = many > 0 ? many : std::max(5, points_of(planned, interval));
  DisplacementLine line{planned.name, {}};
  double zero = 0.0;
  const int rows = passes * points;
  const int jump_row = broken ? static_cast<int>(uniform(random, 0.2, 0.8) * rows) : rows;
  const double jump = 1e-6 * uniform(random, 3.0, 20.0);
  const double bend = normal(random);
  for (int row = 0; row < rows; ++row) {
    const int pass = row / points;
    const int step = pass % 2 == 0 ? row % points : points - 1 - row % points;
    Reading reading;
    reading.position = planned.from + (planned.to - planned.from) * step / (points - 1);
    reading.tool = planned.tool;
    reading.direction = pass % 2 == 0 ? 1 : -1;
    Eigen::Vector3d moving = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      if (std::abs(beam[k]) > 1e-9) moving[k] = reading.direction * (beam[k] > 0 ? 1.0 : -1.0);
    const double t = static_cast<double>(row) / rows;
    double value = beam.dot(reading.position +
                            simulated_error(machine, directions, reading.position, reading.tool, moving));
    value += noise * normal(random) + repeatability * normal(random) + drift * (t + bend * t * t);
    if (counts) value += 1e-6 * uniform(random, -0.5, 0.5);
    if (row > 0 && chance(random, outliers)) value += 1e-6 * uniform(random, -30.0, 30.0);
    if (row >= jump_row) value += jump;
    if (row == 0) zero = value;
    reading.displacement = value - zero;
    if (row == 0 || !chance(random, missing)) line.readings.push_back(reading);
  }
  return line;
}

/// What is drawn otherwise for a kind of its own.
struct Deviation {
  double pitch = -1.0;  // m, amplitude of the screws; negative: as drawn
  double second = 0.0;  // of the pitch
  int passes = 6;
  int many = 0;           // readings a pass; 0: by the interval
  double interval = 0.0;  // m; 0: as drawn
  double breaks = -1.0;   // share of lines; negative: as drawn
  double drift = 1.0;     // times what is drawn
};

inline Deviation deviation_of(Kind kind, Random& random) {
  Deviation result;
  if (kind == Kind::screws) {
    result.pitch = 1e-6 * log_uniform(random, 0.5, 3.0);
    result.second = chance(random, 0.5) ? 0.3 : 0.0;
    result.interval = chance(random, 0.5) ? 0.004 : 0.005;
    result.breaks = 0.3;
  } else if (kind == Kind::pass) {
    result.passes = 1;
    result.many = static_cast<int>(log_uniform(random, 50.0, 5000.0));
    result.pitch = 0.0;
    result.breaks = 0.0;
    result.drift = 0.0;  // nobody can tell it from the place
  }
  return result;
}

inline double screw_period(Random& random) {
  constexpr std::array<double, 9> pitches{0.004, 0.005, 0.006, 0.008, 0.01, 0.0127, 0.016, 0.02, 0.025};
  return pitches[static_cast<std::size_t>(uniform(random, 0, 8.999))];
}

/// A constant, a slope and three waves: half a wave to one and a half over the travel.
inline ErrorFunction draw_reversal(Family& family, double travel, Random& random) {
  family = {};
  family.harmonics = 3;
  family.power = 1.0;
  family.amplitude = 1e-6 * log_uniform(random, 0.5, 10.0);
  family.slope = 1e-6 * log_uniform(random, 0.5, 20.0) / travel;
  const auto places = fine(travel);
  return ErrorFunction{{1e-6 * uniform(random, 0.0, 4.0)}, {}, places, draw(family, travel, places, random)};
}

inline Case random_case(unsigned seed, Kind kind = Kind::any) {
  Random random{seed};
  Case one;
  Machine& machine = one.machine;
  const bool flat = chance(random, 0.4);
  std::array<int, 3> order{0, 1, 2};
  std::shuffle(order.begin(), order.end(), random);
  if (flat) order = chance(random, 0.5) ? std::array<int, 3>{0, 1, 2} : std::array<int, 3>{1, 0, 2};
  machine.chain = {order, flat ? 2 : 3};
  one.axes = machine.chain.axes;
  if (!flat && chance(random, 0.3))
    machine.tool = {uniform(random, -.05, .05), uniform(random, -.05, .05), uniform(random, -.12, 0)};
  const double spread = chance(random, 0.5) ? 0.0 : 0.5;  // of the components' strengths, log
  const int harmonics = std::array<int, 4>{4, 6, 8, 12}[static_cast<std::size_t>(uniform(random, 0, 3.999))];
  const double power = uniform(random, 1.0, 2.5);
  const std::array<double, 3> amplitude{1e-6 * log_uniform(random, 0.7, 4),
                                        1e-6 * log_uniform(random, 0.7, 3),
                                        1e-6 * log_uniform(random, 3, 15)};
  const double pitch = chance(random, 0.4) ? 1e-6 * uniform(random, 0.3, 1.0) : 0.0;
  const Deviation own = deviation_of(kind, random);
  MachineErrors errors;
  for (int axis = 0; axis < 3; ++axis) {
    if (!machine.chain.has(axis)) continue;
    const double travel =
        std::array<double, 5>{0.1, 0.2, 0.25, 0.3, 0.5}[static_cast<std::size_t>(uniform(random, 0, 4.999))];
    machine.travel[static_cast<std::size_t>(axis)] = {0.0, travel};
    for (int c = 6 * axis; c < 6 * axis + 6; ++c) {
      Family& family = one.families[static_cast<std::size_t>(c)];
      family.harmonics = harmonics;
      family.power = power;
      family.amplitude = amplitude[static_cast<std::size_t>(kind_of(c))] * std::exp(spread * normal(random));
      if (is_positioning(c)) {
        family.slope = 5e-5;
        family.pitch = own.pitch < 0.0 ? pitch : own.pitch;
        family.second = own.second * family.pitch;
        family.period = kind == Kind::screws ? screw_period(random) : uniform(random, 0.01, 0.04);
      }
      const auto places = fine(travel);
      errors.functions[static_cast<std::size_t>(c)] =
          ErrorFunction{{}, {}, places, draw(family, travel, places, random)};
    }
  }
  one.squareness = 4.848e-6 * log_uniform(random, 30, 900);
  for (double& s : errors.squareness) s = one.squareness * normal(random);
  if (chance(random, 0.5))
    for (auto& r : errors.reversal) r = ErrorFunction{1e-6 * uniform(random, 0.0, 4.0)};
  for (std::size_t axis = 0; axis < 3 && kind == Kind::reversal; ++axis)
    if (machine.chain.has(static_cast<int>(axis)))
      errors.reversal[axis] = draw_reversal(one.reversals[axis], machine.travel[axis].width(), random);
  machine.errors = errors;
  const auto planned = line_set(machine, random, one.lines_name);
  const double interval = std::array<double, 5>{0.005, 0.01, 0.0125, 0.02,
                                                0.025}[static_cast<std::size_t>(uniform(random, 0, 4.999))];
  const double noise = 1e-6 * uniform(random, 0.15, 1.0);
  const double repeatability = 1e-6 * uniform(random, 0.0, 0.5);
  const bool counts = chance(random, 0.5);
  const double drift = chance(random, 0.5) ? 1e-6 * uniform(random, 0.0, 3.0) : 0.0;
  const double outliers = chance(random, 0.4) ? 0.02 : 0.0;
  const double missing = chance(random, 0.4) ? 0.05 : 0.0;
  const bool breaks = chance(random, 0.2);
  for (const auto& line : planned) {
    const bool broken = own.breaks < 0.0 ? breaks && chance(random, 0.2) : chance(random, own.breaks);
    one.lines.push_back(read_line(one, line, own.interval > 0.0 ? own.interval : interval, noise,
                                  repeatability, counts, own.drift * drift * normal(random), outliers,
                                  missing, broken, own.passes, own.many, random));
  }
  return one;
}

/// The spline coefficients of a block, least squares, in its gauge: zero at the start, straightness without end-point slope.
inline Eigen::MatrixXd samples_of(const Case& one, const GeometricBasis& basis,
                                  const GeometricBasis::Block& block, Random& random) {
  const int axis = axis_of(block.motion);
  const auto& spline = basis.splines[static_cast<std::size_t>(axis)];
  const double travel = one.machine.travel[static_cast<std::size_t>(axis)].width();
  const auto places = fine(travel);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(places.size()), block.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto w = spline.at(places[i]);
    for (int k = 0; k < 4; ++k)
      rows.row(static_cast<Eigen::Index>(i)) +=
          w.value[static_cast<std::size_t>(k)] * block.coefficients.row(w.first + k);
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr{rows};
  Family smooth = one.families[static_cast<std::size_t>(block.motion)];
  smooth.pitch = smooth.second = 0.0;
  constexpr int draws = 400;
  Eigen::MatrixXd sample(block.size(), draws);
  for (int d = 0; d < draws; ++d) {
    auto values = draw(smooth, travel, places, random);
    const double first = values.front();
    const double slope = is_straightness(block.motion) ? (values.back() - first) / travel : 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) values[i] -= first + slope * places[i];
    sample.col(d) =
        qr.solve(Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())));
  }
  return sample;
}

/// The model under the covariance that the curves were drawn from, the periods of the screws known.
inline GeometricModel oracle(const Case& one, const Identification& found) {
  Random random{99};
  GeometricBasis basis = found.basis;
  std::vector<AxisWave> waves;
  std::vector<double> amplitudes;
  for (int axis = 0; axis < 3; ++axis) {
    const Family& family = one.families[static_cast<std::size_t>(translation(axis, axis))];
    if (!one.machine.chain.has(axis) || family.pitch <= 0.0) continue;
    waves.push_back({axis, 2.0 * 3.141592653589793 / family.period, 0.0, 0.0});
    amplitudes.push_back(family.pitch);
    if (family.second <= 0.0) continue;
    waves.push_back({axis, 4.0 * 3.141592653589793 / family.period, 0.0, 0.0});
    amplitudes.push_back(family.second);
  }
  basis.set_waves(waves);
  auto rows = found.rows;
  update_wave_rows(found.lines, basis, rows);
  const double misfit = waves.empty() ? found.misfit : std::min(found.misfit, 5e-8);
  const NormalEquations equations = assemble(found.lines, rows, basis.size, misfit, found.point_weights);
  Eigen::MatrixXd h = equations.normal;
  for (const auto& block : basis.blocks) {
    const Eigen::MatrixXd sample = samples_of(one, basis, block, random);
    Eigen::MatrixXd covariance = sample * sample.transpose() / static_cast<double>(sample.cols());
    covariance.diagonal().array() += 1e-5 * covariance.trace() / block.size();
    h.block(block.first, block.first, block.size(), block.size()) +=
        covariance.llt().solve(Eigen::MatrixXd::Identity(block.size(), block.size()));
  }
  for (std::size_t i = 0; i < waves.size(); ++i)
    for (int u = 0; u < wave_unknowns; ++u) {
      const int k = basis.first_wave() + wave_unknowns * static_cast<int>(i) + u;
      h(k, k) += u < 2 ? 1.0 / (amplitudes[i] * amplitudes[i]) : 1.0;
    }
  for (int i = basis.first_squareness(); i < basis.size; ++i) h(i, i) += 1.0 / 2.5e-5;
  const Eigen::VectorXd unknowns = h.llt().solve(equations.right);
  GeometricModel model = found.model;
  take_unknowns(model, basis, unknowns);
  return model;
}

/// Reversals as found and as an oracle finds them that knows the covariance they were drawn from, over all axes.
struct ReversalErrors {
  double found = 0.0, oracle = 0.0;  // m, RMS over the travels
  double inside = 0.0;               // share within two sigmas
};
inline ReversalErrors reversal_errors(const Case& one, const Identification& found) {
  constexpr int nodes = 41;
  Random random{98};
  std::vector<int> axes;
  for (int k = 0; k < 3; ++k)
    if (one.machine.chain.has(k)) axes.push_back(k);
  const auto all = static_cast<Eigen::Index>(nodes * axes.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(all, all);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(all, all);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(all);
  for (std::size_t a = 0; a < axes.size(); ++a) {
    const double travel = one.machine.travel[static_cast<std::size_t>(axes[a])].width();
    std::vector<double> places;
    for (int i = 0; i < nodes; ++i) places.push_back(travel * i / (nodes - 1));
    Eigen::MatrixXd sample(nodes, 2000);
    for (int d = 0; d < sample.cols(); ++d) {
      const auto values = draw(one.reversals[static_cast<std::size_t>(axes[a])], travel, places, random);
      sample.col(d) = Eigen::Map<const Eigen::VectorXd>(values.data(), nodes);
      sample.col(d).array() += 1e-6 * uniform(random, -4.0, 4.0);
    }
    covariance.block(static_cast<Eigen::Index>(a) * nodes, static_cast<Eigen::Index>(a) * nodes, nodes,
                     nodes) = sample * sample.transpose() / static_cast<double>(sample.cols());
  }
  covariance.diagonal().array() += 1e-17;
  for (const auto& line : found.lines) {
    const LineReversal& told = line.reversal;
    if (told.places.size() == 0) continue;
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(told.places.size(), all);
    for (Eigen::Index i = 0; i < told.places.size(); ++i)
      for (std::size_t a = 0; a < axes.size(); ++a) {
        const double travel = one.machine.travel[static_cast<std::size_t>(axes[a])].width();
        const double at = line.beam.start[axes[a]] + told.places[i] * line.beam.direction[axes[a]];
        const double u = std::clamp(at / travel, 0.0, 1.0) * (nodes - 1);
        const int low = std::min(static_cast<int>(u), nodes - 2);
        const double share = std::abs(line.beam.direction[axes[a]]);
        rows(i, static_cast<Eigen::Index>(a) * nodes + low) += share * (1.0 - (u - low));
        rows(i, static_cast<Eigen::Index>(a) * nodes + low + 1) += share * (u - low);
      }
    normal += rows.transpose() * told.information * rows;
    right += rows.transpose() * told.weighted;
  }
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(all, all);
  const Eigen::VectorXd best = (identity + covariance * normal).partialPivLu().solve(covariance * right);
  ReversalErrors errors;
  for (std::size_t a = 0; a < axes.size(); ++a) {
    const auto k = static_cast<std::size_t>(axes[a]);
    for (int i = 0; i < nodes; ++i) {
      const double at = one.machine.travel[k].width() * i / (nodes - 1);
      const double truth = one.machine.errors->reversal[k](at);
      const double off = found.model.reversal[k].value(at) - truth;
      errors.found += off * off / static_cast<double>(all);
      errors.oracle +=
          std::pow(best[static_cast<Eigen::Index>(a) * nodes + i] - truth, 2) / static_cast<double>(all);
      errors.inside += (std::abs(off) <= 2.0 * found.model.reversal[k].sigma_at(at) ? 1.0 : 0.0) /
                       static_cast<double>(all);
    }
  }
  errors.found = std::sqrt(errors.found);
  errors.oracle = std::sqrt(errors.oracle);
  return errors;
}

}  // namespace invar::metrology::testing

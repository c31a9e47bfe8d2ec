// Random calibrations of every kind, judged against an oracle: machines of any chain, travel and roughness, line sets from
// too few to plenty, lasers with reversal, drift, outliers, beam breaks and missing rows.
//
//     build/bin/bench_geometric_cases [cases] [first seed] [--same-waves]
//
// Waves are harmonics of the axis' own travel (rails that bow), with --same-waves of 0.25 m whatever the travel (bolts).
// The oracle solves the same equations with the very covariance that the curves were drawn from, which nobody has.
#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "core/metrology/geometric_identification.hpp"
#include "core/metrology/identifiability.hpp"
#include "core/metrology/line_plan.hpp"
#include "tests/unit/metrology/left_over.hpp"
#include "tests/unit/metrology/simulated_machine.hpp"

namespace invar::metrology {
namespace {

using testing::Left;
using testing::left_over;
using Random = std::mt19937_64;

double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>{low, high}(random);
}
double log_uniform(Random& random, double low, double high) {
  return std::exp(uniform(random, std::log(low), std::log(high)));
}
double normal(Random& random) { return std::normal_distribution<double>{}(random); }
bool chance(Random& random, double p) { return uniform(random, 0.0, 1.0) < p; }

bool same_waves = false;

/// A family of curves: harmonics of twice the travel (or of 0.5 m) with amplitudes falling as h^-power, a straight line, a pitch error.
struct Family {
  int harmonics = 6;
  double power = 2.0;
  double amplitude = 0.0;  // RMS of the waves over many draws
  double slope = 0.0;      // 1/m or rad/m, sd
  double pitch = 0.0;      // m, amplitude
  double period = 0.02;    // m
};

std::vector<double> draw(const Family& family, double travel, const std::vector<double>& places,
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
  const double in = family.pitch * normal(random);
  const double out = family.pitch * normal(random);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double angle = 6.283185307179586 * places[i] / family.period;
    values[i] += slope * places[i] + in * std::sin(angle) + out * std::cos(angle);
  }
  return values;
}

struct Case {
  std::string lines_name;
  Machine machine;
  std::array<Family, component_count> families;
  double squareness = 0.0;
  std::vector<DisplacementLine> lines;
  int axes = 3;
};

std::vector<double> fine(double travel) {
  std::vector<double> places;
  for (int i = 0; i <= 400; ++i) places.push_back(travel * i / 400);
  return places;
}

std::vector<PlannedLine> line_set(const Machine& machine, Random& random, std::string& name) {
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

DisplacementLine measure(const Case& one, const PlannedLine& planned, double interval, double noise,
                         double repeatability, bool counts, double drift, double outliers, double missing,
                         bool broken, Random& random) {
  const Machine& machine = one.machine;
  const Eigen::Matrix3d directions = axis_directions(machine.chain, machine.errors->squareness);
  const Eigen::Vector3d beam = (planned.to - planned.from).normalized();
  const int points = std::max(5, points_of(planned, interval));
  DisplacementLine line{planned.name, {}};
  double zero = 0.0;
  const int rows = 6 * points;
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

Case random_case(unsigned seed) {
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
        family.pitch = pitch;
        family.period = uniform(random, 0.01, 0.04);
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
  for (const auto& line : planned)
    one.lines.push_back(measure(one, line, interval, noise, repeatability, counts, drift * normal(random),
                                outliers, missing, breaks && chance(random, 0.2), random));
  return one;
}

/// Unknowns under the covariance that the curves were drawn from.
Eigen::VectorXd oracle(const Case& one, const Identification& found) {
  Random random{99};
  Eigen::MatrixXd h = found.equations.normal;
  for (const auto& block : found.basis.blocks) {
    const int axis = axis_of(block.component);
    const auto& spline = found.basis.splines[static_cast<std::size_t>(axis)];
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
    constexpr int draws = 400;
    Eigen::MatrixXd sample(block.size(), draws);
    for (int d = 0; d < draws; ++d) {
      auto values = draw(one.families[static_cast<std::size_t>(block.component)], travel, places, random);
      // In the gauge of the basis: zero at the start, straightness without end-point slope.
      const double first = values.front();
      const double slope = is_straightness(block.component) ? (values.back() - first) / travel : 0.0;
      for (std::size_t i = 0; i < values.size(); ++i) values[i] -= first + slope * places[i];
      sample.col(d) = qr.solve(
          Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())));
    }
    Eigen::MatrixXd covariance = sample * sample.transpose() / draws;
    covariance.diagonal().array() += 1e-5 * covariance.trace() / block.size();
    h.block(block.first, block.first, block.size(), block.size()) +=
        covariance.llt().solve(Eigen::MatrixXd::Identity(block.size(), block.size()));
  }
  for (int i = found.basis.first_squareness(); i < found.basis.size; ++i) h(i, i) += 1.0 / 2.5e-5;
  return h.llt().solve(found.equations.right);
}

double quantile(std::vector<double> values, double part) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1) + 0.5)];
}

struct Tally {
  std::string name;
  std::vector<double> ratio, inside, honesty, left, steps_inside;
};

void print(const Tally& tally) {
  double mean = 0.0, steps = 0.0, honesty = 0.0, log_ratio = 0.0;
  const double n = static_cast<double>(tally.ratio.size());
  for (std::size_t i = 0; i < tally.ratio.size(); ++i) {
    mean += tally.inside[i] / n;
    log_ratio += std::log(tally.ratio[i]) / n;
    honesty += tally.honesty[i] * tally.honesty[i] / n;
  }
  for (const double s : tally.steps_inside) steps += s / static_cast<double>(tally.steps_inside.size());
  std::printf("%-28s %5.0f %8.2f %8.3f %8.3f %8.3f %9.3f %8.3f %9.2f %9.3f\n", tally.name.c_str(), n,
              1e6 * quantile(tally.left, 0.5), std::exp(log_ratio), quantile(tally.ratio, 0.9), mean,
              quantile(tally.inside, 0.1), quantile(tally.inside, 0.0), std::sqrt(honesty), steps);
}

}  // namespace
}  // namespace invar::metrology

int main(int argc, char** argv) {
  using namespace invar::metrology;
  const int cases = argc > 1 ? std::atoi(argv[1]) : 100;
  same_waves = argc > 3 && std::string{argv[3]} == "--same-waves";
  const unsigned first = argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 5000;
  std::vector<Tally> tallies;
  Tally all{"all", {}, {}, {}, {}, {}};
  std::vector<double> seconds;
  for (int i = 0; i < cases; ++i) {
    const Case one = random_case(first + static_cast<unsigned>(i));
    const int nodes = one.axes == 2 ? 15 : 6;
    const std::clock_t start = std::clock();
    const Identification found = identify(one.machine, one.lines);
    seconds.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    const Left left = left_over(one.machine, &found.model, nodes);
    GeometricModel best = found.model;
    const Eigen::VectorXd unknowns = oracle(one, found);
    for (const auto& block : found.basis.blocks)
      best.coefficients[static_cast<std::size_t>(block.component)] =
          found.basis.spline_coefficients(block.component, unknowns);
    best.squareness = found.basis.squareness(unknowns);
    const double least = left_over(one.machine, &best, nodes).rms;
    double steps = -1.0;
    if (i % 3 == 0) {
      IdentificationOptions options;
      options.method = IdentificationMethod::displacement;
      const GeometricModel in_steps = identify(one.machine, one.lines, options).model;
      steps = left_over(one.machine, &in_steps, nodes).inside;
    }
    const auto place = std::find_if(tallies.begin(), tallies.end(),
                                    [&](const Tally& t) { return t.name == one.lines_name; });
    Tally& tally =
        place == tallies.end() ? tallies.emplace_back(Tally{one.lines_name, {}, {}, {}, {}, {}}) : *place;
    for (Tally* t : {&tally, &all}) {
      t->left.push_back(left.rms);
      t->ratio.push_back(left.rms / least);
      t->inside.push_back(left.inside);
      t->honesty.push_back(left.rms / left.sigma);
      if (steps >= 0.0) t->steps_inside.push_back(steps);
    }
    if (std::getenv("VERBOSE") != nullptr)
      std::printf(
          "  %u %-26s left %.2f oracle %.2f ratio %.2f inside %.2f residual/sigma %.2f misfit %.3f amp %.2f "
          "%.2f %.2f len %.3f %.3f %.3f %.2f s\n",
          first + static_cast<unsigned>(i), one.lines_name.c_str(), 1e6 * left.rms, 1e6 * least,
          left.rms / least, left.inside, left.rms / left.sigma, 1e6 * found.misfit,
          1e6 * found.prior.amplitude[0], 1e6 * found.prior.amplitude[1], 1e6 * found.prior.amplitude[2],
          found.prior.length[0], found.prior.length[1], found.prior.length[2], seconds.back());
  }
  std::printf("%-28s %5s %8s %8s %8s %8s %9s %8s %9s %9s\n", "lines", "cases", "left um", "ratio", "ratio 90",
              "2 sigma", "worst 10%", "worst", "res/sig", "steps 2s");
  std::sort(tallies.begin(), tallies.end(), [](const Tally& a, const Tally& b) { return a.name < b.name; });
  for (const Tally& tally : tallies) print(tally);
  print(all);
  std::printf("identification %.2f s of CPU median, %.2f s at most\n", quantile(seconds, 0.5),
              quantile(seconds, 1.0));
}

#include "core/physics/ripple_identification.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "core/base/contract.hpp"
#include "core/numerics/robust.hpp"
#include "core/numerics/significance.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/library.hpp"

namespace invar::physics {

namespace {

constexpr double turn = 2.0 * std::numbers::pi;
constexpr Eigen::Index nuisances = 2;  // friction, constant
constexpr int scanned_harmonics = 3;

/// What the ripple has to explain, row by row: the force that the motor gave beyond damping.
struct Forces {
  Eigen::VectorXd position, direction, force;
  std::vector<int> run;
};

Forces forces_of(const Model& axis, const RippleSamples& samples) {
  const auto n = static_cast<Eigen::Index>(samples.size());
  Forces f{Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n), samples.run};
  const double motor = axis.value("motor_constant", 1.0);
  const double damping = axis.value("viscous_damping");
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    f.position(i) = samples.position[k];
    f.direction(i) = samples.velocity[k] < 0.0 ? -1.0 : 1.0;
    f.force(i) = motor * samples.current[k] - damping * samples.velocity[k];
  }
  return f;
}

/// Columns: direction, one, then sine and cosine of each harmonic of each family, all with the sign they have in the motor's
/// force.
Eigen::MatrixXd columns(const Forces& f, const std::vector<double>& frequencies, int harmonics) {
  Eigen::MatrixXd a(f.position.size(),
                    nuisances + 2 * harmonics * static_cast<Eigen::Index>(frequencies.size()));
  a.col(0) = f.direction;
  a.col(1).setConstant(-1.0);
  Eigen::Index next = nuisances;
  for (const double frequency : frequencies)
    for (int h = 1; h <= harmonics; ++h) {
      const Eigen::ArrayXd angle = turn * frequency * h * f.position.array();
      a.col(next++) = -angle.sin();
      a.col(next++) = -angle.cos();
    }
  return a;
}

struct Solution {
  Eigen::VectorXd p;
  Eigen::MatrixXd inverse;  // of the normal matrix
  double squares = 0.0;     // of the rest
};

Solution solve(const Eigen::MatrixXd& a, const Eigen::VectorXd& y) {
  Eigen::MatrixXd gram = a.transpose() * a;
  gram.diagonal().array() += 1e-9 * static_cast<double>(a.rows());
  const Eigen::LDLT<Eigen::MatrixXd> factor{gram};
  Solution s;
  s.p = factor.solve(a.transpose() * y);
  s.inverse = factor.solve(Eigen::MatrixXd::Identity(gram.rows(), gram.cols()));
  s.squares = (y - a * s.p).squaredNorm();
  return s;
}

/// Some of the rows, so that a scan over many pitches (an axis that made many turns) ends in about a second. They are drawn
/// from even stretches by chance: every n-th row would show a short pitch as a long one.
Forces thinned(const Forces& f, Range pitches) {
  constexpr double most_work = 4e6;  // rows times pitches
  constexpr Eigen::Index fewest = 600;
  const double steps = 8.0 * (f.position.maxCoeff() - f.position.minCoeff()) / pitches.lower;
  const auto rows = std::max(fewest, static_cast<Eigen::Index>(most_work / std::max(steps, 1.0)));
  const Eigen::Index n = f.position.size();
  if (n <= rows) return f;
  std::minstd_rand random{1};
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Eigen::Index from = i * n / rows, width = (i + 1) * n / rows - from;
    chosen.push_back(from + static_cast<Eigen::Index>(random()) % width);
  }
  Forces few{f.position(chosen), f.direction(chosen), f.force(chosen), {}};
  for (const Eigen::Index i : chosen) few.run.push_back(f.run[static_cast<std::size_t>(i)]);
  return few;
}

/// The highest frequency that the rows show: three rows a period.
double highest_shown(const Forces& f) {
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < f.position.size(); ++i)
    if (const double step = std::abs(f.position(i) - f.position(i - 1)); step > 0.0) steps.push_back(step);
  return steps.empty() ? 1e300 : 1.0 / (3.0 * numerics::median(std::move(steps)));
}

/// The frequency [1/m] of the largest pitch for which nothing explains better by more than a hundredth: a ripple of pitch p has
/// also the pitches 2p, 3p.
double scan(const Forces& all, Range pitches) {
  const Forces f = thinned(all, pitches);
  const double length = std::max(f.position.maxCoeff() - f.position.minCoeff(), 1e-6);
  const double lowest = 1.0 / std::min(pitches.upper, length);
  const double shown = highest_shown(all);
  const double highest = std::max(lowest, std::min(1.0 / pitches.lower, shown));
  const double step = 1.0 / (8.0 * length);
  double best_squares = 1e300;
  std::vector<std::pair<double, double>> found;
  for (double frequency = lowest; frequency <= highest; frequency += step) {
    const int harmonics =
        std::clamp(static_cast<int>(std::min(shown / frequency, 1e6)), 1, scanned_harmonics);
    found.emplace_back(frequency, solve(columns(f, {frequency}, harmonics), f.force).squares);
    best_squares = std::min(best_squares, found.back().second);
  }
  const double nothing = solve(columns(f, {}, 0), f.force).squares;
  // Of the valleys that are nearly the deepest, the one of the shortest pitch.
  double best = found.front().first;
  for (std::size_t k = 1; k + 1 < found.size(); ++k)
    if (found[k].second <= found[k - 1].second && found[k].second <= found[k + 1].second &&
        nothing - found[k].second > 0.98 * (nothing - best_squares))
      best = found[k].first;
  return best;
}

/// Gauss-Newton on the frequency of one family with all amplitudes; returns its standard deviation through `sigma`.
double refined(const Forces& f, std::vector<double> frequencies, std::size_t which, int harmonics,
               double* sigma) {
  double& frequency = frequencies[which];
  const Eigen::Index begin = nuisances + 2 * harmonics * static_cast<Eigen::Index>(which);
  for (int round = 0; round < 20; ++round) {
    const Eigen::MatrixXd a = columns(f, frequencies, harmonics);
    const Solution linear = solve(a, f.force);
    Eigen::MatrixXd b(a.rows(), a.cols() + 1);
    b.leftCols(a.cols()) = a;
    b.col(a.cols()).setZero();
    for (int h = 1; h <= harmonics; ++h) {
      const Eigen::Index s = begin + 2 * (h - 1);
      // d/df of -p sin(w x) - q cos(w x), whose columns are there already.
      b.col(a.cols()).array() += turn * h * f.position.array() *
                                 (linear.p(s) * a.col(s + 1).array() - linear.p(s + 1) * a.col(s).array());
    }
    const Solution joint = solve(b, f.force - a * linear.p);
    const double step = joint.p(a.cols());
    const double rows = static_cast<double>(a.rows());
    if (sigma != nullptr) *sigma = std::sqrt(joint.inverse(a.cols(), a.cols()) * joint.squares / rows);
    frequency += step;
    if (std::abs(step) < 1e-9 * frequency) break;
  }
  return frequency;
}

/// By how much neighbours that err alike make the variance of a fit larger than independent ones would.
double inflation(const Eigen::VectorXd& rest) {
  const double variance = rest.squaredNorm();
  if (!(variance > 0.0)) return 1.0;
  double sum = 1.0;
  for (Eigen::Index lag = 1; lag < rest.size() / 4; ++lag) {
    const double correlation = rest.tail(rest.size() - lag).dot(rest.head(rest.size() - lag)) / variance;
    if (correlation < 0.05) break;
    sum += 2.0 * correlation;
  }
  return sum;
}

/// RMS of the force left over on every other run by a fit to the rest.
double held_out(const Forces& f, const std::vector<double>& frequencies, int harmonics) {
  const Eigen::MatrixXd a = columns(f, frequencies, harmonics);
  double squares = 0.0;
  for (int part = 0; part < 2; ++part) {
    std::vector<Eigen::Index> train, test;
    for (Eigen::Index i = 0; i < a.rows(); ++i)  // pairs of runs, so that both hold both directions
      (f.run[static_cast<std::size_t>(i)] / 2 % 2 == part ? test : train).push_back(i);
    if (train.empty() || test.empty())
      return std::sqrt(solve(a, f.force).squares / static_cast<double>(a.rows()));
    const Solution s = solve(a(train, Eigen::all), f.force(train));
    squares += (f.force(test) - a(test, Eigen::all) * s.p).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(a.rows()));
}

double ripple_at(const RippleFit& fit, double position) {
  double sum = 0.0;
  for (const RippleHarmonic& h : fit.harmonics)
    sum += h.amplitude * std::sin(turn * h.order * position / fit.pitch + h.phase);
  return sum;
}

}  // namespace

RippleSamples constant_velocity_runs(const Record& record) {
  constexpr double settling = 0.25;  // s
  constexpr double shortest = 0.5;   // s
  constexpr std::size_t most = 6000;
  const auto* reference = record.find("reference");
  const auto* position = record.find("position");
  const auto* current = record.find("current");
  INVAR_EXPECTS(reference != nullptr && position != nullptr && current != nullptr, record.rows());
  const auto& t = record.time;
  const std::size_t n = record.rows();
  std::vector<double> steps;
  for (std::size_t i = 1; i < n; ++i) steps.push_back(t[i] - t[i - 1]);
  if (steps.empty()) return {};
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  // Rows to either side for a velocity: 50 ms, so that a reference that is rounded does not look rough.
  const double usual = std::max(steps[steps.size() / 2], 1e-6);
  const auto reach = static_cast<std::size_t>(std::clamp(0.05 / usual, 3.0, 2000.0));
  std::vector<double> velocity(n, 0.0);
  for (std::size_t i = reach; i + reach < n; ++i)
    velocity[i] = ((*reference)[i + reach] - (*reference)[i - reach]) / (t[i + reach] - t[i - reach]);
  const auto steady = [&](std::size_t i) {
    if (i < 2 * reach || i + 2 * reach >= n || !(std::abs(velocity[i]) > 1e-5)) return false;
    const double tolerance = 0.01 * std::abs(velocity[i]);
    return std::abs(velocity[i] - velocity[i - reach]) < tolerance &&
           std::abs(velocity[i] - velocity[i + reach]) < tolerance;
  };
  struct Part {
    std::size_t from, to;
  };
  std::vector<Part> parts;
  std::size_t rows = 0;
  for (std::size_t i = 0; i < n;) {
    if (!steady(i)) {
      ++i;
      continue;
    }
    std::size_t to = i;
    while (to < n && steady(to)) ++to;
    std::size_t from = i;
    while (from < to && t[from] - t[i] < settling) ++from;
    if (t[to - 1] - t[i] >= shortest && from < to) {
      parts.push_back({from, to});
      rows += to - from;
    }
    i = to;
  }
  const std::size_t block = 1 + rows / most;
  RippleSamples samples;
  for (std::size_t part = 0; part < parts.size(); ++part)
    for (std::size_t from = parts[part].from; from + block <= parts[part].to; from += block) {
      double x = 0.0, v = 0.0, i = 0.0;
      for (std::size_t k = from; k < from + block; ++k) {
        x += (*position)[k];
        v += velocity[k];
        i += (*current)[k];
      }
      const auto count = static_cast<double>(block);
      if (!std::isfinite(x + i)) continue;
      samples.rows += block;
      samples.position.push_back(x / count);
      samples.velocity.push_back(v / count);
      samples.current.push_back(i / count);
      samples.run.push_back(static_cast<int>(part));
    }
  return samples;
}

namespace {

/// All families at these frequencies, fitted together; `sigmas` are those of the frequencies.
RippleFit fitted(const Forces& f, const std::vector<double>& frequencies, const std::vector<double>& sigmas,
                 int harmonics) {
  const Eigen::MatrixXd a = columns(f, frequencies, harmonics);
  const Solution s = solve(a, f.force);
  const Eigen::VectorXd rest = f.force - a * s.p;
  const double inflated = inflation(rest);
  const double variance = s.squares / static_cast<double>(a.rows()) * inflated;
  RippleFit fit;
  fit.friction = s.p(0);
  fit.constant = s.p(1);
  fit.not_noise = numerics::chance_of_alike_neighbours({rest.begin(), rest.end()});
  for (std::size_t k = 0; k < frequencies.size(); ++k) {
    RippleFamily family{
        1.0 / frequencies[k], sigmas[k] * std::sqrt(inflated) / (frequencies[k] * frequencies[k]), {}};
    for (int h = 1; h <= harmonics; ++h) {
      const Eigen::Index at = nuisances + 2 * (static_cast<Eigen::Index>(k) * harmonics + h - 1);
      RippleHarmonic harmonic;
      harmonic.order = h;
      harmonic.amplitude = std::hypot(s.p(at), s.p(at + 1));
      harmonic.phase = std::atan2(s.p(at + 1), s.p(at));
      harmonic.sigma = std::sqrt(variance * 0.5 * (s.inverse(at, at) + s.inverse(at + 1, at + 1)));
      // Two numbers free: chance alone gives 3.5 sigmas once in 450.
      if (harmonic.amplitude > 3.5 * harmonic.sigma) family.harmonics.push_back(harmonic);
    }
    fit.families.push_back(std::move(family));
  }
  fit.after = held_out(f, frequencies, harmonics);
  return fit;
}

/// Whether a family is more than the strongest of a thousand pitches of noise: chance gives 5.5 sigmas once in 3000 scans.
bool stands_out(const RippleFamily& family) {
  return std::any_of(family.harmonics.begin(), family.harmonics.end(),
                     [](const RippleHarmonic& h) { return h.amplitude > 5.5 * h.sigma; });
}

}  // namespace

RippleFit identify_ripple(const Model& axis, const RippleSamples& samples, Range pitches,
                          int most_harmonics) {
  INVAR_EXPECTS(axis.plant == Plant::axis && samples.size() >= 50, samples.size());
  constexpr std::size_t most_families = 4;
  const Forces f = forces_of(axis, samples);
  std::vector<double> frequencies{scan(f, pitches)}, sigmas{0.0};
  frequencies[0] = refined(f, frequencies, 0, scanned_harmonics, &sigmas[0]);
  RippleFit fit = fitted(f, frequencies, sigmas, most_harmonics);
  const double before = held_out(f, {}, 0);
  if (fit.after >= before || fit.families.front().harmonics.empty()) {
    fit.pitch = fit.families.front().pitch;
    fit.pitch_sigma = fit.families.front().pitch_sigma;
    fit.families.clear();
  }
  while (!fit.families.empty() && frequencies.size() < most_families) {
    const Eigen::MatrixXd a = columns(f, frequencies, most_harmonics);
    Forces rest = f;
    rest.force -= a * solve(a, f.force).p;
    auto wider = frequencies;
    wider.push_back(scan(rest, pitches));
    auto wider_sigmas = sigmas;
    wider_sigmas.push_back(0.0);
    for (int round = 0; round < 3; ++round)
      for (std::size_t k = wider.size(); k-- > 0;)
        wider[k] = refined(f, wider, k, scanned_harmonics, &wider_sigmas[k]);
    RippleFit other = fitted(f, wider, wider_sigmas, most_harmonics);
    const bool sane = other.families.back().pitch > 0.5 * pitches.lower && std::isfinite(other.after);
    if (!sane || !stands_out(other.families.back()) || other.after >= fit.after) break;
    frequencies = std::move(wider);
    sigmas = std::move(wider_sigmas);
    fit = std::move(other);
  }
  fit.before = before;
  std::erase_if(fit.families, [](const RippleFamily& family) { return family.harmonics.empty(); });
  if (!fit.families.empty()) {
    fit.pitch = fit.families.front().pitch;
    fit.pitch_sigma = fit.families.front().pitch_sigma;
    fit.harmonics = fit.families.front().harmonics;
  }
  return fit;
}

RippleFit identify_ripple(const Model& axis, const RippleSamples& samples) {
  return identify_ripple(axis, samples, is_rotary(axis) ? Range{turn / 200.0, turn} : Range{4e-3, 0.1});
}

std::vector<Term> ripple_terms(const RippleFit& fit) {
  std::vector<Term> terms;
  const TermInfo* info = find_term(Plant::axis, "force_ripple");
  for (const RippleFamily& family : fit.families)
    for (const RippleHarmonic& h : family.harmonics) {
      Term term;
      term.info = info;
      term.values = {h.amplitude, family.pitch / h.order, h.phase};
      term.sigmas = {h.sigma, family.pitch_sigma / h.order, h.sigma / h.amplitude};
      term.given = {true, true, true};
      terms.push_back(term);
    }
  return terms;
}

double position_from_ripple(const RippleFit& fit, const std::vector<double>& travelled,
                            const std::vector<double>& force, double* misfit) {
  INVAR_EXPECTS(travelled.size() == force.size() && !force.empty() && fit.pitch > 0.0, force.size());
  const auto squares = [&](double start) {  // a constant force is let free: friction and tilt are not ripple
    double sum = 0.0, all = 0.0;
    for (std::size_t i = 0; i < force.size(); ++i) {
      const double rest = force[i] - ripple_at(fit, start + travelled[i]);
      sum += rest;
      all += rest * rest;
    }
    return all - sum * sum / static_cast<double>(force.size());
  };
  constexpr int places = 256;
  double best = 0.0;
  double least = 1e300;
  for (int k = 0; k < places; ++k) {
    const double start = fit.pitch * k / places;
    if (const double value = squares(start); value < least) {
      least = value;
      best = start;
    }
  }
  double width = fit.pitch / places;
  for (int round = 0; round < 40; ++round) {  // the valley is smooth: halve around its lowest point
    for (const double start : {best - width, best + width})
      if (const double value = squares(start); value < least) {
        least = value;
        best = start;
      }
    width *= 0.6;
  }
  if (misfit != nullptr) *misfit = std::sqrt(least / static_cast<double>(force.size()));
  return best - fit.pitch * std::floor(best / fit.pitch);
}

}  // namespace invar::physics

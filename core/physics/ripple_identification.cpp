#include "core/physics/ripple_identification.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/contract.hpp"
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

/// Columns: direction, one, then sine and cosine of each harmonic, all with the sign they have in the motor's force.
Eigen::MatrixXd columns(const Forces& f, double frequency, int harmonics) {
  Eigen::MatrixXd a(f.position.size(), nuisances + 2 * harmonics);
  a.col(0) = f.direction;
  a.col(1).setConstant(-1.0);
  for (int h = 1; h <= harmonics; ++h) {
    const Eigen::ArrayXd angle = turn * frequency * h * f.position.array();
    a.col(nuisances + 2 * (h - 1)) = -angle.sin();
    a.col(nuisances + 2 * (h - 1) + 1) = -angle.cos();
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

/// The frequency [1/m] of the largest pitch for which nothing explains better by more than a hundredth: a ripple of pitch p has
/// also the pitches 2p, 3p.
double scan(const Forces& f, Range pitches) {
  const double length = std::max(f.position.maxCoeff() - f.position.minCoeff(), 1e-6);
  const double lowest = 1.0 / std::min(pitches.upper, length);
  const double highest = 1.0 / pitches.lower;
  const double step = 1.0 / (8.0 * length);
  double best_squares = 1e300;
  std::vector<std::pair<double, double>> found;
  for (double frequency = lowest; frequency <= highest; frequency += step) {
    found.emplace_back(frequency, solve(columns(f, frequency, scanned_harmonics), f.force).squares);
    best_squares = std::min(best_squares, found.back().second);
  }
  const double nothing = solve(columns(f, 0.0, 0), f.force).squares;
  // Of the valleys that are nearly the deepest, the one of the shortest pitch.
  double best = found.front().first;
  for (std::size_t k = 1; k + 1 < found.size(); ++k)
    if (found[k].second <= found[k - 1].second && found[k].second <= found[k + 1].second &&
        nothing - found[k].second > 0.98 * (nothing - best_squares))
      best = found[k].first;
  return best;
}

/// Gauss-Newton on the frequency with all amplitudes; returns its standard deviation through `sigma`.
double refined(const Forces& f, double frequency, int harmonics, double* sigma) {
  for (int round = 0; round < 20; ++round) {
    const Eigen::MatrixXd a = columns(f, frequency, harmonics);
    const Solution linear = solve(a, f.force);
    Eigen::MatrixXd b(a.rows(), a.cols() + 1);
    b.leftCols(a.cols()) = a;
    b.col(a.cols()).setZero();
    for (int h = 1; h <= harmonics; ++h) {
      const Eigen::Index s = nuisances + 2 * (h - 1);
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
double held_out(const Forces& f, double frequency, int harmonics) {
  const Eigen::MatrixXd a = columns(f, frequency, harmonics);
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
      samples.position.push_back(x / count);
      samples.velocity.push_back(v / count);
      samples.current.push_back(i / count);
      samples.run.push_back(static_cast<int>(part));
    }
  return samples;
}

RippleFit identify_ripple(const Model& axis, const RippleSamples& samples, Range pitches,
                          int most_harmonics) {
  INVAR_EXPECTS(axis.plant == Plant::axis && samples.size() >= 50, samples.size());
  const Forces f = forces_of(axis, samples);
  RippleFit fit;
  double frequency_sigma = 0.0;
  const double frequency = refined(f, scan(f, pitches), scanned_harmonics, &frequency_sigma);
  const Eigen::MatrixXd a = columns(f, frequency, most_harmonics);
  const Solution s = solve(a, f.force);
  const Eigen::VectorXd rest = f.force - a * s.p;
  const double inflated = inflation(rest);
  const double variance = s.squares / static_cast<double>(a.rows()) * inflated;
  fit.pitch = 1.0 / frequency;
  fit.pitch_sigma = frequency_sigma * std::sqrt(inflated) / (frequency * frequency);
  fit.friction = s.p(0);
  fit.constant = s.p(1);
  for (int h = 1; h <= most_harmonics; ++h) {
    const Eigen::Index k = nuisances + 2 * (h - 1);
    RippleHarmonic harmonic;
    harmonic.order = h;
    harmonic.amplitude = std::hypot(s.p(k), s.p(k + 1));
    harmonic.phase = std::atan2(s.p(k + 1), s.p(k));
    harmonic.sigma = std::sqrt(variance * 0.5 * (s.inverse(k, k) + s.inverse(k + 1, k + 1)));
    // Two numbers free: chance alone gives 3.5 sigmas once in 450.
    if (harmonic.amplitude > 3.5 * harmonic.sigma) fit.harmonics.push_back(harmonic);
  }
  fit.before = held_out(f, frequency, 0);
  fit.after = held_out(f, frequency, most_harmonics);
  if (fit.after >= fit.before) fit.harmonics.clear();
  return fit;
}

std::vector<Term> ripple_terms(const RippleFit& fit) {
  std::vector<Term> terms;
  const TermInfo* info = find_term(Plant::axis, "force_ripple");
  for (const RippleHarmonic& h : fit.harmonics) {
    Term term;
    term.info = info;
    term.values = {h.amplitude, fit.pitch / h.order, h.phase};
    term.sigmas = {h.sigma, fit.pitch_sigma / h.order, h.sigma / h.amplitude};
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

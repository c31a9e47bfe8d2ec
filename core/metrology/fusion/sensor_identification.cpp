#include "core/metrology/fusion/sensor_identification.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

/// The step of a quantised sensor; 0 when it reads continuously.
double quantum(const std::vector<FusionRun>& runs, Eigen::Index sensor) {
  std::vector<double> values;
  std::size_t rows = 0;
  for (const FusionRun& run : runs)
    for (Eigen::Index i = 0; i < run.positions.rows(); ++i)
      if (const double value = run.positions(i, sensor); std::isfinite(value)) {
        values.push_back(value);
        ++rows;
      }
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  if (values.size() < 3 || values.size() * 4 > rows) return 0.0;  // most readings are new: continuous
  std::vector<double> gaps;
  for (std::size_t i = 1; i < values.size(); ++i) gaps.push_back(values[i] - values[i - 1]);
  return numerics::median(gaps);
}

PositionSensorModel identify_position(const std::vector<FusionRun>& runs, const std::vector<Motion>& motions,
                                      Eigen::Index sensor, const std::string& name,
                                      std::vector<std::string>* unidentified) {
  PositionSensorModel model;
  model.step = quantum(runs, sensor);
  for (const FusionRun& run : runs) {
    int repeats = 0;
    for (Eigen::Index i = 1; i < run.time.size() && model.step <= 0.0; ++i) {
      repeats = run.positions(i, sensor) == run.positions(i - 1, sensor) ? repeats + 1 : 0;
      model.longest_repeat = std::clamp(repeats, model.longest_repeat, 1000);
    }
  }
  // Rows of: where it was when the sensor read it, minus what was read; speed; direction; width of doubt.
  std::vector<double> apart, speed, width;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const FusionRun& run = runs[r];
    for (Eigen::Index i = 1; i < run.time.size(); ++i) {
      const double now = run.positions(i, sensor);
      const double before = run.positions(i - 1, sensor);
      if (!std::isfinite(now) || !std::isfinite(before)) continue;
      if (model.step > 0.0) {
        if (std::abs(std::abs(now - before) - model.step) > 0.2 * model.step) continue;  // one edge, no more
        apart.push_back(0.5 * (run.reference(i) + run.reference(i - 1)) - 0.5 * (now + before));
        width.push_back(std::abs(run.reference(i) - run.reference(i - 1)));
        speed.push_back(0.5 * (motions[r].velocity(i) + motions[r].velocity(i - 1)));
      } else {
        apart.push_back(run.reference(i) - now);
        width.push_back(0.0);
        speed.push_back(motions[r].velocity(i));
      }
    }
  }
  if (apart.size() < 4) {
    model.noise = std::max(model.step, 1e-4);
    if (unidentified != nullptr) unidentified->push_back("offset of " + name + " (it hardly ever changes)");
    return model;
  }
  const auto n = static_cast<Eigen::Index>(apart.size());
  const Eigen::Map<const Eigen::VectorXd> y{apart.data(), n};
  const Eigen::Map<const Eigen::VectorXd> v{speed.data(), n};
  const Eigen::Map<const Eigen::VectorXd> w{width.data(), n};
  const double fastest = v.cwiseAbs().maxCoeff();
  const bool both_ways = v.minCoeff() < -0.05 * fastest && v.maxCoeff() > 0.05 * fastest;
  const double doubt = model.step > 0.0 ? 0.01 * model.step : 1e-9;
  const Eigen::VectorXd weight = (w.array().square() / 12.0 + doubt * doubt).rsqrt();
  Eigen::MatrixXd a(n, both_ways ? 3 : 2);
  a.col(0).setOnes();
  a.col(1) = v;  // it read x(t - delay): the reference is ahead by delay v
  if (both_ways) a.col(2) = v.array().sign();
  Eigen::VectorXd keep = Eigen::VectorXd::Ones(n);
  Eigen::VectorXd p;
  Eigen::VectorXd residual;
  for (int round = 0; round < 4; ++round) {
    const Eigen::VectorXd scale = weight.cwiseProduct(keep);
    p = numerics::least_squares((scale.asDiagonal() * a), scale.cwiseProduct(y));
    residual = y - a * p;
    const Eigen::VectorXd scaled = residual.cwiseProduct(weight);
    const double size = std::max(numerics::robust_deviation({scaled.begin(), scaled.end()}, 0.0), 1e-6);
    keep = (scaled.array().abs() < 4.0 * size).cast<double>();
  }
  model.offset = p(0);
  model.delay = std::clamp(p(1), 0.0, 0.1);
  if (both_ways) model.hysteresis = p(2);
  double excess = 0.0;
  double count = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (keep(i) <= 0.0 || w(i) > 0.25 * std::max(model.step, 1e-30)) {
      if (model.step > 0.0) continue;
    }
    excess += residual(i) * residual(i) - w(i) * w(i) / 12.0;
    count += 1.0;
  }
  const double least = model.step > 0.0 ? 1e-3 * model.step : 1e-8;
  model.noise = std::max(least, std::sqrt(std::max(0.0, excess / std::max(count, 1.0))));
  if (!both_ways && model.step > 0.0 && unidentified != nullptr)
    unidentified->push_back("hysteresis of " + name + " (all runs go one way)");
  return model;
}

VelocitySensorModel identify_velocity(const std::vector<FusionRun>& runs, const std::vector<Motion>& motions,
                                      Eigen::Index sensor) {
  VelocitySensorModel model;
  std::vector<double> largest;
  std::vector<double> noise;  // of each run
  double fastest = 1e-6;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    std::vector<double> second;
    double most = 0.0;
    int repeats = 0;
    for (Eigen::Index i = 0; i < runs[r].time.size(); ++i) {
      const double now = runs[r].velocities(i, sensor);
      fastest = std::max(fastest, std::abs(motions[r].velocity(i)));
      most = std::max(most, std::abs(motions[r].velocity(i)));
      if (i < 2) continue;
      const double one = runs[r].velocities(i - 1, sensor);
      const double two = runs[r].velocities(i - 2, sensor);
      repeats = now == one ? repeats + 1 : 0;
      model.longest_repeat = std::max(model.longest_repeat, repeats);
      if (std::isfinite(now - one - two)) second.push_back(now - 2.0 * one + two);
    }
    largest.push_back(most);
    const double size =
        second.empty() ? 0.1 * most : numerics::robust_deviation(second, 0.0) / std::sqrt(6.0);
    noise.push_back(std::max(size, 1e-6 * std::max(most, 1e-3)));
  }
  model.longest_repeat = std::min(model.longest_repeat, 20);
  model.fastest = fastest;
  model.largest = std::max(numerics::median(largest), 1e-6);

  // reading = offset + f(v) - lag f'(v) a; powers of |v| / fastest, ridged a little; the lag by two rounds. In means over
  // 50 ms: where a servo follows the sensor, its noise shakes the axis, which at once would look like lag.
  constexpr int powers = 4;
  constexpr double mean_over = 0.05;  // [s]
  Eigen::MatrixXd gram;
  Eigen::VectorXd moment;
  Eigen::VectorXd p = Eigen::VectorXd::Zero(powers + 2);
  p(0) = fastest;
  for (int round = 0; round < 2; ++round) {
    gram = Eigen::MatrixXd::Zero(powers + 2, powers + 2);
    moment = Eigen::VectorXd::Zero(powers + 2);
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const double weight = 1.0 / (noise[r] * noise[r]);
      Eigen::VectorXd rows = Eigen::VectorXd::Zero(powers + 2);
      double readings = 0.0, count = 0.0, begun = runs[r].time(0);
      for (Eigen::Index i = 0; i < runs[r].time.size(); ++i) {
        const double reading = runs[r].velocities(i, sensor);
        if (std::isfinite(reading)) {
          const double v = motions[r].velocity(i);
          const double size = std::abs(v) / fastest;
          double slope = 0.0;
          for (int k = 0; k < powers; ++k) {
            rows(k) += (v < 0.0 ? -1.0 : 1.0) * std::pow(size, k + 1);
            slope += p(k) * (k + 1) * std::pow(size, k) / fastest;
          }
          rows(powers) += 1.0;
          rows(powers + 1) -= slope * motions[r].acceleration(i);
          readings += reading;
          count += 1.0;
        }
        if (runs[r].time(i) - begun < mean_over && i + 1 < runs[r].time.size()) continue;
        if (count > 0.0) {
          gram.selfadjointView<Eigen::Lower>().rankUpdate(rows, weight / count);
          moment += weight / count * readings * rows;
        }
        rows.setZero();
        readings = count = 0.0;
        begun = runs[r].time(i);
      }
    }
    gram.triangularView<Eigen::StrictlyUpper>() = gram.transpose();
    // Priors: nonlinearity of the size of a tenth, offset of a hundredth of the speed, lag of 20 ms.
    for (int k = 1; k < powers; ++k) gram(k, k) += 1.0 / std::pow(0.2 * fastest, 2);
    gram(powers, powers) += 1.0 / std::pow(0.02 * fastest, 2);
    gram(powers + 1, powers + 1) += 1.0 / std::pow(20e-3, 2);
    p = numerics::least_squares(gram, moment);
  }
  for (int k = 0; k < powers; ++k) model.gains[static_cast<std::size_t>(k)] = p(k) / std::pow(fastest, k + 1);
  model.offset = p(powers);
  model.lag = std::clamp(p(powers + 1), 0.0, 0.2);

  // How the noise adds up: variance of sums over 25 samples against what the second differences promise.
  double promised = 0.0;
  double found = 0.0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    constexpr Eigen::Index block = 25;
    for (Eigen::Index from = 0; from + block <= runs[r].time.size(); from += block) {
      double sum = 0.0;
      for (Eigen::Index i = from; i < from + block; ++i)
        sum += runs[r].velocities(i, sensor) - model.offset -
               model.response(motions[r].velocity(i) - model.lag * motions[r].acceleration(i));
      if (!std::isfinite(sum)) continue;
      found += std::min(sum * sum / (block * noise[r] * noise[r]), 100.0);
      promised += 1.0;
    }
  }
  if (promised > 4.0) model.correlation = std::clamp(std::sqrt(found / promised), 1.0, 5.0);
  return model;
}

}  // namespace

FusionModel identify_sensors(const std::vector<FusionRun>& runs, std::vector<std::string> position_names,
                             std::vector<std::string> velocity_names,
                             std::vector<std::string>* unidentified) {
  INVAR_EXPECTS(!runs.empty() && !position_names.empty());
  FusionModel model;
  std::vector<Motion> motions;
  for (const FusionRun& run : runs) motions.push_back(motion_of(run));
  for (std::size_t i = 0; i < position_names.size(); ++i)
    model.positions.push_back(
        identify_position(runs, motions, static_cast<Eigen::Index>(i), position_names[i], unidentified));
  for (std::size_t i = 0; i < velocity_names.size(); ++i)
    model.velocities.push_back(identify_velocity(runs, motions, static_cast<Eigen::Index>(i)));
  std::vector<double> starts;
  for (const FusionRun& run : runs)
    if (std::isfinite(run.positions(0, 0))) starts.push_back(run.reference(0) - run.positions(0, 0));
  const PositionSensorModel& first = model.positions.front();
  const double cell = std::hypot(first.step / std::sqrt(12.0), first.noise);
  model.start_offset = starts.empty() ? first.offset : numerics::median(starts);
  // Training runs may all begin on a mark; others need not, wholly: at least a twentieth of the cell.
  model.start_sigma = starts.size() < 3
                          ? cell
                          : std::clamp(numerics::robust_deviation(starts, model.start_offset),
                                       std::max(first.step / 20.0, first.noise), std::max(cell, first.noise));
  model.position_names = std::move(position_names);
  model.velocity_names = std::move(velocity_names);
  return model;
}

}  // namespace invar::metrology

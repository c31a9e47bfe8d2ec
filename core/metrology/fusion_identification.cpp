#include "core/metrology/fusion_identification.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"
#include "core/numerics/rbf_kernel.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

struct Motion {
  Eigen::VectorXd velocity;      // [m/s]
  Eigen::VectorXd acceleration;  // [m/s2]
};

/// Velocity and acceleration of the reference: a parabola through five rows around each.
Motion motion_of(const FusionRun& run) {
  const Eigen::Index n = run.time.size();
  Motion motion{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index from = std::clamp<Eigen::Index>(i - 2, 0, std::max<Eigen::Index>(0, n - 5));
    const Eigen::Index count = std::min<Eigen::Index>(5, n - from);
    if (count < 3) continue;
    Eigen::MatrixXd a(count, 3);
    const Eigen::VectorXd dt = run.time.segment(from, count).array() - run.time(i);
    a.col(0).setOnes();
    a.col(1) = dt;
    a.col(2) = 0.5 * dt.cwiseAbs2();
    const Eigen::Vector3d p = a.householderQr().solve(run.reference.segment(from, count));
    motion.velocity(i) = p(1);
    motion.acceleration(i) = p(2);
  }
  return motion;
}

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
    p = (scale.asDiagonal() * a).colPivHouseholderQr().solve(scale.cwiseProduct(y));
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

  // reading = offset + f(v) - lag f'(v) a; powers of |v| / fastest, ridged a little; the lag by two rounds.
  constexpr int powers = 4;
  Eigen::MatrixXd gram;
  Eigen::VectorXd moment;
  Eigen::VectorXd p = Eigen::VectorXd::Zero(powers + 2);
  p(0) = fastest;
  for (int round = 0; round < 2; ++round) {
    gram = Eigen::MatrixXd::Zero(powers + 2, powers + 2);
    moment = Eigen::VectorXd::Zero(powers + 2);
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const double weight = 1.0 / (noise[r] * noise[r]);
      for (Eigen::Index i = 0; i < runs[r].time.size(); ++i) {
        const double reading = runs[r].velocities(i, sensor);
        if (!std::isfinite(reading)) continue;
        const double v = motions[r].velocity(i);
        const double size = std::abs(v) / fastest;
        Eigen::VectorXd row(powers + 2);
        double slope = 0.0;
        for (int k = 0; k < powers; ++k) {
          row(k) = (v < 0.0 ? -1.0 : 1.0) * std::pow(size, k + 1);
          slope += p(k) * (k + 1) * std::pow(size, k) / fastest;
        }
        row(powers) = 1.0;
        row(powers + 1) = -slope * motions[r].acceleration(i);
        gram.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
        moment += weight * reading * row;
      }
    }
    gram.triangularView<Eigen::StrictlyUpper>() = gram.transpose();
    // Priors: nonlinearity of the size of a tenth, offset of a hundredth of the speed, lag of 20 ms.
    for (int k = 1; k < powers; ++k) gram(k, k) += 1.0 / std::pow(0.2 * fastest, 2);
    gram(powers, powers) += 1.0 / std::pow(0.02 * fastest, 2);
    gram(powers + 1, powers + 1) += 1.0 / std::pow(20e-3, 2);
    p = gram.colPivHouseholderQr().solve(moment);
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

double rms_error(const std::vector<FusedPosition>& fused, const FusionRun& run) {
  double squares = 0.0;
  for (Eigen::Index i = 0; i < run.time.size(); ++i)
    squares += std::pow(fused[static_cast<std::size_t>(i)].position - run.reference(i), 2);
  return std::sqrt(squares / static_cast<double>(run.time.size()));
}

/// Positions of all sensors, velocities integrated from the first position reading (trapezoids).
Eigen::MatrixXd integrated(const FusionRun& run) {
  const Eigen::Index n = run.time.size();
  const Eigen::Index p = run.positions.cols();
  Eigen::MatrixXd all(n, p + run.velocities.cols());
  all.leftCols(p) = run.positions;
  double begin = 0.0;
  for (Eigen::Index i = 0; i < n; ++i)
    if (std::isfinite(run.positions(i, 0))) {
      begin = run.positions(i, 0);
      break;
    }
  for (Eigen::Index k = 0; k < run.velocities.cols(); ++k) {
    double x = begin;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (i > 0) {
        const double step =
            0.5 * (run.velocities(i, k) + run.velocities(i - 1, k)) * (run.time(i) - run.time(i - 1));
        if (std::isfinite(step)) x += step;
      }
      all(i, p + k) = x;
    }
  }
  return all;
}

double typical_speed(const Motion& motion) {
  const Eigen::VectorXd speed = motion.velocity.cwiseAbs();
  return numerics::median({speed.begin(), speed.end()});
}

double run_noise(const FusionRun& run) {
  if (run.noise_level.size() > 0 && std::isfinite(run.noise_level(0))) return run.noise_level.mean();
  return run.velocities.cols() > 0 ? estimated_noise_level(run.velocities.col(0)) : 0.0;
}

/// Rows where every sensor reads.
std::vector<Eigen::Index> complete_rows(const Eigen::MatrixXd& sensors) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < sensors.rows(); ++i)
    if (sensors.row(i).allFinite()) rows.push_back(i);
  return rows;
}

}  // namespace

double estimated_noise_level(const Eigen::Ref<const Eigen::VectorXd>& velocity) {
  std::vector<double> second;
  for (Eigen::Index i = 2; i < velocity.size(); ++i) {
    const double d = velocity(i) - 2.0 * velocity(i - 1) + velocity(i - 2);
    if (std::isfinite(d)) second.push_back(d);
  }
  if (second.size() < 8) return 0.0;
  const double noise = numerics::robust_deviation(second, 0.0) / std::sqrt(6.0) * std::sqrt(3.0);
  // The largest reading of the motion: of averages long enough that the noise hardly adds to it.
  const Eigen::Index block = std::max<Eigen::Index>(20, velocity.size() / 40);
  double largest = 0.0;
  for (Eigen::Index i = 0; i + block <= velocity.size(); i += block / 2) {
    const double mean = velocity.segment(i, block).mean();
    if (std::isfinite(mean)) largest = std::max(largest, std::abs(mean));
  }
  return largest > 0.0 ? noise / largest : 0.0;
}

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

WeightModel identify_weights(const std::vector<FusionRun>& runs, int degree) {
  WeightModel model;
  model.positions = static_cast<int>(runs.front().positions.cols());
  model.velocities = static_cast<int>(runs.front().velocities.cols());
  const Eigen::Index sensors = model.positions + model.velocities;
  const auto count = static_cast<Eigen::Index>(runs.size());
  Eigen::MatrixXd selectors(2, count);
  Eigen::MatrixXd weights(sensors, count);
  std::vector<double> intercepts;
  for (Eigen::Index r = 0; r < count; ++r) {
    const FusionRun& run = runs[static_cast<std::size_t>(r)];
    const Eigen::MatrixXd all = integrated(run);
    const auto rows = complete_rows(all);
    selectors.col(r) << typical_speed(motion_of(run)), run_noise(run);
    weights.col(r).setConstant(1.0 / static_cast<double>(sensors));
    if (static_cast<Eigen::Index>(rows.size()) <= sensors + 1) continue;
    const WeightFit fit = fit_weights(all(rows, Eigen::all), run.reference(rows));
    weights.col(r) = fit.weights.cwiseMax(0.0).cwiseMin(1.0);
    intercepts.push_back(fit.intercept);
  }
  model.intercept = intercepts.empty() ? 0.0 : numerics::median(intercepts);
  for (Eigen::Index i = 1; i < sensors; ++i) {
    if (count >= 5) {
      // Lengths that matter: 0.2 m/s and 570 % of noise (metrology.md section 10).
      numerics::KernelOptions options;
      options.input_scale = {0.2, 5.7};
      model.weights.push_back(numerics::fit_kernel(selectors, weights.row(i).transpose(), options).network);
    } else {  // too few runs for a surface: their mean
      numerics::RbfNetwork constant;
      constant.range = {{selectors.row(0).minCoeff(), selectors.row(0).maxCoeff()},
                        {selectors.row(1).minCoeff(), selectors.row(1).maxCoeff()}};
      constant.input_offset = constant.slope = Eigen::VectorXd::Zero(2);
      constant.input_scale = Eigen::VectorXd::Ones(2);
      constant.centres = constant.widths = Eigen::MatrixXd::Ones(2, 0);
      constant.constant = weights.row(i).mean();
      model.weights.push_back(std::move(constant));
    }
  }
  model.degree = degree;
  if (degree > 1) {
    // All monomials of the weighted mean and the difference of first and last sensor, centred scales.
    double largest = 1e-9;
    for (const FusionRun& run : runs) largest = std::max(largest, run.reference.cwiseAbs().maxCoeff());
    model.scale = largest;
    const Eigen::Index terms = (degree + 1) * (degree + 2) / 2;
    Eigen::MatrixXd gram = Eigen::MatrixXd::Identity(terms, terms) * 1e-9;
    Eigen::VectorXd moment = Eigen::VectorXd::Zero(terms);
    for (Eigen::Index r = 0; r < count; ++r) {
      const FusionRun& run = runs[static_cast<std::size_t>(r)];
      const Eigen::MatrixXd all = integrated(run);
      const Eigen::VectorXd share = weights_at(model, selectors(0, r), selectors(1, r));
      for (const Eigen::Index i : complete_rows(all)) {
        const double m = all.row(i).dot(share) / model.scale;
        const double d = (all(i, sensors - 1) - all(i, 0)) / model.scale;
        const Eigen::VectorXd row = monomials(m, d, degree);
        gram += row * row.transpose();
        moment += row * (run.reference(i) / model.scale);
      }
    }
    model.polynomial = gram.colPivHouseholderQr().solve(moment);
  }
  return model;
}

std::vector<FusedPosition> fuse(FusionEstimator& estimator, const FusionRun& run) {
  estimator.reset();
  std::vector<FusedPosition> fused;
  fused.reserve(static_cast<std::size_t>(run.time.size()));
  FusionSample sample;
  for (Eigen::Index i = 0; i < run.time.size(); ++i) {
    sample.period = i > 0 ? run.time(i) - run.time(i - 1) : 0.0;
    for (Eigen::Index k = 0; k < run.positions.cols(); ++k)
      sample.positions[static_cast<std::size_t>(k)] = run.positions(i, k);
    for (Eigen::Index k = 0; k < run.velocities.cols(); ++k)
      sample.velocities[static_cast<std::size_t>(k)] = run.velocities(i, k);
    if (run.noise_level.size() > 0) sample.noise_level = run.noise_level(i);
    fused.push_back(estimator.step(sample));
  }
  return fused;
}

FusionFit identify_fusion(const std::vector<FusionRun>& given, const std::vector<std::string>& position_names,
                          const std::vector<std::string>& velocity_names, const FusionOptions& options) {
  std::vector<FusionRun> runs = given;
  if (options.noise_estimated)
    for (FusionRun& run : runs) run.noise_level.resize(0);
  FusionFit fit;
  fit.sensors = identify_sensors(runs, position_names, velocity_names, &fit.unidentified);
  fit.weights = identify_weights(runs);

  const std::size_t folds = std::min<std::size_t>(3, runs.size());
  fit.held_out.resize(runs.size());
  std::vector<int> degrees;
  if (options.polynomial) degrees = {2, 3};
  std::vector<double> squares(2 + degrees.size(), 0.0);
  for (std::size_t fold = 0; fold < folds && runs.size() > 1; ++fold) {
    std::vector<FusionRun> train;
    for (std::size_t r = 0; r < runs.size(); ++r)
      if (r % folds != fold) train.push_back(runs[r]);
    FusionObserver observer{identify_sensors(train, position_names, velocity_names, nullptr)};
    WeightedFusion weighted{identify_weights(train)};
    std::vector<std::unique_ptr<WeightedFusion>> nonlinear;
    for (const int degree : degrees)
      nonlinear.push_back(std::make_unique<WeightedFusion>(identify_weights(train, degree)));
    for (std::size_t r = fold; r < runs.size(); r += folds) {
      HeldOut& held = fit.held_out[r];
      held.observer = rms_error(fuse(observer, runs[r]), runs[r]);
      held.weights = rms_error(fuse(weighted, runs[r]), runs[r]);
      squares[0] += held.observer * held.observer;
      squares[1] += held.weights * held.weights;
      for (std::size_t k = 0; k < nonlinear.size(); ++k)
        squares[2 + k] += std::pow(rms_error(fuse(*nonlinear[k], runs[r]), runs[r]), 2);
    }
  }
  for (std::size_t r = 0; r < runs.size(); ++r) {
    HeldOut& held = fit.held_out[r];
    held.speed = typical_speed(motion_of(runs[r]));
    held.noise_level = run_noise(runs[r]);
    const Eigen::MatrixXd all = integrated(runs[r]);
    const auto rows = complete_rows(all);
    held.best_single = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 0; k < all.cols(); ++k)
      held.best_single =
          std::min(held.best_single, std::sqrt((all(rows, k) - runs[r].reference(rows)).squaredNorm() /
                                               static_cast<double>(std::max<std::size_t>(rows.size(), 1))));
    if (static_cast<Eigen::Index>(rows.size()) > all.cols() + 1) {
      const WeightFit one = fit_weights(all(rows, Eigen::all), runs[r].reference(rows));
      held.fitted.assign(one.weights.begin(), one.weights.end());
    }
  }
  const auto count = static_cast<double>(runs.size());
  fit.observer_rms = std::sqrt(squares[0] / count);
  fit.weights_rms = std::sqrt(squares[1] / count);
  double best_weights = fit.weights_rms;
  for (std::size_t k = 0; k < degrees.size(); ++k) {
    const double rms = std::sqrt(squares[2 + k] / count);
    if (fit.polynomial_rms == 0.0 || rms < fit.polynomial_rms) fit.polynomial_rms = rms;
    if (rms < best_weights) {  // never worse than linear on held-out data
      best_weights = rms;
      fit.degree = degrees[k];
    }
  }
  if (fit.degree > 1) fit.weights = identify_weights(runs, fit.degree);
  fit.method = fit.observer_rms <= best_weights ? FusionMethod::observer : FusionMethod::weights;
  if (runs.size() < 2)
    fit.notes.emplace_back("one run only: nothing could be held out, the observer is taken");
  return fit;
}

}  // namespace invar::metrology

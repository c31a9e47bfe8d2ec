#include "core/metrology/displacement_line.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {

constexpr int drift_terms = 4;              // Legendre polynomials 1..4 of the time within a line
constexpr int nuisances = 1 + drift_terms;  // reversal first
constexpr double wide = 1e-3;               // m, sd of what is not known beforehand: offset, reversal, steps
constexpr double point_tolerance = 1e-7;    // m, commanded positions nearer than this are one point
constexpr double expansion_sd = 2e-5;       // 1/K, beforehand: steel 1.2e-5, aluminium 2.3e-5
constexpr double steady = 0.02;             // K, a temperature that varies less stands still

/// Median of a copy; NaN of nothing.
double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// The parts of one line while it is being condensed.
struct Work {
  const DisplacementLine* line = nullptr;
  Beam beam;
  std::vector<int> point_of;
  std::vector<int> first_row;  // of each point
  Eigen::VectorXd y;           // reading minus nominal
  Eigen::MatrixXd regressors;  // rows x (reversal, drift, steps)
  std::vector<int> breaks;
  bool expanding = false;  // expansion is a regressor, after the drift
  double temperature = std::numeric_limits<double>::quiet_NaN();
  Eigen::VectorXd weights;
  Eigen::VectorXd nuisance;
  Eigen::MatrixXd nuisance_covariance;  // per unit noise variance
  Eigen::VectorXd residual;
  double scale = 0.0;
  double degrees = 0.0;

  [[nodiscard]] int rows() const { return static_cast<int>(y.size()); }
  [[nodiscard]] int points() const { return static_cast<int>(first_row.size()); }
};

/// Regressor of the expansion about the line's mean temperature, where the temperature changed within the line.
void add_expansion(Work& work) {
  double sum = 0.0;
  double count = 0.0;
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  for (const Reading& reading : work.line->readings) {
    if (!std::isfinite(reading.temperature)) continue;
    sum += reading.temperature;
    count += 1.0;
    lowest = std::min(lowest, reading.temperature);
    highest = std::max(highest, reading.temperature);
  }
  if (count == 0.0) return;
  work.temperature = sum / count;
  if (highest - lowest < steady) return;
  work.expanding = true;
  work.regressors.conservativeResize(Eigen::NoChange, work.regressors.cols() + 1);
  for (int i = 0; i < work.rows(); ++i) {
    const Reading& reading = work.line->readings[static_cast<std::size_t>(i)];
    const double warmer = std::isfinite(reading.temperature) ? reading.temperature - work.temperature : 0.0;
    work.regressors(i, work.regressors.cols() - 1) =
        warmer * work.beam.direction.dot(reading.position - work.beam.start);
  }
}

Work prepare(const DisplacementLine& line) {
  Work work;
  work.line = &line;
  work.beam = beam_of(line);
  const auto rows = static_cast<Eigen::Index>(line.readings.size());
  work.y.resize(rows);
  work.weights = Eigen::VectorXd::Ones(rows);
  work.regressors.resize(rows, nuisances);
  std::map<std::array<long, 6>, int> known;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Reading& reading = line.readings[static_cast<std::size_t>(i)];
    std::array<long, 6> key{};
    for (int k = 0; k < 3; ++k) {
      key[static_cast<std::size_t>(k)] = std::lround(reading.position[k] / point_tolerance);
      key[static_cast<std::size_t>(k) + 3] = std::lround(reading.tool[k] / point_tolerance);
    }
    const auto [found, is_new] = known.try_emplace(key, work.points());
    if (is_new) work.first_row.push_back(static_cast<int>(i));
    work.point_of.push_back(found->second);
    const Eigen::Vector3d moved = reading.position + reading.tool - work.beam.start - work.beam.start_tool;
    work.y[i] = reading.displacement - work.beam.direction.dot(moved);
    const double t = rows > 1 ? 2.0 * static_cast<double>(i) / static_cast<double>(rows - 1) - 1.0 : 0.0;
    const double t2 = t * t;
    work.regressors.row(i) << 0.5 * reading.direction, t, 0.5 * (3.0 * t2 - 1.0), 0.5 * t * (5.0 * t2 - 3.0),
        0.125 * (35.0 * t2 * t2 - 30.0 * t2 + 3.0);
  }
  add_expansion(work);
  return work;
}

/// Weighted least squares of y = point means + regressors * nuisance with a prior on the nuisance. The means are
/// eliminated first (their normal matrix is diagonal).
void fit(Work& work, const Eigen::VectorXd& prior_variance) {
  const Eigen::Index q = work.regressors.cols();
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(work.points());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(work.points());
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(work.points(), q);
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    mass[j] += work.weights[i];
    sum[j] += work.weights[i] * work.y[i];
    cross.row(j) += work.weights[i] * work.regressors.row(i);
  }
  for (int j = 0; j < work.points(); ++j) {
    const double m = std::max(mass[j], 1e-12);
    sum[j] /= m;
    cross.row(j) /= m;
  }
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(q, q);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(q);
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    const Eigen::VectorXd centred = work.regressors.row(i) - cross.row(j);
    normal.noalias() += work.weights[i] * centred * centred.transpose();
    right += work.weights[i] * (work.y[i] - sum[j]) * centred;
  }
  const double variance = work.scale * work.scale;
  for (Eigen::Index k = 0; k < q; ++k) normal(k, k) += variance / prior_variance[k] + 1e-12;
  work.nuisance_covariance = normal.ldlt().solve(Eigen::MatrixXd::Identity(q, q));
  work.nuisance = work.nuisance_covariance * right;
  work.residual.resize(work.rows());
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    work.residual[i] = work.y[i] - sum[j] - (work.regressors.row(i) - cross.row(j)).dot(work.nuisance);
  }
  double seen = 0.0;
  for (int j = 0; j < work.points(); ++j) seen += mass[j] > 1e-9 ? 1.0 : 0.0;
  work.degrees = work.weights.sum() - seen - static_cast<double>(work.breaks.size()) - 2.0;
}

double standardised_scale(const Work& work) {
  // Residuals are smaller than errors by the degrees of freedom spent.
  std::vector<double> size;
  for (int i = 0; i < work.rows(); ++i)
    if (work.weights[i] > 0.0) size.push_back(std::abs(work.residual[i]));
  const double rows = static_cast<double>(size.size());
  if (work.degrees < 3.0) return std::numeric_limits<double>::quiet_NaN();
  return 1.4826 * median(size) * std::sqrt(rows / work.degrees);
}

/// From neighbours in time, which steps and drift hardly touch.
double first_scale(Work& work) {
  std::vector<std::vector<double>> of_point(work.first_row.size());
  for (int i = 0; i < work.rows(); ++i)
    of_point[static_cast<std::size_t>(work.point_of[static_cast<std::size_t>(i)])].push_back(work.y[i]);
  std::vector<double> middle;
  middle.reserve(of_point.size());
  for (const auto& values : of_point) middle.push_back(median(values));
  work.residual.resize(work.rows());
  for (int i = 0; i < work.rows(); ++i)
    work.residual[i] =
        work.y[i] - middle[static_cast<std::size_t>(work.point_of[static_cast<std::size_t>(i)])];
  std::vector<double> steps;
  for (int i = 1; i < work.rows(); ++i) steps.push_back(std::abs(work.residual[i] - work.residual[i - 1]));
  return 1.4826 * median(steps) / std::sqrt(2.0);
}

void huber_weights(Work& work) {
  for (int i = 0; i < work.rows(); ++i) {
    const double z = std::abs(work.residual[i]) / (2.0 * work.scale);
    work.weights[i] = z < 1.0 ? 1.0 : 1.0 / z;
  }
}

void tukey_weights(Work& work) {
  for (int i = 0; i < work.rows(); ++i) {
    const double z = work.residual[i] / (6.0 * work.scale);
    work.weights[i] = std::abs(z) < 1.0 ? (1.0 - z * z) * (1.0 - z * z) : 0.0;
  }
}

/// Adds the step that explains most, if it explains more than chance: returns whether one was found.
bool find_break(Work& work) {
  constexpr double significance = 36.0;  // chi-square of one parameter: six sigma
  const int rows = work.rows();
  double best = significance;
  int where = 0;
  Eigen::VectorXd mass = Eigen::VectorXd::Constant(work.points(), 1e-12);
  for (int i = 0; i < rows; ++i) mass[work.point_of[static_cast<std::size_t>(i)]] += work.weights[i];
  Eigen::VectorXd above = Eigen::VectorXd::Zero(work.points());
  // A step against means and regressors: its part that they cannot follow.
  Eigen::MatrixXd centred(rows, work.regressors.cols());
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(work.points(), work.regressors.cols());
  for (int i = 0; i < rows; ++i)
    cross.row(work.point_of[static_cast<std::size_t>(i)]) += work.weights[i] * work.regressors.row(i);
  for (int i = 0; i < rows; ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    centred.row(i) = work.regressors.row(i) - cross.row(j) / mass[j];
  }
  Eigen::VectorXd shared = Eigen::VectorXd::Zero(work.regressors.cols());
  double moment = 0.0;
  double energy = 0.0;
  for (int b = rows - 1; b > 1; --b) {  // the step from row b on
    const int j = work.point_of[static_cast<std::size_t>(b)];
    const double w = work.weights[b];
    moment += w * work.residual[b];
    shared += w * centred.row(b).transpose();
    energy += w - (2.0 * above[j] * w + w * w) / mass[j];
    above[j] += w;
    if (rows - b < 3) continue;
    const double left = energy - shared.dot(work.nuisance_covariance * shared);
    if (left < 1e-3) continue;
    const double gain = moment * moment / left / (work.scale * work.scale);
    if (gain > best) {
      best = gain;
      where = b;
    }
  }
  if (where == 0) return false;
  work.breaks.push_back(where);
  work.regressors.conservativeResize(Eigen::NoChange, work.regressors.cols() + 1);
  for (int i = 0; i < rows; ++i) work.regressors(i, work.regressors.cols() - 1) = i >= where ? 1.0 : 0.0;
  return true;
}

Eigen::VectorXd prior_variances(const Work& work, const std::array<double, drift_terms>& drift) {
  Eigen::VectorXd variance = Eigen::VectorXd::Constant(work.regressors.cols(), wide * wide);
  for (int k = 0; k < drift_terms; ++k) variance[1 + k] = std::max(drift[static_cast<std::size_t>(k)], 1e-22);
  if (work.expanding) variance[nuisances] = expansion_sd * expansion_sd;
  return variance;
}

void fit_robustly(Work& work, const std::array<double, drift_terms>& drift, double floor) {
  work.scale = std::max(first_scale(work), floor);
  huber_weights(work);
  for (int attempt = 0; attempt < 4; ++attempt) {
    for (int i = 0; i < 4; ++i) {
      fit(work, prior_variances(work, drift));
      huber_weights(work);
    }
    fit(work, prior_variances(work, drift));
    if (const double scale = standardised_scale(work); std::isfinite(scale))
      work.scale = std::max(scale, floor);
    if (work.degrees < 10.0 || !find_break(work)) break;
  }
  for (int i = 0; i < 6; ++i) {
    if (const double scale = standardised_scale(work); std::isfinite(scale))
      work.scale = std::max(scale, floor);
    tukey_weights(work);
    fit(work, prior_variances(work, drift));
  }
}

/// A line without repeats says of its noise only what its roughness says: third differences along the beam.
double roughness(const Work& work) {
  std::vector<double> size;
  for (int i = 3; i < work.rows(); ++i)
    size.push_back(std::abs(work.y[i] - 3 * work.y[i - 1] + 3 * work.y[i - 2] - work.y[i - 3]));
  return size.empty() ? 0.0 : 1.4826 * median(size) / std::sqrt(20.0);
}

CondensedLine finish(Work& work, const Eigen::VectorXd& prior_variance) {
  CondensedLine result;
  const int points = work.points();
  const double variance = work.scale * work.scale;
  result.name = work.line->name;
  result.beam = work.beam;
  for (const int row : work.first_row) {
    result.points.push_back(work.line->readings[static_cast<std::size_t>(row)].position);
    result.tools.push_back(work.line->readings[static_cast<std::size_t>(row)].tool);
  }
  // The regressors with the zero point's own offset: its reading is one among many, so it is left free.
  const Eigen::Index q = work.regressors.cols() + 1;
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(points);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(points);
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(points, q);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(q, q);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(q);
  double square = 0.0;
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    const double w = work.weights[i] / variance;
    Eigen::VectorXd row(q);
    row << work.regressors.row(i).transpose(), 1.0;
    mass[j] += w;
    sum[j] += w * work.y[i];
    cross.row(j) += w * row;
    normal.noalias() += w * row * row.transpose();
    right += w * work.y[i] * row;
    square += w * work.y[i] * work.y[i];
  }
  for (Eigen::Index k = 0; k + 1 < q; ++k) normal(k, k) += 1.0 / prior_variance[k];
  normal(q - 1, q - 1) += 1.0 / (wide * wide);
  const Eigen::LDLT<Eigen::MatrixXd> factor = normal.ldlt();
  result.information = -cross * factor.solve(cross.transpose());
  result.information.diagonal() += mass;
  result.weighted = sum - cross * factor.solve(right);
  result.constant = square - right.dot(factor.solve(right));
  result.deviation.resize(points);
  result.deviation_sigma.resize(points);
  for (int j = 0; j < points; ++j) {
    const bool seen = mass[j] * variance > 1e-9;
    double value = seen ? sum[j] / mass[j] : std::numeric_limits<double>::quiet_NaN();
    for (Eigen::Index k = 0; seen && k + 1 < q; ++k) value -= cross(j, k) / mass[j] * work.nuisance[k];
    result.deviation[j] = value;
    result.deviation_sigma[j] = seen ? 1.0 / std::sqrt(mass[j]) : std::numeric_limits<double>::infinity();
  }
  for (int j = points - 1; j >= 0; --j) result.deviation[j] -= result.deviation[0];
  LineNoise& noise = result.noise;
  noise.noise = work.scale;
  noise.degrees = work.degrees;
  noise.reversal = work.nuisance[0];
  noise.reversal_sigma = work.scale * std::sqrt(work.nuisance_covariance(0, 0));
  noise.drift = 2.0 * (work.nuisance[1] + work.nuisance[3]);
  if (work.expanding) {
    const double own = 1.0 / (variance * work.nuisance_covariance(nuisances, nuisances));
    const double told = std::max(own - 1.0 / (expansion_sd * expansion_sd), 0.0);
    noise.expansion_information = told;
    // Without the share of the expectation, which comes in once for all lines.
    noise.expansion = told > 0.0 ? work.nuisance[nuisances] * own / told : 0.0;
  }
  result.temperature = work.temperature;
  noise.readings = work.rows();
  noise.outliers = static_cast<int>((work.weights.array() < 0.05).count());
  noise.breaks = work.breaks;
  result.point_of = work.point_of;
  result.weights = work.weights;
  return result;
}

}  // namespace

Beam beam_of(const DisplacementLine& line) {
  Beam beam;
  if (line.readings.empty()) return beam;
  beam.start = line.readings.front().position;
  beam.start_tool = line.readings.front().tool;
  for (const Reading& reading : line.readings) {
    const Eigen::Vector3d along = reading.position - beam.start;
    if (along.norm() > beam.length + point_tolerance) {
      beam.length = along.norm();
      beam.direction = along / beam.length;
    }
  }
  return beam;
}

std::vector<CondensedLine> condense(const std::vector<DisplacementLine>& lines, double resolution) {
  const double floor = std::max(resolution / std::sqrt(12.0), 1e-9);
  std::vector<Work> works;
  for (const DisplacementLine& line : lines)
    if (Work work = prepare(line); work.beam.length > 0.0) works.push_back(std::move(work));

  // First every line for itself with free drift, then with the drift that the lines show together.
  std::array<double, drift_terms> drift;
  drift.fill(1e-10);
  std::array<double, drift_terms> pooled{};
  int pooled_lines = 0;
  for (Work& work : works) {
    fit_robustly(work, drift, floor * 0.1);
    if (work.degrees < 15.0) continue;
    ++pooled_lines;
    for (int k = 0; k < drift_terms; ++k) {
      const double c = work.nuisance[1 + k];
      pooled[static_cast<std::size_t>(k)] +=
          c * c - work.scale * work.scale * work.nuisance_covariance(1 + k, 1 + k);
    }
  }
  for (auto& variance : pooled) variance = std::max(variance / std::max(pooled_lines, 1), 0.0);
  double sum = 0.0;
  double degrees = 0.0;
  for (Work& work : works) {
    const Eigen::VectorXd prior = prior_variances(work, pooled);
    for (int i = 0; i < 3 && work.degrees >= 3.0; ++i) {
      fit(work, prior);
      tukey_weights(work);
    }
    fit(work, prior);
    if (work.degrees >= 3.0) {
      sum += work.degrees * work.scale * work.scale;
      degrees += work.degrees;
    }
  }
  std::vector<CondensedLine> result;
  const double together = degrees > 0.0 ? std::sqrt(sum / degrees) : std::numeric_limits<double>::quiet_NaN();
  for (Work& work : works) {
    constexpr double trust = 60.0;  // degrees of freedom that the other lines' noise counts for
    const double own = std::max(work.degrees, 0.0);
    if (degrees > 0.0) {
      const double variance =
          (trust * together * together + (own >= 3.0 ? own : 0.0) * work.scale * work.scale) /
          (trust + (own >= 3.0 ? own : 0.0));
      work.scale = std::sqrt(variance);
    } else {
      work.scale = roughness(work);
    }
    work.scale = std::max(work.scale, floor * 0.1);
    result.push_back(finish(work, prior_variances(work, pooled)));
  }
  return result;
}

}  // namespace invar::metrology

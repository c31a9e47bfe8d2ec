#include "core/metrology/geometric/displacement_line.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/metrology/geometric/line_fit.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

constexpr double point_tolerance = 1e-7;  // m, commanded positions nearer than this are one point
constexpr int most_points =
    400;  // of a line: a laser that is read while the axis moves gives more places than a curve has
constexpr double steady = 0.02;  // K, a temperature that varies less stands still

/// Regressor of the expansion about the line's mean temperature, where the temperature changed within the line.
void add_expansion(LineFit& work) {
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

/// Which readings are of one point: those at the same place, or, where a line has more places than a curve needs, those
/// that are neighbours along the beam; such a point stands where the reading in its middle does.
void find_points(LineFit& work) {
  using Key = std::array<long, 6>;
  const auto group = [&](auto key_of) {
    work.point_of.clear();
    work.first_row.clear();
    std::map<Key, int> known;
    for (const Reading& reading : work.line->readings) {
      Key key = key_of(reading);
      for (int k = 0; k < 3; ++k)
        key[static_cast<std::size_t>(k) + 3] = std::lround(reading.tool[k] / point_tolerance);
      const auto [found, is_new] = known.try_emplace(key, work.points());
      if (is_new) work.first_row.push_back(static_cast<int>(work.point_of.size()));
      work.point_of.push_back(found->second);
    }
  };
  group([](const Reading& reading) {
    Key key{};
    for (int k = 0; k < 3; ++k)
      key[static_cast<std::size_t>(k)] = std::lround(reading.position[k] / point_tolerance);
    return key;
  });
  if (work.points() <= most_points) return;
  const auto place = [&](const Reading& reading) {
    return work.beam.direction.dot(reading.position - work.beam.start) / work.beam.length * most_points;
  };
  group([&](const Reading& reading) { return Key{std::lround(place(reading))}; });
  const auto off_middle = [&](std::size_t row) {
    const double at = place(work.line->readings[row]);
    return std::abs(at - std::round(at));
  };
  for (std::size_t i = 0; i < work.point_of.size(); ++i)
    if (int& middle = work.first_row[static_cast<std::size_t>(work.point_of[i])];
        off_middle(i) < off_middle(static_cast<std::size_t>(middle)))
      middle = static_cast<int>(i);
}

/// Whether some point is read again after others; `alike`: in the direction of before.
bool is_revisited(const LineFit& work, bool alike) {
  std::vector<std::array<int, 2>> last(work.first_row.size(), {-1, -1});
  for (std::size_t i = 0; i < work.point_of.size(); ++i) {
    const std::size_t way = alike && work.line->readings[i].direction < 0 ? 1 : 0;
    int& before = last[static_cast<std::size_t>(work.point_of[i])][way];
    if (before >= 0 && static_cast<std::size_t>(before) + 1 != i) return true;
    before = static_cast<int>(i);
  }
  return false;
}

LineFit prepare(const DisplacementLine& line) {
  LineFit work;
  work.line = &line;
  work.beam = beam_of(line);
  const auto rows = static_cast<Eigen::Index>(line.readings.size());
  work.y.resize(rows);
  work.weights = Eigen::VectorXd::Ones(rows);
  work.regressors.resize(rows, nuisances);
  find_points(work);
  work.revisited = is_revisited(work, false);
  work.tells_drift = is_revisited(work, true);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Reading& reading = line.readings[static_cast<std::size_t>(i)];
    const Eigen::Vector3d moved = reading.position + reading.tool - work.beam.start - work.beam.start_tool;
    work.y[i] = reading.displacement - work.beam.direction.dot(moved);
    const double t = rows > 1 ? 2.0 * static_cast<double>(i) / static_cast<double>(rows - 1) - 1.0 : 0.0;
    const double t2 = t * t;
    work.regressors.row(i) << 0.5 * reading.direction, t, 0.5 * (3.0 * t2 - 1.0), 0.5 * t * (5.0 * t2 - 3.0),
        0.125 * (35.0 * t2 * t2 - 30.0 * t2 + 3.0);
  }
  add_expansion(work);
  add_reversal(work);
  return work;
}

/// A line without repeats says of its noise only what its roughness says: third differences along the beam.
double roughness(const LineFit& work) {
  std::vector<double> size;
  for (int i = 3; i < work.rows(); ++i)
    size.push_back(std::abs(work.y[i] - 3 * work.y[i - 1] + 3 * work.y[i - 2] - work.y[i - 3]));
  return size.empty() ? 0.0 : 1.4826 * numerics::median(size) / std::sqrt(20.0);
}

/// What the readings tell of the reversal at its places, the points' means and all other nuisances marginalised.
LineReversal reversal_of(const LineFit& work, const Eigen::VectorXd& prior_variance) {
  LineReversal result;
  const auto count = static_cast<Eigen::Index>(work.reversal_places.size());
  if (count == 0) return result;
  result.places = Eigen::Map<const Eigen::VectorXd>(work.reversal_places.data(), count);
  result.values = Eigen::VectorXd::Constant(count, work.nuisance[0]);
  if (work.reversal_shape.cols() > 0)
    result.values +=
        work.reversal_shape * work.nuisance.segment(work.first_shape, work.reversal_shape.cols());
  // The others: drift, expansion and steps; the offset of the zero point lies in the points' means.
  std::vector<Eigen::Index> others;
  for (Eigen::Index k = 1; k < work.regressors.cols(); ++k)
    if (k < work.first_shape || k >= work.first_shape + work.reversal_shape.cols()) others.push_back(k);
  const auto rest = static_cast<Eigen::Index>(others.size());
  Eigen::MatrixXd rows(work.rows(), count + rest);
  rows << reversal_rows(work), work.regressors(Eigen::all, others);
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(work.points());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(work.points());
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(work.points(), rows.cols());
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    mass[j] += work.weights[i];
    sum[j] += work.weights[i] * work.y[i];
    cross.row(j) += work.weights[i] * rows.row(i);
  }
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    rows.row(i) -= cross.row(j) / std::max(mass[j], 1e-12);
  }
  const double variance = work.scale * work.scale;
  const Eigen::MatrixXd weighted = work.weights.asDiagonal() * rows;
  Eigen::MatrixXd normal = rows.transpose() * weighted / variance;
  const Eigen::VectorXd right = weighted.transpose() * work.y / variance;
  for (Eigen::Index k = 0; k < rest; ++k)
    normal(count + k, count + k) += 1.0 / prior_variance[others[static_cast<std::size_t>(k)]];
  const Eigen::LDLT<Eigen::MatrixXd> factor{normal.bottomRightCorner(rest, rest)};
  const Eigen::MatrixXd told = factor.solve(normal.bottomLeftCorner(rest, count));
  result.information = normal.topLeftCorner(count, count) - normal.topRightCorner(count, rest) * told;
  result.information = 0.5 * (result.information + result.information.transpose().eval());
  result.weighted = right.head(count) - told.transpose() * right.tail(rest);
  return result;
}

CondensedLine finish(LineFit& work, const Eigen::VectorXd& prior_variance) {
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
  result.deviation.resize(points);
  result.deviation_sigma.resize(points);
  for (int j = 0; j < points; ++j) {
    const bool seen = mass[j] * variance > 1e-9;
    double value = seen ? sum[j] / mass[j] : std::numeric_limits<double>::quiet_NaN();
    for (Eigen::Index k = 0; seen && k + 1 < q; ++k) value -= cross(j, k) / mass[j] * work.nuisance[k];
    result.deviation[j] = value;
    result.deviation_sigma[j] = seen ? 1.0 / std::sqrt(mass[j]) : std::numeric_limits<double>::infinity();
  }
  result.mass = std::move(mass);
  result.sum = std::move(sum);
  result.cross = std::move(cross);
  result.inner = std::move(normal);
  result.right = std::move(right);
  result.square = square;
  for (int j = points - 1; j >= 0; --j) result.deviation[j] -= result.deviation[0];
  LineNoise& noise = result.noise;
  noise.noise = work.scale;
  noise.degrees = work.degrees;
  result.reversal = reversal_of(work, prior_variance);
  noise.reversal = result.reversal.values.size() > 0 ? result.reversal.values.mean() : 0.0;
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

namespace {

constexpr double least_degrees = 3.0;  // of freedom: fewer tell no noise, and so nothing beyond it
constexpr double degrees_of_drift =
    15.0;  // drift is judged line by line, not weighed: only by lines that tell it well

/// How much the lines drift, and their reversal varies, by what their fits with either free say beyond their noise.
NuisancePrior pooled_prior(const std::vector<LineFit>& works) {
  NuisancePrior pooled;
  int lines = 0;
  std::vector<std::pair<double, double>> shapes;  // square and variance of what a fit found
  for (const LineFit& work : works) {
    if (work.degrees < least_degrees || !work.revisited) continue;
    const auto beyond_noise = [&](Eigen::Index k) {
      return work.nuisance[k] * work.nuisance[k] - work.scale * work.scale * work.nuisance_covariance(k, k);
    };
    for (Eigen::Index k = work.first_shape; k < work.first_shape + work.reversal_shape.cols(); ++k)
      shapes.emplace_back(work.nuisance[k] * work.nuisance[k],
                          work.scale * work.scale * work.nuisance_covariance(k, k));
    if (work.degrees < degrees_of_drift || !work.tells_drift) continue;
    ++lines;
    for (int k = 0; k < drift_terms; ++k) pooled.drift[static_cast<std::size_t>(k)] += beyond_noise(1 + k);
  }
  for (auto& variance : pooled.drift) variance = std::max(variance / std::max(lines, 1), 0.0);
  // Shapes that the readings hardly tell count little: each by the square of its own variance about the common one.
  for (int round = 0; round < 5; ++round) {
    double sum = 0.0;
    double mass = 1e-300;
    for (const auto& [square, variance] : shapes) {
      const double w = 1.0 / std::pow(variance + pooled.reversal, 2);
      sum += w * (square - variance);
      mass += w;
    }
    pooled.reversal = std::max(sum / mass, 0.0);
  }
  return pooled;
}

}  // namespace

std::vector<CondensedLine> condense(const std::vector<DisplacementLine>& lines, double resolution) {
  const double floor = std::max(resolution / std::sqrt(12.0), 1e-9);
  std::vector<LineFit> works;
  for (const DisplacementLine& line : lines)
    if (LineFit work = prepare(line); work.beam.length > 0.0) works.push_back(std::move(work));

  // First every line for itself with free drift, then with the drift that the lines show together.
  NuisancePrior free;
  free.drift.fill(1e-10);
  free.reversal = 1e-10;
  NuisancePrior still = free;
  still.drift = {};
  for (LineFit& work : works) fit_robustly(work, work.tells_drift ? free : still, floor * 0.1);
  const NuisancePrior pooled = pooled_prior(works);
  double sum = 0.0;
  double degrees = 0.0;
  for (LineFit& work : works) {
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
  for (LineFit& work : works) {
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

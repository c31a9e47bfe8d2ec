#include "core/metrology/geometric/line_fit.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/numerics/decompositions.hpp"
#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

double standardised_scale(const LineFit& work) {
  // Residuals are smaller than errors by the degrees of freedom spent.
  std::vector<double> size;
  for (int i = 0; i < work.rows(); ++i)
    if (work.weights[i] > 0.0) size.push_back(std::abs(work.residual[i]));
  const double rows = static_cast<double>(size.size());
  if (work.degrees < 3.0) return std::numeric_limits<double>::quiet_NaN();
  return 1.4826 * numerics::median(size) * std::sqrt(rows / work.degrees);
}

/// From neighbours in time, which steps and drift hardly touch. Readings in coarse counts repeat to the count: then it
/// is the count's own scatter.
double first_scale(LineFit& work) {
  std::vector<std::vector<double>> of_point(work.first_row.size());
  for (int i = 0; i < work.rows(); ++i)
    of_point[static_cast<std::size_t>(work.point_of[static_cast<std::size_t>(i)])].push_back(work.y[i]);
  std::vector<double> middle;
  middle.reserve(of_point.size());
  double count = std::numeric_limits<double>::infinity();
  for (const auto& values : of_point) {
    middle.push_back(numerics::median(values));
    for (std::size_t i = 1; i < values.size(); ++i)
      if (const double step = std::abs(values[i] - values[i - 1]); step > 1e-11)
        count = std::min(count, step);
  }
  work.residual.resize(work.rows());
  for (int i = 0; i < work.rows(); ++i)
    work.residual[i] =
        work.y[i] - middle[static_cast<std::size_t>(work.point_of[static_cast<std::size_t>(i)])];
  std::vector<double> steps;
  for (int i = 1; i < work.rows(); ++i) steps.push_back(std::abs(work.residual[i] - work.residual[i - 1]));
  const double scale = 1.4826 * numerics::median(steps) / std::sqrt(2.0);
  return std::isfinite(count) ? std::max(scale, count / std::sqrt(12.0)) : scale;
}

void huber_weights(LineFit& work) {
  for (int i = 0; i < work.rows(); ++i) {
    const double z = std::abs(work.residual[i]) / (2.0 * work.scale);
    work.weights[i] = z < 1.0 ? 1.0 : 1.0 / z;
  }
}

/// The points in their order along the beam, and by how much neighbours differ as a rule.
void order_points(LineFit& work) {
  const auto place = [&](int j) {
    const Reading& at =
        work.line->readings[static_cast<std::size_t>(work.first_row[static_cast<std::size_t>(j)])];
    return work.beam.direction.dot(at.position + at.tool);
  };
  work.along.resize(work.first_row.size());
  std::iota(work.along.begin(), work.along.end(), 0);
  std::sort(work.along.begin(), work.along.end(), [&](int a, int b) { return place(a) < place(b); });
  std::vector<double> steps;
  for (int i = 1; i < work.rows(); ++i)
    if (work.point_of[static_cast<std::size_t>(i)] != work.point_of[static_cast<std::size_t>(i) - 1])
      steps.push_back(std::abs(work.y[i] - work.y[i - 1]));
  work.neighbours = std::max(1.4826 * numerics::median(steps), work.scale);
}

/// Huber's function: what a deviation of z scales adds to the chi-square, an outlier linearly.
double huber(double z) { return std::abs(z) < 2.0 ? z * z : 4.0 * std::abs(z) - 4.0; }

/// Chi-square of the fit: of the readings, of the nuisances as expected, and of the means of neighbouring points. Those
/// decide where repeats leave it open: a step on the way there looks like one on the way back at the same place.
double cost(const LineFit& work, const Eigen::VectorXd& prior_variance) {
  double sum = work.nuisance.cwiseAbs2().cwiseQuotient(prior_variance).sum();
  for (const double residual : work.residual) sum += huber(residual / work.scale);
  // A reading less its residual and the regressors is the mean of its point.
  Eigen::VectorXd mean(work.points());
  for (int i = 0; i < work.rows(); ++i)
    mean[work.point_of[static_cast<std::size_t>(i)]] =
        work.y[i] - work.residual[i] - work.regressors.row(i).dot(work.nuisance);
  for (std::size_t j = 1; j < work.along.size(); ++j)
    sum += huber((mean[work.along[j]] - mean[work.along[j - 1]]) / work.neighbours);
  return sum;
}

/// What a step from each row on would gain, chi-square: its part that means and regressors cannot follow, against
/// residuals (of weight one).
std::vector<double> step_gains(const LineFit& work, const Eigen::VectorXd& residual,
                               const Eigen::VectorXd& prior_variance) {
  const int rows = work.rows();
  const double variance = work.scale * work.scale;
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(work.points());
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(work.points(), work.regressors.cols());
  for (int i = 0; i < rows; ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    mass[j] += 1.0;
    cross.row(j) += work.regressors.row(i);
  }
  Eigen::MatrixXd centred(rows, work.regressors.cols());
  for (int i = 0; i < rows; ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    centred.row(i) = work.regressors.row(i) - cross.row(j) / mass[j];
  }
  Eigen::MatrixXd normal = centred.transpose() * centred;
  normal.diagonal() += variance * prior_variance.cwiseInverse();
  const Eigen::MatrixXd inverse =
      numerics::solve_symmetric(normal, Eigen::MatrixXd::Identity(normal.rows(), normal.cols()));
  std::vector<double> gains(static_cast<std::size_t>(rows), 0.0);
  Eigen::VectorXd above = Eigen::VectorXd::Zero(work.points());
  Eigen::VectorXd shared = Eigen::VectorXd::Zero(work.regressors.cols());
  double moment = 0.0;
  double energy = 0.0;
  for (int b = rows - 1; b > 1; --b) {  // the step from row b on
    const int j = work.point_of[static_cast<std::size_t>(b)];
    moment += residual[b];
    shared += centred.row(b).transpose();
    energy += 1.0 - (2.0 * above[j] + 1.0) / mass[j];
    above[j] += 1.0;
    const double left = energy - shared.dot(inverse * shared);
    if (rows - b >= 3 && left > 1e-3 * energy && left > 1e-3)
      gains[static_cast<std::size_t>(b)] = moment * moment / left / variance;
  }
  return gains;
}

constexpr double six_sigma = 36.0;  // chi-square of one parameter: six sigma
/// The rows from which on a step promises most, not next to one another.
void add_promising(std::vector<double> gains, std::vector<int>& rows) {
  for (int choice = 0; choice < 4; ++choice) {
    const auto top = std::max_element(gains.begin(), gains.end());
    if (*top < six_sigma) return;
    const auto row = static_cast<int>(top - gains.begin());
    if (std::find(rows.begin(), rows.end(), row) == rows.end()) rows.push_back(row);
    std::fill(top - std::min<std::ptrdiff_t>(top - gains.begin(), 2),
              top + std::min<std::ptrdiff_t>(gains.end() - top, 3), 0.0);
  }
}

LineFit with_step(LineFit work, int row, const NuisancePrior& expected) {
  work.breaks.push_back(row);
  work.regressors.conservativeResize(Eigen::NoChange, work.regressors.cols() + 1);
  for (int i = 0; i < work.rows(); ++i) work.regressors(i, work.regressors.cols() - 1) = i >= row ? 1.0 : 0.0;
  const Eigen::VectorXd prior = prior_variances(work, expected);
  for (int i = 0; i < 5; ++i) {
    fit(work, prior);
    huber_weights(work);
  }
  return work;
}

/// Adds the step that explains most, if it explains more than chance: returns whether one was found. Where the fit
/// without it is torn, neither its residuals nor those of plain least squares need point at it: each row they name is tried.
bool find_break(LineFit& work, const NuisancePrior& expected) {
  const Eigen::VectorXd prior = prior_variances(work, expected);
  const double bound = 2.0 * work.scale;
  LineFit plain = work;
  plain.weights.setOnes();
  fit(plain, prior);
  std::vector<int> rows;
  add_promising(step_gains(work, work.residual.cwiseMax(-bound).cwiseMin(bound), prior), rows);
  add_promising(step_gains(work, plain.residual, prior), rows);
  const double before = cost(work, prior);
  double least = before;
  LineFit best;
  const auto consider = [&](int row) {
    LineFit trial = with_step(work, row, expected);
    const double after = cost(trial, prior_variances(trial, expected));
    if (!(after < least)) return false;
    least = after;
    best = std::move(trial);
    return true;
  };
  for (const int row : rows) consider(row);
  if (best.rows() == 0) return false;
  for (const int way : {-1, 1})
    while (best.breaks.back() + way > 1 && best.breaks.back() + way < work.rows() &&
           consider(best.breaks.back() + way)) {
    }
  const double scale = standardised_scale(best);
  const double wider = std::isfinite(scale) ? std::max(scale / work.scale, 1.0) : 1.0;
  if (before - least < six_sigma * wider * wider) return false;
  work = std::move(best);
  return true;
}

/// Adds the largest step of a line that was read once, if between two readings it changes by 30 times what neighbours
/// differ by and the readings beside do not: no rail does that. How large it is, the other lines tell.
bool find_tear(LineFit& work, const NuisancePrior& expected) {
  constexpr double limit = 30.0;
  const auto change = [&](int i) { return std::abs(work.y[i] - work.y[i - 1]); };
  double largest = limit * work.neighbours;
  int row = 0;
  for (int i = 2; i + 1 < work.rows(); ++i) {
    const double alone = change(i) - std::max(change(i - 1), change(i + 1));
    const bool known = std::find(work.breaks.begin(), work.breaks.end(), i) != work.breaks.end();
    if (known || alone <= largest) continue;
    largest = alone;
    row = i;
  }
  if (row == 0) return false;
  work = with_step(std::move(work), row, expected);
  return true;
}

}  // namespace

void fit(LineFit& work, const Eigen::VectorXd& prior_variance) {
  // The point means are eliminated first: their normal matrix is diagonal.
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
  double seen = 0.0;
  for (const double m : mass) seen += m > 1e-9 ? 1.0 : 0.0;
  Eigen::VectorXd least =
      Eigen::VectorXd::Zero(work.points());  // of a point whose readings all count nothing
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    if (mass[j] > 1e-9) continue;
    least[j] += 1.0;
    sum[j] += work.y[i];
    cross.row(j) += work.regressors.row(i);
  }
  for (int j = 0; j < work.points(); ++j) {
    const double m = least[j] > 0.0 ? least[j] : mass[j];
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
  work.nuisance_covariance = numerics::solve_symmetric(normal, Eigen::MatrixXd::Identity(q, q));
  work.nuisance = work.nuisance_covariance * right;
  work.residual.resize(work.rows());
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    work.residual[i] = work.y[i] - sum[j] - (work.regressors.row(i) - cross.row(j)).dot(work.nuisance);
  }
  // A nuisance that its expectation holds costs no degree of freedom.
  const double held = variance * work.nuisance_covariance.diagonal().cwiseQuotient(prior_variance).sum();
  work.degrees = work.weights.sum() - seen - (static_cast<double>(q) - held);
}

void tukey_weights(LineFit& work) {
  for (int i = 0; i < work.rows(); ++i) {
    const double z = work.residual[i] / (6.0 * work.scale);
    work.weights[i] = std::abs(z) < 1.0 ? (1.0 - z * z) * (1.0 - z * z) : 0.0;
  }
}

Eigen::VectorXd prior_variances(const LineFit& work, const NuisancePrior& expected) {
  Eigen::VectorXd variance = Eigen::VectorXd::Constant(work.regressors.cols(), wide * wide);
  for (int k = 0; k < drift_terms; ++k)
    variance[1 + k] = std::max(work.revisited ? expected.drift[static_cast<std::size_t>(k)] : 0.0, 1e-22);
  variance.segment(work.first_shape, work.reversal_shape.cols())
      .setConstant(std::max(expected.reversal, 1e-22));
  if (work.expanding) variance[nuisances] = expansion_sd * expansion_sd;
  return variance;
}

void fit_robustly(LineFit& work, const NuisancePrior& expected, double floor) {
  // The scale stands still while steps are looked for: it would grow with them, and hide them.
  work.scale = std::max(first_scale(work), floor);
  huber_weights(work);
  // Huber's sum has one minimum; a reversal of many scales takes some rounds to reach it.
  constexpr int most_rounds = 30;
  constexpr double settled = 0.02;
  double moved = 1.0;
  for (int i = 0; i < most_rounds && moved > settled; ++i) {
    const Eigen::VectorXd before = work.weights;
    fit(work, prior_variances(work, expected));
    huber_weights(work);
    moved = (work.weights - before).cwiseAbs().maxCoeff();
  }
  order_points(work);
  // Neighbours that stand for one point are no repeats: what jumps between them may be the place.
  const bool repeats = work.revisited && work.rows() - work.points() >= 10;
  for (int attempt = 0; attempt < 4; ++attempt)
    if (!(repeats ? find_break(work, expected) : find_tear(work, expected))) break;
  for (int i = 0; i < 6; ++i) {
    if (const double scale = standardised_scale(work); std::isfinite(scale))
      work.scale = std::max(scale, floor);
    tukey_weights(work);
    fit(work, prior_variances(work, expected));
  }
}

}  // namespace invar::metrology

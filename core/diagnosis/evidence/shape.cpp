#include "core/diagnosis/evidence/shape.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::diagnosis {

namespace {

/// Rows that tell something of their own.
double independent_rows(const Case& data, const physics::Model& model) {
  const auto simulated = simulate(data, model);
  double sum = 0.0;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    std::vector<std::vector<double>> left;
    double rows = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      auto& e = left.emplace_back(data.recordings[r].measured[o]);
      for (std::size_t i = 0; i < e.size(); ++i) {
        e[i] -= simulated[r][o][i];
        rows += std::isfinite(e[i]) ? 1.0 : 0.0;
      }
    }
    sum += rows * (data.is_time_series ? independent_share(left) : 1.0);
  }
  return sum;
}

/// The sum of squares that columns beside the fit's own would take from its residual.
double squares_taken(const Weighing& weighing, const Case& data, const Fit& named,
                     const Eigen::MatrixXd& columns) {
  const auto all = whitened(data, weighing, named.columns.with(columns)).dense();
  const auto own = named.columns.cols();
  const auto left = [&](Eigen::Index count) {
    const Eigen::VectorXd strength = numerics::least_squares(all.leftCols(count), named.residual);
    return (named.residual - all.leftCols(count) * strength).squaredNorm();
  };
  return own > 0 ? left(own) - left(all.cols()) : named.residual.squaredNorm() - left(all.cols());
}

}  // namespace

// A first-order lag, a pure delay and two stores one behind the other differ by this.
Eigen::MatrixXd second_times(const Case& data, const Fit& named, std::size_t term) {
  const auto& info = *named.model.terms[term].info;
  Eigen::MatrixXd columns(named.columns.rows(), 0);
  if (info.depends_on.front() != "history") return columns;
  const Eigen::VectorXd at = differences(data, simulate(data, named.model));
  for (std::size_t i = 0; i < info.parameter_count(); ++i) {
    if (i != info.index_of("time_constant") && i != info.index_of("delay")) continue;
    physics::Model more = named.model, less = named.model;
    more.terms[term].values[i] *= 1.5, less.terms[term].values[i] *= 0.5;
    const Eigen::VectorXd bend = differences(data, simulate_once(data, more)) +
                                 differences(data, simulate_once(data, less)) - 2.0 * at;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols(1) = bend.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; });
  }
  return columns;
}

double lead_over_shift(const Case& data, const Fit& named, const Eigen::MatrixXd& shift) {
  if (shift.cols() == 0) return 0.0;
  const auto plain = weigh(data, simulate(data, named.model), Colour::white);
  const auto left = residual(data, plain, named.model).squaredNorm();
  const auto all = whitened(data, plain, named.columns.with(shift.rowwise().sum())).dense();
  const auto own = named.columns.cols();
  Eigen::VectorXd apart = all.col(own);
  if (own > 0) apart -= all.leftCols(own) * numerics::least_squares(all.leftCols(own), apart);
  if (!(left > 0.0)) return 0.0;
  return 0.5 * independent_rows(data, named.model) * std::log1p(apart.squaredNorm() / left);
}

OtherShape other_shape(const Case& data, const Beside& beside, std::size_t term) {
  const auto& [plain, named, courses, memories] = beside;
  const double rows = independent_rows(data, named.model), squares = named.residual.squaredNorm();
  if (!(squares > 0.0) || !(rows > 1.0)) return {};
  OtherShape found;
  double taken = 0.0;
  const auto weigh_up = [&](double by_columns, Eigen::Index count) {
    const double lead = -0.5 * rows * std::log(std::max(1e-12, 1.0 - by_columns / squares)) -
                        0.5 * static_cast<double>(count) * std::log(std::max(10.0, rows));
    if (lead > found.lead) found.lead = lead, taken = by_columns;
  };
  std::vector<Start> starts;
  for (const auto& start : unmodelled_starts(data, named)) {
    if (!is_course_of(start.term, named.model.terms[term])) continue;
    for (const std::size_t knots : {4U, 8U})
      if (knots < start.directions.size()) starts.push_back(coarser(start, knots));
    if (start.directions.size() <= 14) starts.push_back(start);
  }
  for (const auto& s : screen(data, plain, named, starts, 3))
    if (s.columns.size() > 0) weigh_up(squares_taken(plain, data, named, s.columns), s.columns.cols());
  if (const auto late = second_times(data, named, term); late.cols() > 0)
    weigh_up(squares_taken(plain, data, named, late), late.cols());
  if (found.lead < thresholds::claim_margin) return found;
  const auto without = physics::without_term(named.model, term);
  const double all =
      fit(data, plain, without, data.model, Effort::follow(6)).residual.squaredNorm() - squares + taken;
  found.share = all > 0.0 ? std::clamp(taken / all, 0.0, 1.0) : 0.0;
  return found;
}

}  // namespace invar::diagnosis

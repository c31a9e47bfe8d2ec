#include "core/metrology/geometric/line_search.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/base/index.hpp"
#include "core/metrology/geometric/geometric_field.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

constexpr int coarse_points = 8;     // of a candidate; each stands for its share of the readings
constexpr int coarse_intervals = 6;  // of the splines: enough to rank lines
constexpr double zero_free = 1e-6;   // m^2, variance of a line's zero point

/// A candidate with the equations that it would add.
struct Candidate {
  PlannedLine line;
  LineRows rows;
  double variance = 0.0;  // of a coarse point, m^2
};

/// All lines between nodes of the grid that are no points and not the same read backward.
std::vector<PlannedLine> grid_lines(const Machine& machine) {
  const int nodes = machine.chain.axes == 2 ? 5 : 3;
  const auto ends = volume_grid(machine.chain, machine.travel, nodes);
  std::vector<PlannedLine> lines;
  for (std::size_t a = 0; a < ends.size(); ++a)
    for (std::size_t b = a + 1; b < ends.size(); ++b)
      lines.push_back(line_between(machine, ends[a], ends[b]));
  return lines;
}

class Search {
 public:
  Search(const Machine& machine, const Effort& effort, const GeometricPrior& prior, double misfit)
      : machine_{machine}, effort_{effort}, misfit_{misfit} {
    basis_ = make_basis(machine.chain, machine.travel, {coarse_intervals, coarse_intervals, coarse_intervals},
                        {machine.tool});
    NormalEquations nothing;
    nothing.normal = Eigen::MatrixXd::Zero(basis_.size, basis_.size);
    nothing.right = Eigen::VectorXd::Zero(basis_.size);
    precision_ = inverse(solve(nothing, basis_, prior).prior_covariance);
    weight_ = shape_weight(basis_, {}, machine.travel, machine.tool);
  }

  [[nodiscard]] Candidate candidate(PlannedLine line) const {
    Candidate result;
    const double length = (line.to - line.from).norm();
    Effort coarse = effort_;
    coarse.interval = length / (coarse_points - 1);
    result.rows = rows_of(planned_equations(line, coarse), basis_, {});
    const double readings = points_of(line, effort_.interval) * effort_.passes;
    result.variance = effort_.noise * effort_.noise * coarse_points / readings + misfit_ * misfit_;
    result.line = std::move(line);
    return result;
  }

  void use(const Candidate& one, double sign) {
    const Eigen::MatrixXd& r = one.rows.rows;
    const Eigen::Index points = r.rows();
    const Eigen::MatrixXd noise = one.variance * Eigen::MatrixXd::Identity(points, points) +
                                  zero_free * Eigen::MatrixXd::Ones(points, points);
    const Eigen::MatrixXd more = r.transpose() * numerics::solve_positive(noise, r);
    for (Eigen::Index i = 0; i < more.rows(); ++i)
      for (Eigen::Index j = 0; j < more.cols(); ++j)
        precision_(one.rows.unknowns[static_cast<std::size_t>(i)],
                   one.rows.unknowns[static_cast<std::size_t>(j)]) += sign * more(i, j);
  }

  /// What each candidate would take off the expected square [m^2]; the covariance is that of the lines in use.
  [[nodiscard]] std::vector<double> gains(const std::vector<Candidate>& candidates) const {
    const Eigen::MatrixXd covariance = inverse(precision_);
    const Eigen::MatrixXd spread = covariance * weight_ * covariance;
    std::vector<double> result;
    for (const Candidate& one : candidates) {
      const auto& columns = one.rows.unknowns;
      const Eigen::MatrixXd& r = one.rows.rows;
      const Eigen::MatrixXd part = covariance(columns, columns);
      const Eigen::MatrixXd spread_part = spread(columns, columns);
      Eigen::MatrixXd inner = r * part * r.transpose();
      inner.diagonal().array() += one.variance;
      inner.array() += zero_free;
      const Eigen::MatrixXd outer = r * spread_part * r.transpose();
      result.push_back(numerics::solve_positive(inner, outer).trace());
    }
    return result;
  }

 private:
  static Eigen::MatrixXd inverse(const Eigen::MatrixXd& matrix) {
    return numerics::solve_positive(matrix, Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols()));
  }

  const Machine& machine_;
  Effort effort_;
  double misfit_;
  GeometricBasis basis_;
  Eigen::MatrixXd precision_;  // of the unknowns, prior and lines in use
  Eigen::MatrixXd weight_;
};

bool is_axis(const Machine& machine, const PlannedLine& line) {
  const Eigen::Vector3d along = line.to - line.from;
  if ((along.array().abs() > 1e-9).count() != 1) return false;
  for (int k = 0; k < 3; ++k)
    if (machine.chain.has(k) && line.from[k] > machine.travel[index(k)].lower + 1e-9) return false;
  return true;
}

}  // namespace

std::vector<PlannedLine> search_lines(const Machine& machine, std::vector<PlannedLine> start,
                                      const Effort& effort, const GeometricPrior& prior, double misfit,
                                      const std::function<void(double)>& progress) {
  constexpr int most_sweeps = 6;
  constexpr double enough = 1e-3;  // of the gain: an exchange that brings less is none
  Search search{machine, effort, prior, misfit};
  std::vector<Candidate> chosen;
  for (auto& line : start) {
    chosen.push_back(search.candidate(std::move(line)));
    search.use(chosen.back(), 1.0);
  }
  std::vector<Candidate> candidates;
  for (auto& line : grid_lines(machine)) candidates.push_back(search.candidate(std::move(line)));
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    bool exchanged = false;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      if (progress)
        progress((sweep + static_cast<double>(i) / static_cast<double>(chosen.size())) / most_sweeps);
      if (is_axis(machine, chosen[i].line)) continue;
      search.use(chosen[i], -1.0);
      const auto gains = search.gains(candidates);
      const auto best =
          static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
      if (gains[best] > (1.0 + enough) * search.gains({chosen[i]}).front()) {
        chosen[i] = candidates[best];
        exchanged = true;
      }
      search.use(chosen[i], 1.0);
    }
    if (!exchanged) break;
  }
  std::vector<PlannedLine> result;
  for (auto& one : chosen) {
    // Two lines may move alike from different corners; a file of readings tells lines by their names.
    const std::string name = one.line.name;
    for (int copy = 2;
         std::any_of(result.begin(), result.end(), [&](const auto& r) { return r.name == one.line.name; });
         ++copy)
      one.line.name = name + " (" + std::to_string(copy) + ")";
    result.push_back(std::move(one.line));
  }
  return result;
}

}  // namespace invar::metrology

// The search for the most evident prior, apart because Ceres is slow to compile.
#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>

#include <array>
#include <cmath>

#include "core/metrology/geometric_equations.hpp"

namespace invar::metrology {

namespace {

/// How far the log of a strength may lie from what is expected beforehand: one sigma.
constexpr std::array<double, strength_count> spread{1.5, 1.5, 1.5, 0.5, 0.5, 0.5, 1.5, 1.5, 0.4};

class NegativeLogEvidence final : public ceres::FirstOrderFunction {
 public:
  NegativeLogEvidence(const NormalEquations& equations, const GeometricBasis& basis,
                      const GeometricPrior& expected)
      : equations_{equations}, basis_{basis}, prior_{expected}, expected_{log_strengths(expected)} {}

  bool Evaluate(const double* const logs, double* cost, double* gradient) const override {
    const Strengths here = Eigen::Map<const Strengths>(logs);
    if (!here.allFinite() || (here - expected_).cwiseAbs().maxCoeff() > 8.0) return false;
    const Evidence found = evidence(equations_, basis_, with_log_strengths(prior_, here));
    *cost = -found.value;
    if (!std::isfinite(*cost)) return false;
    for (int i = 0; i < strength_count; ++i) {
      const double sd = spread[static_cast<std::size_t>(i)];
      const double z = (here[i] - expected_[i]) / sd;
      *cost += 0.5 * z * z;
      if (gradient != nullptr) gradient[i] = -found.slope[i] + z / sd;
    }
    return true;
  }
  [[nodiscard]] int NumParameters() const override { return strength_count; }

 private:
  const NormalEquations& equations_;
  const GeometricBasis& basis_;
  const GeometricPrior& prior_;
  const Strengths expected_;
};

}  // namespace

GeometricPrior most_evident(const NormalEquations& equations, const GeometricBasis& basis,
                            const GeometricPrior& expected, const GeometricPrior& start) {
  Strengths logs = log_strengths(start);
  const ceres::GradientProblem problem{new NegativeLogEvidence{equations, basis, expected}};
  ceres::GradientProblemSolver::Options options;
  options.line_search_direction_type = ceres::BFGS;
  options.max_num_iterations = 20;
  options.function_tolerance = 2e-5;  // a tenth of a unit of log evidence matters to nobody
  options.gradient_tolerance = 1e-2;
  options.logging_type = ceres::SILENT;
  ceres::GradientProblemSolver::Summary summary;
  ceres::Solve(options, problem, logs.data(), &summary);
  return with_log_strengths(expected, logs);
}

}  // namespace invar::metrology

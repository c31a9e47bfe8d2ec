// The search for the most evident prior, apart because Ceres is slow to compile.
#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>

#include <algorithm>
#include <cmath>

#include "core/metrology/geometric_equations.hpp"

namespace invar::metrology {

namespace {

constexpr double amplitude_spread = 1.5;  // sd of the log of an amplitude, expected beforehand
constexpr double length_spread = 0.7;

GeometricPrior with(const GeometricPrior& prior, const double* logs) {
  GeometricPrior result = prior;
  for (std::size_t k = 0; k < 3; ++k) {
    result.amplitude[k] = std::exp(logs[k]);
    result.length[k] = std::exp(logs[3 + k]);
  }
  return result;
}

class NegativeLogEvidence final : public ceres::FirstOrderFunction {
 public:
  NegativeLogEvidence(const NormalEquations& equations, const GeometricBasis& basis,
                      const GeometricPrior& expected)
      : equations_{equations}, basis_{basis}, expected_{expected} {}

  bool Evaluate(const double* const logs, double* cost, double* gradient) const override {
    for (int i = 0; i < 6; ++i)
      if (!(std::abs(logs[i]) < 30.0)) return false;
    const Evidence found = evidence(equations_, basis_, with(expected_, logs));
    *cost = -found.value;
    if (!std::isfinite(*cost)) return false;
    for (std::size_t i = 0; i < 6; ++i) {
      const double expected = std::log(i < 3 ? expected_.amplitude[i] : expected_.length[i - 3]);
      const double spread = i < 3 ? amplitude_spread : length_spread;
      const double z = (logs[i] - expected) / spread;
      *cost += 0.5 * z * z;
      if (gradient != nullptr) gradient[i] = -found.slope[static_cast<Eigen::Index>(i)] + z / spread;
    }
    return true;
  }
  [[nodiscard]] int NumParameters() const override { return 6; }

 private:
  const NormalEquations& equations_;
  const GeometricBasis& basis_;
  const GeometricPrior& expected_;
};

}  // namespace

GeometricPrior most_evident(const NormalEquations& equations, const GeometricBasis& basis,
                            const GeometricPrior& expected, const GeometricPrior& start) {
  double logs[6];
  for (std::size_t k = 0; k < 3; ++k) {
    logs[k] = std::log(start.amplitude[k]);
    logs[3 + k] = std::log(start.length[k]);
  }
  const ceres::GradientProblem problem{new NegativeLogEvidence{equations, basis, expected}};
  ceres::GradientProblemSolver::Options options;
  options.line_search_direction_type = ceres::BFGS;
  options.max_num_iterations = 15;
  options.function_tolerance = 2e-5;  // a tenth of a unit of log evidence matters to nobody
  options.gradient_tolerance = 1e-2;
  options.logging_type = ceres::SILENT;
  ceres::GradientProblemSolver::Summary summary;
  ceres::Solve(options, problem, logs, &summary);
  return with(expected, logs);
}

}  // namespace invar::metrology

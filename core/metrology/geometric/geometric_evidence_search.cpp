// The search for the most evident prior.
#include <Eigen/Core>
#include <array>
#include <cmath>

#include "core/metrology/geometric/geometric_equations.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

/// How far the log of a strength may lie from what is expected beforehand: one sigma. Of an axis' stretch as far as it
/// is from half way to either of the two pictures that it stands between (`expected_stretch`).
Strengths spread(const GeometricPrior& expected) {
  Strengths sd;
  sd.head<first_relative>() << 1.5, 1.5, 1.5, 0.5, 0.5, 0.5, 1.5, 1.5, 0.4;
  sd.segment<error_motion_count>(first_relative).setConstant(0.3);
  sd.tail<3>() = log_strengths(expected).tail<3>().cwiseAbs().cwiseMax(0.05);
  return sd;
}

/// Evidence and expectation together.
Evidence score(const NormalEquations& equations, const GeometricBasis& basis, const GeometricPrior& expected,
               const Strengths& logs) {
  Evidence result = evidence(equations, basis, with_log_strengths(expected, logs));
  const Strengths precision = spread(expected).cwiseAbs2().cwiseInverse();
  const Strengths off = logs - log_strengths(expected);
  result.value -= 0.5 * off.dot(precision.cwiseProduct(off));
  result.slope -= precision.cwiseProduct(off);
  result.information.diagonal() += precision;
  return result;
}

}  // namespace

EvidentPrior most_evident(const NormalEquations& equations, const GeometricBasis& basis,
                          const GeometricPrior& expected, const GeometricPrior& start) {
  constexpr double enough = 0.05;       // of log evidence: a smaller gain matters to nobody
  constexpr double longest_step = 1.0;  // of a log strength
  Strengths logs = log_strengths(start);
  Evidence here = score(equations, basis, expected, logs);
  double damping = 0.0;
  for (int evaluation = 0; evaluation < 20; ++evaluation) {
    StrengthMatrix damped = here.information;
    damped.diagonal() *= 1.0 + damping;
    Strengths step = numerics::solve_positive(damped, here.slope);
    if (step.dot(here.slope) < enough) break;  // twice what a quadratic would gain
    step *= std::min(1.0, longest_step / step.cwiseAbs().maxCoeff());
    Evidence there = score(equations, basis, expected, logs + step);
    if (std::isfinite(there.value) && there.value > here.value) {
      logs += step;
      here = std::move(there);
      damping *= 0.2;
    } else {
      damping = std::max(4.0 * damping, 0.5);
    }
  }
  return {with_log_strengths(expected, logs),
          numerics::solve_positive(here.information, StrengthMatrix::Identity())};
}

}  // namespace invar::metrology

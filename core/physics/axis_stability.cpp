#include "core/physics/axis_stability.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>

#include "core/base/contract.hpp"

namespace invar::physics {

double spectral_radius(const AxisControllerSettings& controller, double inertia, double damping) {
  INVAR_EXPECTS(inertia > 0.0 && damping >= 0.0 && controller.rate > 0.0, inertia, damping, controller.rate);
  const double period = 1.0 / controller.rate, decay = damping / inertia, z = decay * period;
  // Position and velocity after a period, from those before and from the current held.
  const double kept = std::exp(-z);
  const double way = z > 1e-6 ? -std::expm1(-z) / decay : period;
  const double pushed = z > 1e-6 ? (period - way) / damping : 0.5 * period * period / inertia;
  const double share = controller.velocity_filter_hz
                           ? -std::expm1(-2.0 * std::numbers::pi * *controller.velocity_filter_hz * period)
                           : 1.0;
  const bool pid = controller.kind == AxisControllerSettings::Kind::pid;
  const bool sums = pid && controller.ki > 0.0;
  // State: position, velocity, reading before, filtered rate, sum of errors; the reference is zero.
  using Vector = Eigen::Matrix<double, 5, 1>;
  Eigen::Matrix<double, 5, 5> transition;
  for (int column = 0; column < 5; ++column) {
    const Vector state = Vector::Unit(column);
    const double rate = state[3] + share * ((state[0] - state[2]) * controller.rate - state[3]);
    const double sum = sums ? state[4] - state[0] : 0.0;
    const double current =
        pid ? -controller.kp * state[0] + controller.ki * sum * period - controller.kd * rate
            : controller.kv * (-controller.kp * state[0] - rate);
    transition.col(column) << state[0] + way * state[1] + pushed * current,
        kept * state[1] + way / inertia * current, state[0], rate, sum;
  }
  return transition.eigenvalues().cwiseAbs().maxCoeff();
}

}  // namespace invar::physics

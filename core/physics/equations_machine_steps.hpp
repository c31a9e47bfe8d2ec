// How an EquationsMachine takes a step: Runge-Kutta's rule, Rosenbrock's where it is stiff, and dry friction with its reversals.
#pragma once

#include <numbers>

#include "core/physics/equations_machine.hpp"

namespace invar::physics {

template <std::size_t lanes>
inline std::array<typename EquationsMachine<lanes>::Matrix, lanes> EquationsMachine<lanes>::jacobian(
    const State& s, double t, double share) {
  const auto n = static_cast<Eigen::Index>(all_states());
  std::array<Matrix, lanes> all;
  for (auto& one : all) one.resize(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    State up = s, down = s;
    const auto at = static_cast<std::size_t>(j);
    Lane by;
    for (std::size_t l = 0; l < lanes; ++l) {
      by[l] = share * std::max(1e-3, std::abs(s[at][l]));
      up[at][l] += by[l], down[at][l] -= by[l];
    }
    const State a = free_slope(up, t), b = free_slope(down, t);
    for (std::size_t l = 0; l < lanes; ++l)
      for (Eigen::Index i = 0; i < n; ++i)
        all[l](i, j) =
            (a[static_cast<std::size_t>(i)][l] - b[static_cast<std::size_t>(i)][l]) / (2.0 * by[l]);
  }
  return all;
}

template <std::size_t lanes>
inline typename EquationsMachine<lanes>::State EquationsMachine<lanes>::eased(const State& s, double t,
                                                                              double h) {
  constexpr double gamma = 1.0 - 0.5 * std::numbers::sqrt2;
  const auto n = static_cast<Eigen::Index>(all_states());
  const auto column = [n](const State& state, std::size_t l) {
    Vector one(n);
    for (Eigen::Index i = 0; i < n; ++i) one(i) = state[static_cast<std::size_t>(i)][l];
    return one;
  };
  const auto rates = jacobian(s, t, 1e-6);
  const Matrix eye = Matrix::Identity(n, n);
  std::array<Eigen::PartialPivLU<Matrix>, lanes> matrix;
  std::array<Vector, lanes> first;
  const State here = slope(s, t);
  State next = s;
  for (std::size_t l = 0; l < lanes; ++l) {
    matrix[l].compute(eye - gamma * h * rates[l]);
    first[l] = matrix[l].solve(column(here, l));
    for (Eigen::Index i = 0; i < n; ++i) next[static_cast<std::size_t>(i)][l] += h * first[l](i);
  }
  const State there = slope(next, t + h);
  next = s;
  for (std::size_t l = 0; l < lanes; ++l) {
    const Vector second = matrix[l].solve(column(there, l) - 2.0 * first[l]);
    for (Eigen::Index i = 0; i < n; ++i)
      next[static_cast<std::size_t>(i)][l] += h * (1.5 * first[l](i) + 0.5 * second(i));
  }
  return next;
}

template <std::size_t lanes>
inline typename EquationsMachine<lanes>::State EquationsMachine<lanes>::moved(const State& s, double t,
                                                                              double h) {
  if (stiff_) return eased(s, t, h);
  const std::size_t n = all_states();
  const auto by = [&](const State& rate, double share) {
    State next;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t l = 0; l < lanes; ++l) next[i][l] = s[i][l] + share * rate[i][l];
    return next;
  };
  const State a = slope(s, t), b = slope(by(a, 0.5 * h), t + 0.5 * h), c = slope(by(b, 0.5 * h), t + 0.5 * h),
              d = slope(by(c, h), t + h);
  note_turn(s, a, b, c, h);
  State next;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t l = 0; l < lanes; ++l)
      next[i][l] = s[i][l] + h / 6.0 * (a[i][l] + 2.0 * (b[i][l] + c[i][l]) + d[i][l]);
  return next;
}

template <std::size_t lanes>
inline void EquationsMachine<lanes>::note_turn(const State& s, const State& a, const State& b, const State& c,
                                               double h) {
  constexpr double trifle =
      1e-6;  // of the largest that a state was: what moves so little may turn as it will
  for (std::size_t l = 0; l < lanes; ++l) {
    double slopes = 0.0, apart = 0.0;
    for (std::size_t i = 0; i < all_states(); ++i) {
      double& size = largest_[i][l];
      size = std::max({size, std::abs(s[i][l]), std::abs(h * a[i][l]), 1e-300});
      slopes += std::pow((c[i][l] - b[i][l]) / size, 2);
      apart += std::pow(0.5 * h * (b[i][l] - a[i][l]) / size, 2);
    }
    if (apart > trifle * trifle && std::isfinite(slopes))
      turned_ = std::max(turned_, h * std::sqrt(slopes / apart));
  }
}

template <std::size_t lanes>
inline void EquationsMachine<lanes>::turn(const State& s, double t) {
  for (auto& rub : frictions_) {
    const double speed = s[rub.use.on][0];
    rub.direction[0] = sign_of(speed);
    rub.stuck[0] = false;
    if (speed != 0.0) continue;
    const double push = slope(s, t)[rub.use.on][0];
    rub.stuck[0] = std::abs(push) <= rub.use.p[0][0];
    rub.direction[0] = rub.stuck[0] ? 0.0 : sign_of(push);
  }
}

template <std::size_t lanes>
inline void EquationsMachine<lanes>::slide(State& s, double t, double h) {
  static_assert(lanes >= 1);
  for (int events = 0; events < 8 && h > 0.0; ++events) {
    turn(s, t);
    State next = moved(s, t, h);
    double taken = h;
    for (auto& rub : frictions_) {
      const std::size_t on = rub.use.on;
      if (rub.stuck[0] || !(next[on][0] * rub.direction[0] < 0.0)) continue;
      if (s[on][0] == 0.0) {  // would slide back at once: it stays
        rub.stuck[0] = true;
        next = moved(s, t, taken);
        continue;
      }
      double low = 0.0, low_speed = s[on][0], high = taken, high_speed = next[on][0];
      for (int i = 0; i < 6 && std::abs(next[on][0]) > 1e-13 * std::abs(s[on][0]); ++i) {  // regula falsi
        taken = low + (high - low) * low_speed / (low_speed - high_speed);
        next = moved(s, t, taken);
        (next[on][0] * rub.direction[0] > 0.0 ? low : high) = taken;
        (next[on][0] * rub.direction[0] > 0.0 ? low_speed : high_speed) = next[on][0];
      }
      next[on][0] = 0.0;
    }
    s = next;
    t += taken;
    h -= taken;
  }
}

}  // namespace invar::physics

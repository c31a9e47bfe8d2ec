// CurveMemory: a curve whose value depends on the course of its variable: hysteresis, or a force that creeps.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "core/physics/curve.hpp"

namespace invar::physics {

/// Its word in a model file and in a report; empty for a curve without memory.
constexpr std::string_view name_of(Curve::Memory memory) {
  switch (memory) {
    case Curve::Memory::stop:
      return "stop";
    case Curve::Memory::relaxation:
      return "relaxation";
    case Curve::Memory::none:
      break;
  }
  return "";
}

/// The state of a curve with memory: one number a knot. Its value is a sum over the knots.
///   stop        weight z / r: an element that bends with the variable by at most r, its knot, then slips. Prandtl's and
///               Ishlinskii's operator; a sum of these is any hysteresis that is symmetric and does not know the rate.
///   relaxation  weight (x - z): a spring whose other end z follows with the time constant of its knot [s] (Maxwell).
/// Real-time. Knots beyond `most` do nothing.
class CurveMemory {
 public:
  static constexpr std::size_t most = 12;

  /// Nothing bent, everything relaxed.
  void start(const Curve& curve, double x) noexcept {
    from_ = x;
    z_.fill(curve.memory == Curve::Memory::relaxation ? x : 0.0);
  }
  /// The variable goes on from here without a way between; what is bent stays bent.
  void go_on_from(double x) noexcept { from_ = x; }
  /// With the variable at x, `since` [s] after the last `advance`; it went straight.
  [[nodiscard]] double value(const Curve& curve, double x, double since) const noexcept {
    double sum = 0.0;
    for (std::size_t k = 0; k < count(curve); ++k)
      sum += curve.memory == Curve::Memory::stop
                 ? curve.values[k] * bent(k, curve.knots[k], x) / curve.knots[k]
                 : curve.values[k] * (x - followed(k, curve.knots[k], x, since));
    return sum;
  }
  void advance(const Curve& curve, double x, double since) noexcept {
    for (std::size_t k = 0; k < count(curve); ++k)
      z_[k] = curve.memory == Curve::Memory::stop ? bent(k, curve.knots[k], x)
                                                  : followed(k, curve.knots[k], x, since);
    from_ = x;
  }
  /// How stiff the curve is at most, in its unit per unit of the variable.
  [[nodiscard]] static double stiffness(const Curve& curve) noexcept {
    double sum = 0.0;
    for (std::size_t k = 0; k < count(curve); ++k)
      sum += std::abs(curve.values[k]) / (curve.memory == Curve::Memory::stop ? curve.knots[k] : 1.0);
    return sum;
  }

 private:
  [[nodiscard]] static std::size_t count(const Curve& curve) noexcept {
    return std::min(most, curve.knots.size());
  }
  [[nodiscard]] double bent(std::size_t k, double limit, double x) const noexcept {
    return std::clamp(z_[k] + x - from_, -limit, limit);
  }
  /// Exact for a variable that goes straight.
  [[nodiscard]] double followed(std::size_t k, double time_constant, double x, double since) const noexcept {
    if (!(since > 0.0)) return z_[k];
    const double behind = (x - from_) / since * time_constant;
    return x - behind + (z_[k] - from_ + behind) * std::exp(-since / time_constant);
  }

  std::array<double, most> z_{};
  double from_ = 0.0;
};

}  // namespace invar::physics

// Curve: what is left when no term has a name for it: a force, heat or length as a table over one variable.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace invar::physics {

/// Linear between its knots (ascending, at least one) and constant outside them; with a `period` it comes again, and its knots
/// lie within one. Evaluation is real-time.
struct Curve {
  /// A curve with memory has its numbers by threshold or by time constant in place of values (`CurveMemory`).
  enum class Memory { none, stop, relaxation };
  std::string over;  // the signal that it goes over: "position", "velocity", "time", ...
  std::vector<double> knots;
  std::vector<double> values;
  double period = 0.0;  // 0: none
  Memory memory = Memory::none;
  double usual =
      0.0;  // how large a value is expected to be, where the curve itself does not tell; 0: it does

  [[nodiscard]] double operator()(double x) const noexcept {
    if (knots.empty()) return 0.0;
    if (period > 0.0) {
      x -= std::floor((x - knots.front()) / period) * period;
      if (x >= knots.back()) {
        const double gap = knots.front() + period - knots.back();
        const double share = gap > 0.0 ? (x - knots.back()) / gap : 0.0;
        return values.back() + share * (values.front() - values.back());
      }
    }
    if (!(x > knots.front())) return values.front();
    if (x >= knots.back()) return values.back();
    // The first knot beyond x; knots at equal steps, as a diagnosis lays them, are met at once or beside.
    const double steps = static_cast<double>(knots.size() - 1);
    auto above =
        1 + std::min(knots.size() - 2,
                     static_cast<std::size_t>((x - knots.front()) / (knots.back() - knots.front()) * steps));
    while (knots[above - 1] > x) --above;
    while (knots[above] <= x) ++above;
    const double share = (x - knots[above - 1]) / (knots[above] - knots[above - 1]);
    return values[above - 1] + share * (values[above] - values[above - 1]);
  }
};

}  // namespace invar::physics

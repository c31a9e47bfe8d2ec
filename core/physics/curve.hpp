// Curve: what is left when no term has a name for it: a force, heat or length as a table over one variable.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

namespace invar::physics {

/// Linear between its knots (ascending, at least one) and constant outside them. Evaluation is real-time.
struct Curve {
  std::string over;  // the signal that it goes over: "position", "velocity", "time", ...
  std::vector<double> knots;
  std::vector<double> values;

  [[nodiscard]] double operator()(double x) const noexcept {
    if (knots.empty()) return 0.0;
    if (!(x > knots.front())) return values.front();
    if (x >= knots.back()) return values.back();
    const auto above =
        static_cast<std::size_t>(std::upper_bound(knots.begin(), knots.end(), x) - knots.begin());
    const double share = (x - knots[above - 1]) / (knots[above] - knots[above - 1]);
    return values[above - 1] + share * (values[above] - values[above - 1]);
  }
};

}  // namespace invar::physics

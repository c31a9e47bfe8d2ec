#include "components/dispenser/pattern.hpp"

#include <cmath>

#include "core/recording/table.hpp"

namespace invar::dispenser {

std::vector<Eigen::Vector2d> targets(const Pattern& pattern) {
  std::vector<Eigen::Vector2d> points;
  if (pattern.kind == "grid") {
    for (std::int64_t row = 0; row < pattern.rows; ++row)
      for (std::int64_t k = 0; k < pattern.columns; ++k) {
        const auto column = row % 2 == 0 ? k : pattern.columns - 1 - k;
        points.emplace_back(pattern.from[0] + pattern.pitch[0] * static_cast<double>(column),
                            pattern.from[1] + pattern.pitch[1] * static_cast<double>(row));
      }
  } else if (pattern.kind == "line") {
    const Eigen::Vector2d from{pattern.from[0], pattern.from[1]};
    const Eigen::Vector2d to{pattern.to[0], pattern.to[1]};
    for (std::int64_t k = 0; k < pattern.droplets; ++k)
      points.push_back(from +
                       (to - from) * (static_cast<double>(k) / static_cast<double>(pattern.droplets - 1)));
  } else {
    const auto table = recording::Table::read(pattern.file);
    const auto x = table.in("target_x", "m");
    const auto y = table.in("target_y", "m");
    if (x.size() > 4096)
      throw InputError{pattern.file.string(), "has more than 4096 droplets", "make several patterns of it"};
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (!std::isfinite(x[i]) || !std::isfinite(y[i]))
        throw InputError{pattern.file.string() + ": row " + std::to_string(i + 1), "a target is missing",
                         "give each droplet both coordinates"};
      points.emplace_back(x[i], y[i]);
    }
  }
  return points;
}

}  // namespace invar::dispenser

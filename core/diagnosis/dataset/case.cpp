#include "core/diagnosis/dataset/case.hpp"

#include <algorithm>
#include <cmath>

namespace invar::diagnosis {

std::optional<Range> covered(const Case& data, std::string_view signal) {
  std::optional<Range> range;
  for (const auto& recording : data.recordings)
    if (const auto* values = recording.inputs.find(signal); values != nullptr)
      for (const double v : *values)
        if (std::isfinite(v))
          range = range ? Range{std::min(range->lower, v), std::max(range->upper, v)} : Range{v, v};
  return range;
}

double longest(const Case& data) {
  double lasts = 0.0;
  for (const auto& recording : data.recordings)
    lasts = std::max(lasts, recording.inputs.time.back() - recording.inputs.time.front());
  return lasts;
}

double highest_power(const Case& data, std::string_view node) {
  double top = 0.0;
  for (const auto& heater : data.model.thermal.heaters)
    if (heater.node == node)
      if (const auto given = covered(data, heater.name)) top = std::max(top, given->upper);
  return top;
}

}  // namespace invar::diagnosis

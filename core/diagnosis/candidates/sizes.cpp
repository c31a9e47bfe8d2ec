#include "core/diagnosis/candidates/sizes.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/dataset/variables.hpp"

namespace invar::diagnosis {

double rms_of(const std::vector<std::vector<double>>& series) {
  double square = 0.0, rows = 0.0;
  for (const auto& one : series)
    for (const double v : one)
      if (std::isfinite(v)) square += v * v, rows += 1.0;
  return rows > 0.0 ? std::sqrt(square / rows) : 0.0;
}

double usual_size(const Case& data, const std::string& signal) {
  std::vector<std::vector<double>> all;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) all.push_back(variable_values(data, r, signal));
  return std::max(1e-9, rms_of(all));
}

double small_current(const Case& data) { return 0.1 * usual_size(data, "current"); }

double small_force(const Case& data, const physics::Model& model) {
  return small_current(data) * model.value("motor_constant", 1.0);
}

bool has_found_friction(const Case& data, const physics::Model& model) {
  return std::any_of(model.terms.begin() + static_cast<std::ptrdiff_t>(data.model.terms.size()),
                     model.terms.end(), [](const physics::Term& term) { return term.info->is_friction; });
}

}  // namespace invar::diagnosis

#include "tools/diagnose/diagnosis.hpp"

#include <array>
#include <cmath>

namespace invar::diagnose {

std::string name_of(Verdict verdict) {
  static const std::array<const char*, 6> names{"no_mismatch",      "parameters_only", "explained",
                                                "partly_explained", "ambiguous",       "unknown_physics"};
  return names[static_cast<std::size_t>(verdict)];
}

void Diagnosis::reject(const std::string& term, const std::string& why, double gain) {
  for (auto& r : rejected)
    if (r.term == term) {
      if (gain > r.gain) r = {term, why, gain};
      return;
    }
  rejected.push_back({term, why, gain});
}

double least_ratio(const Case& data, const Fit& a, const Fit& b) {
  double least = 1.0;
  const auto with_a = simulate(data, a.model), with_b = simulate(data, b.model);
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    double sum_a = 0.0, sum_b = 0.0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r)
      for (std::size_t i = 0; i < with_a[r][o].size(); ++i)
        if (const double y = data.recordings[r].measured[o][i]; std::isfinite(y)) {
          sum_a += std::pow(y - with_a[r][o][i], 2);
          sum_b += std::pow(y - with_b[r][o][i], 2);
        }
    if (sum_b > 0.0) least = std::min(least, std::sqrt(sum_a / sum_b));
  }
  return least;
}

}  // namespace invar::diagnose

#include "core/diagnosis/evidence/diagnosis.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace invar::diagnosis {

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

double most_over_noise(const Diagnosis& d) {
  double most = 0.0;
  for (const auto* rows : {&d.heldout, &d.train})
    for (const auto& row : *rows)
      most = std::max(most, row.noise_floor > 0.0 ? row.after / row.noise_floor : 0.0);
  return most;
}

}  // namespace invar::diagnosis

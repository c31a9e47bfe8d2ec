#include "core/physics/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/contract.hpp"
#include "core/physics/simulate_plants.hpp"

namespace invar::physics {

std::size_t ran_away_at(const std::vector<double>& output) {
  constexpr double all = 1e30;       // more than any machine reads, in whatever unit
  std::size_t from = output.size();  // of what ran away no row comes back
  while (from > 0 && !(std::abs(output[from - 1]) < all)) --from;
  return from;
}

std::vector<double> bridged(const std::vector<double>& time, const std::vector<double>& values) {
  std::vector<double> out = values;
  const std::size_t n = out.size();
  std::size_t last = n;  // the last row that had a value
  for (std::size_t i = 0; i < n; ++i) {
    if (!std::isfinite(values[i])) continue;
    if (last == n)
      for (std::size_t j = 0; j < i; ++j) out[j] = values[i];
    else
      for (std::size_t j = last + 1; j < i; ++j) {
        const double share = (time[j] - time[last]) / (time[i] - time[last]);
        out[j] = values[last] + share * (values[i] - values[last]);
      }
    last = i;
  }
  for (std::size_t j = last == n ? 0 : last + 1; j < n; ++j) out[j] = last == n ? 0.0 : values[last];
  return out;
}

std::vector<Restart> restarts_of(const Model& structure, const Record& inputs) {
  std::vector<Restart> restarts;
  const auto states = states_of(structure);
  const auto& all = structure.parameters;
  for (std::size_t k = 0; k < inputs.restarts.size(); ++k) {
    auto& restart = restarts.emplace_back();
    restart.row = inputs.restarts[k];
    for (const auto& state : states) {
      const auto name = state + ".start" + std::to_string(inputs.first_restart + k);
      const auto at = std::find_if(all.begin(), all.end(), [&](const auto& one) { return one.name == name; });
      INVAR_EXPECTS(at != all.end(), name);
      restart.parameters.push_back(static_cast<std::size_t>(at - all.begin()));
    }
  }
  return restarts;
}

std::unique_ptr<Simulation> prepare(const Model& structure, const Record& inputs) {
  switch (structure.plant) {
    case Plant::axis:
      return prepare_axis(structure, inputs);
    case Plant::thermal:
      return prepare_thermal(structure, inputs);
    case Plant::error_map:
      return prepare_error_map(structure, inputs);
    case Plant::droplet:
      return prepare_droplet(structure, inputs);
    case Plant::sensor:
      return prepare_sensor(structure, inputs);
    case Plant::equations:
      return prepare_equations(structure, inputs);
  }
  INVAR_EXPECTS(false, name_of(structure.plant));
  return nullptr;
}

}  // namespace invar::physics

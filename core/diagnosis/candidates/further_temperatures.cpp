#include "core/diagnosis/candidates/further_temperatures.hpp"

#include "core/physics/temperatures.hpp"

namespace invar::diagnosis {

std::vector<std::string> further_temperatures(const Case& data) {
  std::vector<std::string> names;
  if (data.model.plant != physics::Plant::error_map) return names;
  for (const auto& signal : data.model.signals)
    if (physics::is_temperature(signal.name) && signal.name != "temperature" && covered(data, signal.name))
      names.push_back(signal.name);
  return names;
}

}  // namespace invar::diagnosis

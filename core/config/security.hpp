// The `security` section of a cell file: where the keys are, and which people and programs may do what.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/config/yaml.hpp"

namespace invar::config {

/// A program of the plant that takes part in the cell's domain.
struct PlantProgram {
  std::string name;
  std::vector<std::string> reads, writes;  // connections: "component.port", or "/topic" of the plant
};

struct CellSecurity {
  std::filesystem::path keys;                      // folder
  std::vector<std::string> operators{"operator"};  // may command
  std::vector<std::string> viewers{"viewer"};      // may look
  std::vector<PlantProgram> plant;
};

/// `folder`: from which paths count. Faults are put on the document.
[[nodiscard]] CellSecurity read_security(const Node& node, const std::filesystem::path& folder);

}  // namespace invar::config

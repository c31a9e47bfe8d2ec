// LoadedCell: a cell file with its components made.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/component/cell_folders.hpp"
#include "core/component/registry.hpp"
#include "core/config/cell.hpp"

namespace invar::tools {

struct LoadedComponent {
  const config::CellComponent* file = nullptr;
  Prepared prepared;  // outlives the component
  std::unique_ptr<Component> component;
};

struct LoadedProcess {
  const config::CellProcess* file = nullptr;
  std::vector<LoadedComponent> components;
};

/// The whole cell with its components made (not configured: nothing is opened, nothing moves), every port with its
/// topic and profile.
struct LoadedCell {
  config::Yaml yaml;
  std::unique_ptr<config::Cell> cell;
  std::shared_ptr<Registry> registry;  // keeps plugins loaded
  std::vector<LoadedProcess> processes;
  /// Where a command may name a model to read, and a result to write.
  CellFolders::Places model_places, result_places;

  [[nodiscard]] LoadedProcess* process(const std::string& name);
  [[nodiscard]] std::vector<std::string> process_names() const;
  [[nodiscard]] Port* port(const std::string& component, const std::string& name) const;
};

}  // namespace invar::tools

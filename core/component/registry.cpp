#include "core/component/registry.hpp"

#include "core/base/contract.hpp"

namespace invar {

std::vector<std::string> Registry::names() const {
  std::vector<std::string> names;
  for (const auto& [name, entry] : types_) names.push_back(name);
  return names;
}

const std::string& Registry::description(const std::string& type) const {
  INVAR_EXPECTS(has(type), type);
  return types_.at(type).description;
}

Prepared Registry::prepare(const std::string& type, const config::Node& node,
                           const std::filesystem::path& folder) const {
  INVAR_EXPECTS(has(type), type);
  return types_.at(type).prepare(node, folder);
}

}  // namespace invar

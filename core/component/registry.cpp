#include "core/component/registry.hpp"

#include "core/base/contract.hpp"
#include "core/base/unit.hpp"

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

const std::vector<RegisterInfo>& Registry::registers(const std::string& type) const {
  INVAR_EXPECTS(has(type), type);
  return types_.at(type).registers;
}

Prepared Registry::prepare(const std::string& type, const config::Node& node,
                           const std::filesystem::path& folder) const {
  INVAR_EXPECTS(has(type), type);
  const Entry& entry = types_.at(type);
  for (const ParameterInfo& info : entry.infos())
    if (!parse_unit(info.unit)) {
      node["type"].fault("the component type `" + type + "` is faulty: it describes `" + info.path +
                             "` in `" + info.unit + "`, which is no unit",
                         "mend the unit in its `describe`, and build its plugin again");
      node.accept_all();
      return {};
    }
  return entry.prepare(node, folder);
}

}  // namespace invar

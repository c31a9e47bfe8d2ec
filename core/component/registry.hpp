// Registry: component types by name. An explicit list, never filled by static constructors.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"

namespace invar {

/// Parameters that were read and checked, and how to make the component that refers to them.
struct Prepared {
  std::shared_ptr<void> parameters;  // must outlive the component
  std::vector<ParameterInfo> infos;  // with handles into `parameters`
  ParameterCheck check;
  std::function<std::unique_ptr<Component>()> make;
};

class Registry {
 public:
  /// `Type` has a described `Type::Parameters` and a constructor from `const Parameters&` without side
  /// effects: devices and files are opened in `configure`, so that `invar check` can make a component to look
  /// at its ports.
  template <class Type>
  void add(const std::string& name, const std::string& description) {
    types_[name] = {description,
                    [](const config::Node& node, const std::filesystem::path& folder) {
                      auto parameters = std::make_shared<typename Type::Parameters>();
                      ParameterReader reader{node, folder};
                      parameters->describe(reader);
                      Prepared prepared;
                      ParameterLister lister{prepared.infos};
                      parameters->describe(lister);
                      prepared.check = [read = *parameters](std::span<const double> numbers) {
                        return objection_to(read, numbers);
                      };
                      prepared.make = [parameters] { return std::make_unique<Type>(*parameters); };
                      prepared.parameters = parameters;
                      return prepared;
                    },
                    [] {
                      std::vector<ParameterInfo> infos;
                      ParameterLister lister{infos};
                      typename Type::Parameters parameters;
                      parameters.describe(lister);
                      for (ParameterInfo& info : infos) info.number = nullptr;
                      return infos;
                    }};
  }

  [[nodiscard]] bool has(const std::string& type) const { return types_.contains(type); }
  [[nodiscard]] std::vector<std::string> names() const;
  [[nodiscard]] const std::string& description(const std::string& type) const;
  /// Reads the parameters from `node`; faults go to its document, so make the component only when there are
  /// none. A type that describes a parameter in what is no unit is a fault of its own, and nothing is prepared.
  /// Relative paths count from `folder`. Precondition: has(type).
  [[nodiscard]] Prepared prepare(const std::string& type, const config::Node& node,
                                 const std::filesystem::path& folder) const;

 private:
  struct Entry {
    std::string description;
    std::function<Prepared(const config::Node&, const std::filesystem::path&)> prepare;
    std::function<std::vector<ParameterInfo>()> infos;  // of the defaults
  };
  std::map<std::string, Entry> types_;
};

}  // namespace invar

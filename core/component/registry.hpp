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

/// One row of the contract of a component with its device's register map, as text.
struct RegisterInfo {
  std::string name, unit, access, need, description;
};

class Registry {
 public:
  /// `Type` has a described `Type::Parameters` and a constructor from `const Parameters&` without side effects. Devices and
  /// files are opened in `configure`, so that `invar check` can make a component and look at its ports.
  /// A `Type` that keeps or plays a Modbus device declares its registers: `static ... registers()`.
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
                    },
                    registers_of<Type>()};
  }

  [[nodiscard]] bool has(const std::string& type) const { return types_.contains(type); }
  [[nodiscard]] std::vector<std::string> names() const;
  [[nodiscard]] const std::string& description(const std::string& type) const;
  /// Registers that its map must and may hold; empty for a type that has no device.
  [[nodiscard]] const std::vector<RegisterInfo>& registers(const std::string& type) const;
  /// Reads the parameters from `node`; faults go to its document, so make the component only when there are
  /// none. A type that describes a parameter in what is no unit is a fault of its own, and nothing is prepared.
  /// Relative paths count from `folder`. Precondition: has(type).
  [[nodiscard]] Prepared prepare(const std::string& type, const config::Node& node,
                                 const std::filesystem::path& folder) const;

 private:
  template <class Type>
  static std::vector<RegisterInfo> registers_of() {
    std::vector<RegisterInfo> infos;
    if constexpr (requires { Type::registers(); })
      for (const auto& row : Type::registers())
        infos.push_back({row.name, row.unit, row.access_word(), row.need_word(), row.description});
    return infos;
  }
  struct Entry {
    std::string description;
    std::function<Prepared(const config::Node&, const std::filesystem::path&)> prepare;
    std::function<std::vector<ParameterInfo>()> infos;  // of the defaults
    std::vector<RegisterInfo> registers;
  };
  std::map<std::string, Entry> types_;
};

}  // namespace invar

// Registers that a component needs of its device, declared once as a table. `invar check`, `invar types` and the component
// itself follow from it.
#pragma once

#include <string>
#include <vector>

#include "core/base/fault.hpp"
#include "core/base/range.hpp"
#include "core/modbus/map.hpp"

namespace invar::modbus {

/// A register that a component works with.
struct RegisterNeed {
  enum class Access { read, write };
  enum class Need { needed, optional, either };  // either: one of the rows that follow each other is needed
  std::string name;
  std::string
      unit;  // any unit that measures the same, "W or %": or the same as the other; "flag": a bool, or a number that is 0 or not
  Access access = Access::read;
  Need need = Need::optional;
  std::string description;

  [[nodiscard]] std::string access_word() const { return access == Access::read ? "read" : "written"; }
  [[nodiscard]] std::string need_word() const;
  /// Whether a register in this unit measures it.
  [[nodiscard]] bool takes_unit(const std::string& other) const;
};
using RegisterContract = std::vector<RegisterNeed>;

/// Collects everything in which a map does not suit a component, so that all of it is told at once.
class MapCheck {
 public:
  /// `key`: the parameter that names the map; `device`: what the map should be of, in words.
  MapCheck(const RegisterMap& map, std::string key, std::string device)
      : map_{map}, key_{std::move(key)}, device_{std::move(device)} {}

  /// Registers that are missing, measure something else, or cannot be read or written.
  void fits(const RegisterContract& contract);
  /// A register, where there is one, that does not take all `values` [SI] which the parameter `key` lets the component write.
  void takes(const std::string& reg, Range values, const std::string& key);
  /// None of the registers is set to 0 at comm loss: the device would go on when its master is dead.
  void lets_go(const std::vector<std::string>& registers);
  void fault(const std::string& key, const std::string& what, const std::string& mend);
  /// Throws InputError with all of it; everything that is missing stands in one fault.
  void finish();

 private:
  [[nodiscard]] bool suits(const RegisterNeed& need);

  const RegisterMap& map_;
  std::string key_, device_;
  std::string missing_;
  std::vector<Fault> faults_;
};

}  // namespace invar::modbus

// Units of the user's own formulas: whether numbers that are added or compared count in one unit.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/unit.hpp"

namespace invar::physics {

/// The unit that a name of a formula counts in.
struct NamedUnit {
  std::string text;  // as a user knows it
  Unit unit;
};
/// By name; one without a unit may count in any.
using UnitsOfNames = std::map<std::string, NamedUnit, std::less<>>;

/// Parts of a formula whose units do not go together.
struct UnitClash {
  std::string what;      // a clause
  bool is_size = false;  // one kind of quantity, counted in units of two sizes; false: two kinds
};

/// The first clash of a formula.
/// The rule is that of dimensional analysis with the units' sizes carried along (ISO 80000-1, 5). Values that are added, compared
/// or chosen between count in one unit, an angle in rad, an exponent and an argument of exp and log in none. So a set of units that is not SI
/// but goes together (cm, mL/s and cm2) is as good. A number that stands in a formula may have any unit, and with it all that it is
/// multiplied by. Offsets (K and degC) are not looked at, nor are rad and counts told from pure numbers.
/// `result`: the unit that the formula's value counts in; none: any. Throws InputError where the formula is none.
std::optional<UnitClash> clash_of_units(const std::string& formula, const UnitsOfNames& units,
                                        const std::vector<std::string>& names,
                                        const std::optional<NamedUnit>& result);

}  // namespace invar::physics

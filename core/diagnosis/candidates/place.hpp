// Place: where a term acts and what it goes with, in words and units.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// "axis.force"; of a term in equations "equations.x1".
std::string site_of(const Case& data, const physics::Term& term);
/// The signals on which a term, or a finding, depends.
std::vector<std::string> dependence(const Case& data, const physics::Term& term);
/// The output and the column by which a variable of own equations is recorded, where they have names of their own.
std::vector<std::string> recorded_as(const Case& data, const std::string& variable);
/// "coulomb friction"
std::string readable(std::string_view name);
/// Where a term acts, for somebody who does not know the library: "temperature sensor of pad".
std::string place_of(const Case& data, const physics::Term& term);
/// A term's name, with its place where `other` is of the same name elsewhere.
std::string name_beside(const Case& data, const physics::Term& term, const physics::Term& other);
/// The unit of a term's parameter, by the place it acts on where the library leaves it open.
std::string unit_of(const Case& data, const physics::Term& term, std::size_t parameter);
/// The units, SI, of what an effect without a name adds at its place, and of what it goes with; empty where not known.
std::string unit_of_curve(const Case& data, const physics::Term& term);
/// The unit of a signal or of a variable that the plant has; empty where not known.
std::string unit_of_variable(const Case& data, const std::string& variable);
/// Is a curve multiplied by a signal? The other node of an exchange of heat is a place.
bool is_multiplied(const physics::Term& term);

}  // namespace invar::diagnosis

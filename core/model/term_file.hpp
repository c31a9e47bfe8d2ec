// Terms in model.yaml: what an entry of `terms` says, where it may act, and how it is written.
#pragma once

#include <yaml-cpp/yaml.h>

#include <optional>
#include <string>

#include "core/config/yaml.hpp"
#include "core/physics/model.hpp"

namespace invar::model {

/// An entry of `terms`; nothing where it is at fault, which the node is told. Precondition: all of the model but its terms is
/// read.
std::optional<physics::Term> read_term(const config::Node& node, const physics::Model& model);
/// The term as an entry of `terms`.
YAML::Node term_yaml(const physics::Term& term, const physics::Model& model);

/// A number in a unit that is not checked: {value, unit, sigma}, or the value alone.
config::Quantity free_quantity(const config::Node& node, Range bounds);
/// {value, unit, sigma}, as `free_quantity` reads it.
YAML::Node quantity_yaml(double value, const std::string& unit, std::optional<double> sigma);

}  // namespace invar::model

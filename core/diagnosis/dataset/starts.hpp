// Initial states as parameters of a model: told by their names, "<state>.initial" and "<state>.start<k>".
#pragma once

#include "core/physics/model.hpp"

namespace invar::diagnosis {

/// Is it a state at the beginning of a window?
inline bool is_start(const physics::Parameter& parameter) {
  return parameter.name.find(".start") != std::string::npos;
}

/// Is it a state at the beginning of a window or of the recording?
inline bool is_initial(const physics::Parameter& parameter) {
  return is_start(parameter) || parameter.name.ends_with(".initial");
}

}  // namespace invar::diagnosis

// A model file to begin with, for each plant.
#pragma once

#include <string>

#include "core/physics/term.hpp"

namespace invar::diagnosis {

/// model.yaml of a made-up machine, with what each line means and, as comments, the terms that may stand under `terms`.
std::string example_model(physics::Plant plant);

}  // namespace invar::diagnosis

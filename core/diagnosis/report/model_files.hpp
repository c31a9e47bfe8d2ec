// The models that a diagnosis hands over: retuned.yaml, with the user's own numbers refitted, and patched.yaml.
#pragma once

#include <string>

#include "core/config/yaml.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

struct ModelFiles {
  std::string retuned, patched;  // YAML, each with a first line that says what it is
};

/// `given` is model.yaml as it was read, `model` the same, `name` its file's name. Without the curves of one recording that are
/// worse on another one.
ModelFiles model_files(const config::Yaml& given, const physics::Model& model, const std::string& name,
                       const Case& data, const Diagnosis& diagnosis);

}  // namespace invar::diagnosis

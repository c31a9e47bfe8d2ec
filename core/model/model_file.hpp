// model.yaml in and out: a checked physics::Model from YAML, and the patched YAML of a model whose numbers
// changed.
#pragma once

#include <filesystem>
#include <string>

#include "core/config/yaml.hpp"
#include "core/physics/model.hpp"

namespace invar::model {

/// Reads `invar_model: 1`. Throws InputError with every fault (file:line: key: what; mend). Set-up only.
physics::Model load(const std::filesystem::path& file);
/// The same from YAML that is open already; faults are put on its list, `finish` is the caller's.
physics::Model read(const config::Yaml& yaml);

/// The text of the file with the numbers of `changed`: parameters that differ from the file's and all its
/// terms. All other text stays as it is. A parameter's sigma is replaced where its value is.
std::string patched(const config::Yaml& original, const physics::Model& changed);

}  // namespace invar::model

// The temperatures of an error map beside `temperature`, each of which an effect may go with.
#pragma once

#include <string>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// The temperatures of an error map beside `temperature` that were recorded.
std::vector<std::string> further_temperatures(const Case& data);

}  // namespace invar::diagnosis

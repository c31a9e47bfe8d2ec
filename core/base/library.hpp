// Libraries of this program that only part of its work needs, loaded when that work begins.
#pragma once

#include <string>

namespace invar {

/// The function `entry` of ../lib/invar/lib<name>.so, counted from the folder of the running program. The library stays loaded.
/// Throws InputError where it is missing or does not fit. Set-up only.
void* library_entry(const std::string& name, const char* entry);

}  // namespace invar

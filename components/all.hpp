// The explicit list of the component types that come with Invar.
#pragma once

#include "core/component/registry.hpp"

namespace invar {

void add_all_components(Registry& registry);

}  // namespace invar

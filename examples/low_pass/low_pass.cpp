// The library: makes LowPass known by the name that a cell file uses.
#include "low_pass.hpp"

#include "core/component/plugin.hpp"

INVAR_PLUGIN(registry) { registry.add<LowPass>("low_pass", "first-order low-pass of a position"); }

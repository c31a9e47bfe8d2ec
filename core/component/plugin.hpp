// INVAR_PLUGIN: the one entry function of a shared library with component types.
#pragma once

#include "core/component/registry.hpp"

/// INVAR_PLUGIN(registry) { registry.add<LowPass>("low_pass", "first-order low-pass"); }
#define INVAR_PLUGIN(registry) \
  extern "C" __attribute__((visibility("default"))) void invar_add_components(::invar::Registry& registry)

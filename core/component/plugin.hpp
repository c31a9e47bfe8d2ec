// INVAR_PLUGIN: the one entry function of a shared library with component types, and the stamp of what it was built against.
#pragma once

#include "core/component/abi.hpp"
#include "core/component/registry.hpp"

#define INVAR_TEXT_OF(x) #x
#define INVAR_TEXT(x) INVAR_TEXT_OF(x)
#if defined(_GLIBCXX_DEBUG)
#define INVAR_DEBUG_CONTAINERS 1
#else
#define INVAR_DEBUG_CONTAINERS 0
#endif

/// Lies in a section of its own, which the program reads from the file before it loads the library. Code of a library
/// that was built against other headers never runs. `key=value` pairs, in this order.
#define INVAR_PLUGIN_STAMP                                                  \
  "invar=" INVAR_ABI_VERSION " headers=" INVAR_ABI_HEADERS                  \
  " compiler-abi=" INVAR_TEXT(__GXX_ABI_VERSION) " string-abi=" INVAR_TEXT( \
      _GLIBCXX_USE_CXX11_ABI) " debug-containers=" INVAR_TEXT(INVAR_DEBUG_CONTAINERS)

/// INVAR_PLUGIN(registry) { registry.add<LowPass>("low_pass", "first-order low-pass"); }
#define INVAR_PLUGIN(registry)                                                                          \
  extern "C" {                                                                                          \
  extern __attribute__((visibility("default"))) const char invar_plugin_stamp[];                        \
  __attribute__((used, section(".invar.plugin"))) const char invar_plugin_stamp[] = INVAR_PLUGIN_STAMP; \
  __attribute__((visibility("default"))) void invar_add_components(::invar::Registry& registry);        \
  }                                                                                                     \
  extern "C" void invar_add_components(::invar::Registry& registry)

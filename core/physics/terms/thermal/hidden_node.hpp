// Hidden node: a second heat store behind a contact.
// Equation: P = conductance (T2 - T), capacity dT2/dt = conductance (T - T2), T2(0) = T(0)
#pragma once

#include <cmath>

#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct HiddenNode {
  static constexpr TermInfo info{
      .name = "hidden_node",
      .plant = Plant::thermal,
      .site = "storage",
      .depends_on = {"history", "temperature", "power", "frequency"},
      .parameters =
          {{{"conductance", "W/K", {0.0, 1e4}, Role::amplitude, {0.3}, "conductance of the contact"},
            {"capacity",
             "J/K",
             {0.05, 1e8},
             Role::shape,
             {1000.0, 200.0, 5000.0, 30.0},
             "heat capacity of the hidden store"}}},
      .description =
          "A part behind a contact takes up heat while the node warms and gives it back later; nobody "
          "measures it.",
      .source = "lumped network: C2 dT2/dt = conductance (T - T2); in balance at the start",
      .lateness = Lateness::store,
      .in_proportion = {"capacity"}};  // it fills as fast as before
  static constexpr ThermalTermKind kind{.info = &info, .memory = ThermalMemory::hidden_node};
};

}  // namespace invar::physics

// Node coupling: heat flows through a contact between two nodes.
// Equation: P = conductance (T_other - T), and -P at the other node
#pragma once

#include <cmath>

#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct NodeCoupling {
  static constexpr TermInfo info{
      .name = "node_coupling",
      .plant = Plant::thermal,
      .site = "exchange",
      .depends_on = {"temperature"},
      .parameters =
          {{{"conductance", "W/K", {0.0, 1e4}, Role::amplitude, {0.1}, "heat per temperature difference"}}},
      .description =
          "Two parts touch, or see each other, and exchange heat in proportion to their difference.",
      .source = "Fourier: P = conductance (T_other - T)"};
  static double heat(const ThermalPoint& at, const double* p) {
    return p[0] * (at.other_temperature - at.temperature);
  }
  static constexpr ThermalTermKind kind{.info = &info, .heat = heat, .couples = true};
};

}  // namespace invar::physics

// TermInfo: what a physics term is called, where it acts, which numbers it takes and where it comes from.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string_view>

#include "core/base/range.hpp"

namespace invar::physics {

enum class Plant { axis, thermal, error_map, droplet, sensor, equations };

/// "axis", "thermal", ... as model.yaml writes it.
std::string_view name_of(Plant plant);

/// What a parameter does to its term.
enum class Role {
  amplitude,  // the term vanishes where all its amplitudes are zero
  shape,      // where, how fast, how often; means nothing while the amplitude is zero
  phase,      // a shape that wraps at 2 pi
  reference,  // a point that the data choose (a mean pressure); written down, not fitted
};

/// No more parameters than this in a term that has a fixed number of them.
inline constexpr std::size_t most_parameters = 6;

struct ParameterInfo {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();

  std::string_view name;
  std::string_view unit;
  Range bounds;  // physically possible values: a fit that needs another one is no finding
  Role role = Role::amplitude;
  /// Values from which a fit begins, NaN at the end; the first is also the value of a shape that a model
  /// leaves out. For an amplitude the first is a small but visible size.
  std::array<double, 4> starts{none, none, none, none};
  std::string_view description;
};

struct TermInfo {
  std::string_view name;
  Plant plant = Plant::axis;
  std::string_view site;  // "force"; with the plant's name in front in reports
  /// The signals on which the effect depends, as reports name them; empty places at the end.
  std::array<std::string_view, 4> depends_on{};
  std::array<ParameterInfo, most_parameters> parameters{};  // unnamed ones at the end
  std::string_view description;         // what happens in the machine, in a sentence or two
  std::string_view source;              // equation, textbook, standard
  bool is_friction = false;             // a law of dry friction: sliding or springing first
  bool sticks_and_slips = is_friction;  // holds a carriage, a reading or a current still until it slips

  [[nodiscard]] constexpr std::size_t parameter_count() const {
    std::size_t n = 0;
    while (n < most_parameters && !parameters[n].name.empty()) ++n;
    return n;
  }
  /// The place of a parameter by name; `most_parameters` where there is none of it.
  [[nodiscard]] constexpr std::size_t index_of(std::string_view parameter) const {
    std::size_t i = 0;
    while (i < most_parameters && parameters[i].name != parameter) ++i;
    return i;
  }
};

}  // namespace invar::physics

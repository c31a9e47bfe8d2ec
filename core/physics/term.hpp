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

/// Role of a parameter in its term.
enum class Role {
  amplitude,  // the term vanishes where all its amplitudes are zero
  shape,      // where, how fast, how often; means nothing while the amplitude is zero
  phase,      // a shape that wraps at 2 pi
  reference,  // a point that the data choose (a mean pressure); written down, not fitted
};

/// No more parameters than this in a term that has a fixed number of them.
inline constexpr std::size_t most_parameters = 6;
inline constexpr std::size_t no_parameter = most_parameters;  // in place of the index of one

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

/// How a signal of a machine that is simulated in time comes late. Maps and rows that stand alone have none.
enum class Lateness {
  none,
  delay,  // keeps its shape
  lag,    // is rounded
  store,  // a part of it is taken up and given back later
};

/// Which part of a signal does not pass.
enum class Cut { nothing, beyond_a_limit, around_zero };

/// At which instruments an error can occur.
enum class Instrument {
  any,
  counting,  // counts lines along its way: an encoder
  analogue,  // gives a voltage in proportion
};

/// A shape that goes with the first amplitude, so that a weaker effect is the same in time or along the way.
struct Proportion {
  std::string_view parameter{};
  double most = std::numeric_limits<double>::infinity();  // times its value: it grows no further
};

/// Another term with which one recording may confuse this term, and the experiment that tells the two apart.
struct ToldApart {
  std::string_view from{};
  const char* experiment = nullptr;
};

/// `description` to `source` are words for the reader; the members behind them are what diagnosis asks of a term. A member that
/// is left out says that the term does not have that property.
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
  bool springs_first = false;           // a friction that bends before it slides
  bool falls_with_speed = false;        // a friction that is larger at rest than at speed
  bool is_spring = false;               // pulls towards a place
  bool is_steady = false;               // goes with nothing
  bool is_curve = false;                // a free curve in place of a law: an effect without a name
  int power = 0;                        // of its variable, where it is a power of that alone
  Lateness lateness = Lateness::none;
  Cut cut = Cut::nothing;
  Instrument instrument = Instrument::any;
  std::string_view needs{};         // the input without which it cannot show
  std::string_view needs_varied{};  // the input that must take several values
  std::string_view stands_for{};    // the parameter of a model that says the same: not both at once
  std::string_view acts_in{};       // the parameter of a model, or the term for it, through which it acts
  std::string_view joined_by{};     // "linear in x": between the name of a law and its variable
  Proportion in_proportion{};
  std::array<ToldApart, 3> told_apart{};

  [[nodiscard]] constexpr std::size_t parameter_count() const {
    std::size_t n = 0;
    while (n < most_parameters && !parameters[n].name.empty()) ++n;
    return n;
  }
  /// The place of a parameter by name; `no_parameter` where there is none of it.
  [[nodiscard]] constexpr std::size_t index_of(std::string_view parameter) const {
    std::size_t i = parameter.empty() ? most_parameters : 0;
    while (i < most_parameters && parameters[i].name != parameter) ++i;
    return i;
  }
  [[nodiscard]] constexpr bool has(std::string_view parameter) const {
    return index_of(parameter) < most_parameters;
  }
  /// A sine, in time or along a way.
  [[nodiscard]] constexpr bool is_wave() const { return has("phase"); }
  [[nodiscard]] constexpr bool is_wave_in_time() const { return is_wave() && has("frequency"); }
};

}  // namespace invar::physics

// Case: the model that the user believes and the recordings of the machine, ready to be compared.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/diagnosis/dataset/remembered.hpp"
#include "core/physics/simulation.hpp"

namespace invar::diagnosis {

inline constexpr double no_reading = std::numeric_limits<double>::quiet_NaN();

struct DataCount {
  std::size_t rows = 0, used = 0, missing = 0, outliers = 0, duplicates = 0, out_of_order = 0, gaps = 0;
  std::size_t lone_inputs = 0;     // numbers of inputs that the machine did not feel
  std::size_t shortened = 0;       // rows of long recordings that are not run through
  std::size_t left_to_chance = 0;  // rows in which noise decides when a carriage sticks and slips
  std::size_t before_standstill = 0, behind_rest = 0;  // rows of a cell's recording that were not taken
};

/// One recording, ready to be simulated and compared.
struct Recording {
  std::string name;
  physics::Record inputs;                     // and, where the first rows say so, the initial state
  std::vector<std::vector<double>> measured;  // by output, SI; NaN where nothing is to be compared
  std::shared_ptr<const physics::Simulation> simulation;
};

/// Thrown where a simulation is asked for after a stop was requested.
struct Stopped {};

/// Does a step; nothing where a stop was requested before its end.
template <class Step>
auto unless_stopped(const std::stop_token& stop, Step step) -> std::optional<decltype(step())> {
  if (stop.stop_requested()) return std::nullopt;
  try {
    return step();
  } catch (const Stopped&) {
    return std::nullopt;
  }
}

/// A column in a unit that is none of SI's, beside equations that do not say which they count it in.
struct TakenInSi {
  std::string signal, column, unit;  // of the header
  double factor = 1.0, offset = 0.0;
};

/// The knowledge of the machine that a diagnosis works with.
struct Case {
  physics::Model model;  // as the user believes
  std::vector<Recording> recordings;
  std::vector<std::string> outputs;  // signals
  std::vector<double> given_noise;   // by output, SI; NaN where the model gives none
  double resolution = 0.0;  // of an encoder, SI, as the user believes; the model itself does not round
  DataCount count;
  std::vector<TakenInSi> taken_in_si;  // columns of the user's own equations
  std::vector<std::string> doubts;     // what does not go together in the recordings, a clause each
  std::vector<std::size_t> moved;      // outputs that came too early and stand where they belong now
  struct Windows {
    std::size_t count = 0;  // 0: each recording is simulated from its first row to its last
    double length = 0.0;    // of one, in the unit of time
    bool grows = false;     // a disturbance of the model grows; false: it stays
    bool are_long = false;  // as long as the model stays near, for what is slow
    std::size_t anew = 0;   // beginnings at states of their own for other reasons: gaps, further recordings
    std::size_t forgetting = 0;  // rows behind gaps that are not compared
  };
  Windows windows;
  std::optional<physics::Term>
      beside_law;               // what is added to the current or changed in it, as the recorded one shows
  std::size_t quiet_rows = 0;   // over which inputs were replaced by their running median; 0: as recorded
  double left_of_inputs = 0.0;  // log likelihood that what noise is left on these inputs may yield
  bool is_time_series = true;   // rows follow one another; false for droplets
  std::stop_token stop;         // looked at before each simulation
  std::shared_ptr<Remembered> remembered = std::make_shared<Remembered>();
};

/// From where to where a signal goes in the recordings; nothing where none has a number of it.
std::optional<Range> covered(const Case& data, std::string_view signal);
/// [s] How long the longest recording lasts.
double longest(const Case& data);
/// [W] The most that a heater of this node was given; 0 where there is none.
double highest_power(const Case& data, std::string_view node);

}  // namespace invar::diagnosis

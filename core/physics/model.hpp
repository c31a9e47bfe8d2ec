// Model: what model.yaml says, in memory: a plant, its parameters with their uncertainty, and the terms added
// to it.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/range.hpp"
#include "core/physics/axis_controller.hpp"
#include "core/physics/axis_plant.hpp"
#include "core/physics/curve.hpp"
#include "core/physics/term.hpp"
#include "core/physics/thermal_plant.hpp"

namespace invar::physics {

/// A number that the user believes. sigma absent: nothing is known beyond the value; 0: known exactly.
struct Parameter {
  std::string name;  // "mass", "slide.loss", "pad.gain", "slide-base.conductance"
  std::string unit;  // SI
  double value = 0.0;
  std::optional<double> sigma;
  Range bounds;
  double usual = 0.0;  // size of one of which nothing is known but 0; 0: not looked for
};

/// A term in a model.
struct Term {
  const TermInfo* info = nullptr;
  std::array<double, most_parameters> values{};
  std::array<std::optional<double>, most_parameters> sigmas{};
  std::array<bool, most_parameters> given{};    // written in the file; the others stand at their defaults
  std::array<double, most_parameters> usual{};  // as of a Parameter
  std::string on;                               // thermal: the node; equations: the state, input or output
  /// Thermal coupling: the other node; equations: the symbol that it couples to; a curve: the signal that multiplies it
  /// (`multipliers_of`). The curve of a force is dry friction with "direction", damping with "velocity", mass with "acceleration";
  /// that of an actuator is a current [A] added to the command with "command".
  std::string with;
  Curve curve;  // `unmodelled` alone
};

/// One signal of the plant and the column that records it.
struct Signal {
  std::string name;
  std::string column;
  std::string unit;  // SI
  bool is_output = false;
};

struct ThermalLayout {
  struct Heater {
    std::string name, node;
  };
  std::vector<std::string> nodes;
  std::vector<Heater> heaters;
  std::vector<std::pair<std::string, std::string>> couplings;
};

/// Last calibration of an error map: a natural cubic spline through these points.
struct Baseline {
  std::vector<double> positions, errors;
  std::string axis;                  // of the cell: "x"; empty: the file does not say
  std::optional<Range> temperature;  // [degC] that the recordings of the terms covered
};

/// A model written down as expressions.
struct Equations {
  struct State {
    std::string name, derivative;
  };
  struct Input {
    std::string symbol, signal;
    bool linear = false;  // hold: linear
  };
  struct Output {
    std::string name, expression;
    Range limits;
  };
  std::vector<State> states;
  std::vector<Input> inputs;
  std::vector<Output> outputs;
  std::string controlled_input;  // empty: no controller
  std::string control_law;
};

struct Model {
  Plant plant = Plant::axis;
  std::vector<Signal> signals;
  std::optional<double> row_rate;  // [Hz] of the rows of a recording that has no column of time
  std::vector<Parameter> parameters;
  std::vector<Term> terms;
  std::map<std::string, double, std::less<>> noise;  // 1 sigma by signal, SI
  std::optional<AxisControllerSettings> controller;
  /// Where not every cycle of the controller has its row: whether the reference goes smoothly on between two rows or is held
  /// from one to the next. Nothing: not said, and held.
  std::optional<bool> reference_goes_on;
  /// In a loop: is `current` recorded behind what acts between controller and motor? false: the controller's command.
  bool records_applied = false;
  ThermalLayout thermal;
  Baseline baseline;
  Equations equations;

  [[nodiscard]] const Parameter* find(std::string_view name) const;
  /// Its value; `otherwise` where the model has no such parameter.
  [[nodiscard]] double value(std::string_view name, double otherwise = 0.0) const;
  [[nodiscard]] const Signal* signal(std::string_view name) const;
  [[nodiscard]] std::vector<std::string> outputs() const;
};

/// States from which a run of the model may restart: the states of own equations; position [m] and velocity [m/s] of an axis
/// without controller. Empty for all others.
std::vector<std::string> states_of(const Model& model);

/// The model less its term at `place`. Precondition: it has that many.
Model without_term(Model model, std::size_t place);

/// A plant object of the model's present numbers. Preconditions: the model is of that plant.
AxisPlant make_axis(const Model& model, double longest_step = 1e-3);
ThermalPlant make_thermal(const Model& model);

}  // namespace invar::physics

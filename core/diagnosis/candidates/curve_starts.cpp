// Curves over the signals of each plant, for what no name describes.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <span>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/candidates/equation_candidates.hpp"
#include "core/diagnosis/candidates/further_temperatures.hpp"
#include "core/diagnosis/candidates/jump.hpp"
#include "core/diagnosis/candidates/sizes.hpp"
#include "core/diagnosis/candidates/wave.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/physics/library.hpp"
#include "core/physics/temperatures.hpp"

namespace invar::diagnosis {

namespace {

using physics::Plant;
using physics::Term;

/// How much force the motor of an axis gives beyond what the model asks for [N]; without controller a hundredth of all.
double missing_force(const Case& data, const Fit& fitted) {
  const auto simulated = simulate(data, fitted.model);
  std::vector<std::vector<double>> all;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    auto& left = all.emplace_back(variable_values(data, r, "current"));
    for (std::size_t o = 0; o < data.outputs.size(); ++o)
      if (data.outputs[o] == "current") {
        left = data.recordings[r].measured[o];
        for (std::size_t i = 0; i < left.size(); ++i) left[i] -= simulated[r][o][i];
      }
  }
  const double share = data.model.controller ? 1.0 : 0.01;
  return std::max(1e-9, share * fitted.model.value("motor_constant", 1.0) * rms_of(all));
}

/// Between which values a signal goes, without its rarest; the same twice where nothing is known of it.
std::pair<double, double> span_of(const Case& data, const std::string& name, const std::string& node) {
  std::vector<double> all;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto values = variable_values(data, r, name, node);
    all.insert(all.end(), values.begin(), values.end());
  }
  if (all.empty()) return {0.0, 0.0};
  std::sort(all.begin(), all.end());
  return {all[all.size() / 500], all[all.size() - 1 - all.size() / 500]};
}

using Memory = physics::Curve::Memory;

/// A curve to be tried: its site, its variable, its knots and the signal that multiplies it.
struct Choice {
  const char* site;
  const char* over;
  std::size_t knots;
  const char* with = "";
  Memory memory = Memory::none;
};

/// What a curve at this place goes with: the other nodes for heat that is exchanged, else what the choice says.
std::vector<std::string> partners_of(const Case& data, const Choice& choice, const std::string& place) {
  if (std::string_view{choice.site} != "exchange") return {choice.with};
  auto others = data.model.thermal.nodes;
  std::erase(others, place);
  return others;
}

/// By how much a value of the curve is moved for its slope; 0: the plant's usual.
double step_of_curve(const Case& data, const Fit& fitted, const Term& term) {
  const auto site = term.info->site;
  if (term.curve.usual > 0.0) return term.curve.usual;
  if (data.model.plant == Plant::thermal) {
    if (site == "storage") return 1e-3 * fitted.model.value(term.on + ".capacity", 1.0);
    const double loss = std::abs(fitted.model.value(term.on + ".loss"));
    if (site == "exchange") return loss > 0.0 ? 0.01 * loss : 1e-3;
    return term.with == "power" ? 0.01 : 0.0;
  }
  if (data.model.plant != Plant::axis) return 0.0;
  if (!term.with.empty())
    return 0.1 * missing_force(data, fitted) / (term.with == "direction" ? 1.0 : usual_size(data, term.with));
  return site == "force" ? std::min(0.05, small_force(data, fitted.model)) : 0.0;
}

/// Nothing where its variable does not vary, or what multiplies it was not recorded.
std::optional<Start> curve_start(const Case& data, const Fit& fitted, const Choice& choice,
                                 const std::string& place, const std::string& partner) {
  const bool is_thermal = data.model.plant == Plant::thermal;
  const auto [low, high] = span_of(data, choice.over, is_thermal ? place : "");
  if (!(high - low > 1e-9 * (std::abs(high) + std::abs(low)))) return std::nullopt;
  if (data.model.plant == Plant::error_map && !partner.empty() && partner != "direction" &&
      !covered(data, partner))
    return std::nullopt;
  // Where an instrument changes with its velocity it does so beside rest.
  const bool beside_rest = data.model.plant == Plant::sensor && std::string_view{choice.over} == "velocity" &&
                           low < 0.0 && high > 0.0;
  Start start;
  start.term.info = physics::unmodelled(data.model.plant, choice.site);
  start.term.on = place;
  start.term.with = partner;
  start.term.curve.over = choice.over;
  start.term.curve.memory = choice.memory;
  if (choice.memory != Memory::none) lay_memory(start, choice.knots, high - low, longest(data));
  for (std::size_t k = 0; k < choice.knots && choice.memory == Memory::none; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(choice.knots - 1);
    const double away = 2.0 * share - 1.0;
    start.term.curve.knots.push_back(beside_rest ? (away < 0.0 ? low : high) * away * away
                                                 : low + share * (high - low));
    start.term.curve.values.push_back(0.0);
    start.directions.push_back({physics::no_parameter, k, false});
  }
  // A loop follows what its encoder reads wrong: a slow course hardly shows, and could be of any size.
  if (data.model.plant == Plant::axis && start.term.info->site == "measurement")
    start.term.curve.usual = 10.0 * weigh(data, simulate(data, fitted.model), Colour::white).filters[0].sigma;
  start.step = step_of_curve(data, fitted, start.term);
  if (choice.memory == Memory::relaxation) start.step /= high - low;
  return start;
}

// Of friction and damping coarse knots lie among the fine ones: their columns cost nothing more.
constexpr Choice axis_curves[] = {
    {"force", "position", 10},
    {"force", "position", 28},
    {"force", "position", 60},
    {"force", "position", 11, "direction"},
    {"force", "position", 21, "direction"},
    {"force", "position", 11, "velocity"},
    {"force", "position", 21, "velocity"},
    {"force", "velocity", 12},
    {"force", "time", 12},
    {"force", "time", 8, "acceleration"},  // what is picked up and put down
    {"force", "temperature", 6},
    {"force", "temperature", 6, "direction"},  // what greases it
    {"force", "temperature", 6, "velocity"},
    {"actuator", "current", 9},
    {"actuator", "temperature", 5},
    {"measurement", "position", 28},
};

constexpr Choice thermal_curves[] = {
    {"loss", "temperature", 6},
    {"loss", "ambient", 5},
    {"storage", "temperature", 12},  // what melts takes heat at one temperature
    {"loss", "time", 12},
    {"source", "time", 12},
    {"loss", "speed", 5},
    {"source", "power", 6},
    {"source", "motor_current", 5},
    {"source", "time", 8, "power"},
    {"source", "temperature", 5, "power"},  // a resistance that changes as it warms
    {"exchange", "temperature", 7},         // to each other node
};

constexpr Choice error_map_curves[] = {
    {"kinematic", "position", 12},
    {"kinematic", "time", 14},
    {"thermal", "temperature", 6},
    {"kinematic", "temperature", 6},
    {"measurement", "pressure", 5},
    {"kinematic", "pressure", 5},
    {"kinematic", "offset", 5},
    {"thermal", "time", 10},
    {"kinematic", "position", 12, "direction"},  // a reversal that varies along the way
    {"thermal", "position", 12, "temperature"},  // what warms bends
};

constexpr Choice droplet_curves[] = {
    {"flight", "time", 6},      {"flight", "height", 6},         {"camera", "image_x", 6},
    {"camera", "image_y", 6},   {"valve", "pressure", 6},        {"valve", "velocity_x", 6},
    {"valve", "velocity_y", 6}, {"flight", "target_x", 6},       {"flight", "target_y", 6},
    {"valve", "on_time", 5},    {"flight", "time", 6, "height"},
};

constexpr Choice sensor_curves[] = {
    {"measurement", "velocity", 12},
    {"measurement", "acceleration", 6},
    {"measurement", "time", 10},
    {"measurement", "true_position", 14},
    {"measurement", "time", 10, "true_position"},  // a scale that grows
    {"measurement", "time", 8, "velocity"},
};

std::span<const Choice> choices_of_plant(const physics::Model& model) {
  switch (model.plant) {
    case Plant::axis: {
      // Only a loop shows what its encoder reads wrong along the way, the last of the choices.
      const std::span<const Choice> all{axis_curves};
      return model.controller ? all : all.first(all.size() - 1);
    }
    case Plant::thermal:
      return thermal_curves;
    case Plant::error_map:
      return error_map_curves;
    case Plant::droplet:
      return droplet_curves;
    case Plant::sensor:
      return sensor_curves;
    default:
      return {};
  }
}

/// Those of the plant, and of an error map the same over each further temperature.
std::vector<Choice> choices_of(const Case& data) {
  const auto known = choices_of_plant(data.model);
  std::vector<Choice> all{known.begin(), known.end()};
  for (const auto& further : further_temperatures(data)) {
    const char* name = data.model.signal(further)->name.c_str();
    for (auto choice : known) {
      const bool is_over = physics::is_temperature(choice.over),
                 is_with = physics::is_temperature(choice.with);
      if (is_over) choice.over = name;
      if (is_with) choice.with = name;
      if (is_over || is_with) all.push_back(choice);
    }
  }
  return all;
}

/// The nodes or outputs at which a curve may lie.
std::vector<std::string> places_of_curves(const Case& data) {
  if (data.model.plant == Plant::thermal) return data.model.thermal.nodes;
  if (data.model.plant == Plant::droplet || data.model.plant == Plant::sensor) return data.outputs;
  return {""};
}

}  // namespace

std::vector<Start> unmodelled_starts(const Case& data, const Fit& fitted) {
  if (data.model.plant == Plant::equations) return equation_curves(data, fitted.model);
  std::vector<Start> starts;
  // Beside a law of friction that was found, a course along the way would only take over what the law does.
  const bool has_law = has_found_friction(data, fitted.model);
  for (const auto& choice : choices_of(data)) {
    const std::string_view with = choice.with;
    if (has_law && (with == "direction" || with == "velocity")) continue;
    for (const auto& place : places_of_curves(data))
      for (const auto& partner : partners_of(data, choice, place))
        if (auto start = curve_start(data, fitted, choice, place, partner))
          starts.push_back(std::move(*start));
  }
  auto jumps = jump_starts(data, fitted);
  std::move(jumps.begin(), jumps.end(), std::back_inserter(starts));
  auto waves = wave_starts(data, fitted);
  std::move(waves.begin(), waves.end(), std::back_inserter(starts));
  return starts;
}

std::vector<Start> memory_starts(const Case& data, const Fit& fitted) {
  if (data.model.plant == Plant::equations) return equation_memories(data, fitted.model);
  std::vector<Start> starts;
  if (data.model.plant != Plant::axis) return starts;
  for (const Choice& choice : {Choice{"force", "position", 7, "", Memory::stop},
                               Choice{"force", "position", 6, "", Memory::relaxation}})
    if (auto start = curve_start(data, fitted, choice, "", "")) starts.push_back(std::move(*start));
  return starts;
}

}  // namespace invar::diagnosis

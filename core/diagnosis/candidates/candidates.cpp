#include "core/diagnosis/candidates/candidates.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <set>

#include "core/diagnosis/candidates/equation_candidates.hpp"
#include "core/diagnosis/candidates/jump.hpp"
#include "core/diagnosis/candidates/wave.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/locate/axis_periods.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

using physics::Plant;
using physics::Role;
using physics::Term;
using physics::TermInfo;

constexpr auto none = physics::most_parameters;

bool has(const Case& data, const char* name) { return data.recordings.front().inputs.find(name) != nullptr; }

/// Does an input take values that differ by more than a thousandth of their size?
bool varies(const Case& data, const char* name) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const auto& recording : data.recordings)
    if (const auto* values = recording.inputs.find(name))
      for (const double v : *values)
        if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  return high - low > 1e-3 * std::max(std::abs(low), std::abs(high));
}

/// Does anything in the recordings let this term show?
bool may_show(const Case& data, const physics::Model& model, const TermInfo& info) {
  const auto name = info.name;
  switch (info.plant) {
    case Plant::thermal:
      if (name == "speed_dependent_convection") return has(data, "speed");
      if (name == "motor_heating") return has(data, "motor_current");
      if (name == "node_coupling") return data.model.thermal.nodes.size() > 1;
      if (name == "heater_saturation") return !data.model.thermal.heaters.empty();
      return true;
    case Plant::error_map: {
      bool expands = model.value("expansion") != 0.0;
      for (const auto& term : model.terms) expands = expands || term.info->name == "thermal_expansion";
      if (name == "backlash") return has(data, "direction");
      if (name == "thermal_expansion")
        return has(data, "temperature") && data.model.find("expansion") == nullptr;
      if (name == "heating_rate_lag") return has(data, "temperature") && expands;
      if (name == "refractive_index") return has(data, "pressure");
      // Beside one offset a tilt is any course over the position.
      if (name == "abbe_offset") return varies(data, "offset");
      return true;
    }
    case Plant::droplet:
      if (name == "stage_velocity_carry" || name == "valve_delay") return has(data, "velocity_x");
      if (name == "pressure_dependence") return has(data, "pressure");
      if (name == "lens_distortion" || name == "camera_rotation") return has(data, "image_x");
      return true;
    default:
      return true;
  }
}

std::vector<std::string> places(const Case& data, const TermInfo& info) {
  switch (info.plant) {
    case Plant::thermal:
      if (info.name == "ambient_drift") return {data.model.thermal.nodes.front()};  // one air for all
      return data.model.thermal.nodes;
    case Plant::sensor: {
      std::vector<std::string> on;
      for (const auto& output : data.outputs) {
        const bool encoder = output == "encoder";
        if (info.name == "gain_droop" && encoder) continue;
        if ((info.name == "periodic_error" || info.name == "hysteresis") && !encoder) continue;
        on.push_back(output);
      }
      return on;
    }
    default:
      return {""};
  }
}

/// Pitches worth trying where the rows are few: a fine grid of wave numbers between one and the sampling's limit.
std::vector<double> pitch_grid(const std::vector<double>& positions, std::size_t most) {
  auto sorted = positions;
  std::sort(sorted.begin(), sorted.end());
  const double span = sorted.back() - sorted.front();
  if (!(span > 0.0)) return {};
  double coarse = span;
  std::vector<double> steps;
  for (std::size_t i = 1; i < sorted.size(); ++i)
    if (sorted[i] - sorted[i - 1] > 1e-6 * span) steps.push_back(sorted[i] - sorted[i - 1]);
  if (!steps.empty()) coarse = median(steps);
  const double top = std::min(0.5 / coarse, static_cast<double>(most) * 0.2 / span);
  std::vector<double> pitches;
  for (double k = 0.75 / span; k <= top && pitches.size() < most; k += 0.2 / span) pitches.push_back(1.0 / k);
  return pitches;
}

std::vector<double> own_shapes(const Case& data, const Fit& fitted, const TermInfo& info,
                               const std::string& on) {
  if (info.name == "heater_saturation") {
    const double top = highest_power(data, on);
    std::vector<double> clips;  // close: from one to the next a fit cannot go where no power lies between
    for (const double share :
         {0.999, 0.998, 0.996, 0.992, 0.985, 0.97, 0.93, 0.88, 0.82, 0.75, 0.67, 0.57, 0.45})
      clips.push_back(share * top);
    return clips;
  }
  if (info.plant == Plant::sensor && info.name == "periodic_error") return sensor_pitches(data, fitted);
  if ((info.plant == Plant::error_map || info.plant == Plant::sensor) && info.name == "periodic_error") {
    std::vector<double> all;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& x =
          *data.recordings[r].inputs.find(info.plant == Plant::sensor ? "true_position" : "position");
      for (double v : x)
        if (std::isfinite(v)) all.push_back(v);
    }
    return pitch_grid(all, 400);
  }
  return {};
}

double rms_of(const std::vector<std::vector<double>>& series) {
  double square = 0.0, rows = 0.0;
  for (const auto& one : series)
    for (const double v : one)
      if (std::isfinite(v)) square += v * v, rows += 1.0;
  return rows > 0.0 ? std::sqrt(square / rows) : 0.0;
}

/// RMS of a signal over all recordings.
double usual(const Case& data, const std::string& name) {
  std::vector<std::vector<double>> all;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) all.push_back(variable_values(data, r, name));
  return std::max(1e-9, rms_of(all));
}

/// Stiffnesses of bristles that reach their level after micrometres, as balls do, or after a share of the way, as seals and
/// cables do [N/m].
std::vector<double> bristles_for(const Case& data, const TermInfo& info) {
  const auto level = info.parameters[info.index_of("level")].starts[0];
  const auto& own = info.parameters[info.index_of("stiffness")].starts;
  std::vector<double> stiffnesses{own[0], own[1], own[2]};
  if (const auto way = covered(data, "reference"))
    for (const double share : {0.003, 0.03})
      if (const double bend = share * (way->upper - way->lower); bend > 0.0)
        stiffnesses.push_back(level / bend);
  return stiffnesses;
}

/// A part of what the motor of an axis gives [A], [N].
double small_current(const Case& data) { return 0.1 * usual(data, "current"); }
double small_force(const Case& data, const physics::Model& model) {
  return small_current(data) * model.value("motor_constant", 1.0);
}

/// Half a newton is all that moves a small axis, and more: first order is taken from a part of that.
void take_to_size(const Case& data, const physics::Model& model, std::vector<Start>& starts) {
  const double current = small_current(data), force = small_force(data, model);
  for (auto& start : starts) {
    const auto& info = *start.term.info;
    for (std::size_t i = 0; i < info.parameter_count(); ++i)
      if (info.parameters[i].role == Role::amplitude) {
        auto& value = start.term.values[i];
        const double as_written = value;
        if (info.parameters[i].unit == "N") value = std::min(value, force);
        if (info.name == "presliding_friction" &&
            info.parameters[i].name == "level")  // they bend as far as before
          start.term.values[info.index_of("stiffness")] *= value / as_written;
        if (info.parameters[i].unit == "A") value = std::min(value, current);
      }
  }
}

/// Stands a law of friction in the model that the user did not write?
bool has_found_friction(const Case& data, const physics::Model& model) {
  return std::any_of(model.terms.begin() + static_cast<std::ptrdiff_t>(data.model.terms.size()),
                     model.terms.end(), [](const physics::Term& term) { return term.info->is_friction; });
}

}  // namespace

std::vector<Start> named_starts(const Case& data, const Weighing& weighing, const Fit& fitted,
                                const std::set<std::string, std::less<>>& without) {
  std::vector<Start> starts;
  const auto& model = fitted.model;
  if (data.model.plant == Plant::equations) {
    starts = equation_starts(data, model);
    std::erase_if(starts, [&](const Start& start) { return without.contains(start.term.info->name); });
    return starts;
  }
  Periods periods;
  if (data.model.plant == Plant::axis) periods = axis_periods(data, weighing, fitted);
  const bool rubs = has_found_friction(data, model);
  for (const auto* info : physics::terms_of(data.model.plant)) {
    if (without.contains(info->name) || !may_show(data, model, *info)) continue;
    // Two laws of one friction fit what neither is: a course over the velocity says it without a name.
    if (rubs && info->name.ends_with("_friction")) continue;
    const bool may_repeat = info->index_of("pitch") != none || info->index_of("frequency") != none;
    for (const auto& on : places(data, *info)) {
      const bool used = std::any_of(model.terms.begin(), model.terms.end(), [&](const Term& term) {
        return term.info == info && (term.on.empty() || term.on == on);
      });
      if (used && !(may_repeat && info->name != "flexible_mode")) continue;
      Term term;
      term.info = info;
      term.on = on;
      for (std::size_t i = 0; i < info->parameter_count(); ++i)
        if (const auto* shared = data.model.find(info->parameters[i].name);
            shared != nullptr && info->parameters[i].role == Role::shape) {
          term.values[i] = shared->value;
          term.given[i] = true;
        }
      if (const auto at = info->index_of("reference_pressure"); at != none && has(data, "pressure")) {
        std::vector<double> all;
        for (const auto& r : data.recordings)
          for (double v : *r.inputs.find("pressure"))
            if (std::isfinite(v)) all.push_back(v);
        term.values[at] = median(all);
        term.given[at] = true;
        if (info->plant == Plant::error_map) {
          // Where it reads right is not known; from the wrong side of it a fit would not find over.
          const auto [low, high] = std::minmax_element(all.begin(), all.end());
          add_starts(starts, term, {median(all), 1013.25, *low, *high});
          continue;
        }
      }
      if (info->name == "heating_rate_lag") {
        // What is late by a minute and what is late by hours lies too far apart for one beginning.
        const double lasts = longest(data);
        for (const double share : {0.01, 0.03, 0.1, 0.3}) {
          term.values[0] = info->parameters[0].bounds.clamp(share * lasts);
          term.given[0] = true;
          add_starts(starts, term);
        }
        continue;
      }
      if (info->name == "speed_dependent_convection") {
        double sum = 0.0, rows = 0.0;
        for (const auto& r : data.recordings)
          for (const double v : *r.inputs.find("speed"))
            if (std::isfinite(v) && v != 0.0) sum += std::abs(v), rows += 1.0;
        const auto at = info->index_of("at_speed");
        term.values[at] = rows > 0.0 ? sum / rows : 1.0;
        term.given[at] = true;
      }
      if (info->name == "ambient_drift") {
        double until = 0.0;
        for (const auto& r : data.recordings) until = std::max(until, r.inputs.time.back());
        term.values[info->index_of("over")] = until;
        term.given[info->index_of("over")] = true;
      }
      if (info->name == "hidden_node" && info->plant == Plant::thermal) {
        // A small store, that what it does goes with its size: how fast it fills is the shape, and `with` keeps that.
        const double lasts = longest(data);
        const double capacity = 0.02 * data.model.value(on + ".capacity", 100.0);
        for (const double share : {0.003, 0.015, 0.07, 0.3, 1.5}) {
          term.values[0] = capacity / (share * lasts);
          term.given[0] = true;
          add_starts(starts, term, {capacity});
        }
        continue;
      }
      if (info->name == "node_coupling") {
        for (const auto& other : data.model.thermal.nodes) {
          const auto joined = [&](const auto& c) {
            return (c.first == on && c.second == other) || (c.first == other && c.second == on);
          };
          if (other <= on ||
              std::any_of(data.model.thermal.couplings.begin(), data.model.thermal.couplings.end(), joined))
            continue;
          term.with = other;
          add_starts(starts, term);
        }
        continue;
      }
      std::vector<double> shapes = own_shapes(data, fitted, *info, on);
      if (info->plant == Plant::axis) {
        const auto name = info->name;
        if (name == "force_ripple") shapes = periods.force_pitch;
        if (name == "motor_constant_ripple") shapes = periods.motor_pitch;
        if (name == "encoder_periodic_error") shapes = periods.reading_pitch;
        if (name == "periodic_disturbance" || name == "additive_disturbance")
          shapes = periods.force_frequency;
        if (name == "position_stiffness") {  // about a far center it is first of all a steady force
          shapes = {0.0};
          if (const auto way = covered(data, "reference")) shapes.push_back(0.5 * (way->lower + way->upper));
        }
        if (name == "presliding_friction") shapes = bristles_for(data, *info);
        // What rings, rings at one pitch: from far off it would seem to push the other way.
        if (name == "flexible_mode") {
          shapes = periods.mode_frequency;
          for (double f = 20.0; f < 350.0; f *= 1.45) shapes.push_back(f);
        }
        if (may_repeat && name != "flexible_mode" && shapes.empty()) continue;
      }
      if (info->name == "stage_velocity_carry") {
        const double v = data.model.value("speed", 3.0);
        shapes = {v, 0.6 * v, 1.7 * v};
      }
      if (info->name == "periodic_error" && shapes.empty()) continue;
      const auto add = [&] {
        const std::size_t first = starts.size();
        add_starts(starts, term, shapes);
        // An angle may have a period that is too long for a length.
        if (const auto pitch = info->index_of("pitch"); pitch != none && physics::is_rotary(data.model))
          for (std::size_t k = 0; k < shapes.size(); ++k)
            starts[first + k].term.values[pitch] =
                physics::bounds_of_parameter(data.model, term, pitch).clamp(shapes[k]);
        if (info->name != "additive_disturbance") return;
        auto wave = term;  // and as a square wave
        const auto square = info->index_of("squareness"), phase = info->index_of("phase");
        wave.values[square] = 1.0;
        wave.given[square] = true;
        for (const auto& [frequency, at] : periods.squares) {
          // Two square waves a quarter apart make none between them, as sines do: each begins with a phase.
          add_starts(starts, wave, {frequency});
          starts.back().term.values[phase] = at;
          starts.back().directions.resize(1);
        }
      };
      add();
      if (const auto onset = info->index_of("onset"); onset != none)  // from a later recording on
        for (std::size_t r = 1; r < data.recordings.size(); ++r) {
          term.values[onset] = data.recordings[r].inputs.time.front();
          term.given[onset] = true;
          add();
        }
    }
  }
  if (data.model.plant == Plant::axis) take_to_size(data, model, starts);
  return starts;
}

namespace {

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
    return 0.1 * missing_force(data, fitted) / (term.with == "direction" ? 1.0 : usual(data, term.with));
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
    start.directions.push_back({none, k, false});
  }
  // A loop follows what its encoder reads wrong: a slow course hardly shows, and could be of any size.
  if (data.model.plant == Plant::axis && start.term.info->site == "measurement")
    start.term.curve.usual = 10.0 * weigh(data, simulate(data, fitted.model), false).filters[0].sigma;
  start.step = step_of_curve(data, fitted, start.term);
  if (choice.memory == Memory::relaxation) start.step /= high - low;
  return start;
}

}  // namespace

std::vector<Start> unmodelled_starts(const Case& data, const Fit& fitted) {
  if (data.model.plant == Plant::equations) return equation_curves(data, fitted.model);
  std::vector<Choice> choices;
  switch (data.model.plant) {
    case Plant::axis:
      // Of friction and damping coarse knots lie among the fine ones: their columns cost nothing more.
      choices = {{"force", "position", 10},
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
                 {"actuator", "temperature", 5}};
      if (data.model.controller) choices.push_back({"measurement", "position", 28});
      break;
    case Plant::thermal:
      choices = {{"loss", "temperature", 6},
                 {"loss", "ambient", 5},
                 {"storage", "temperature", 12},  // what melts takes heat at one temperature
                 {"loss", "time", 12},
                 {"source", "time", 12},
                 {"loss", "speed", 5},
                 {"source", "power", 6},
                 {"source", "motor_current", 5},
                 {"source", "time", 8, "power"},
                 {"source", "temperature", 5, "power"},  // a resistance that changes as it warms
                 {"exchange", "temperature", 7}};        // to each other node
      break;
    case Plant::error_map:
      choices = {{"kinematic", "position", 12},
                 {"kinematic", "time", 14},
                 {"thermal", "temperature", 6},
                 {"kinematic", "temperature", 6},
                 {"measurement", "pressure", 5},
                 {"kinematic", "pressure", 5},
                 {"kinematic", "offset", 5},
                 {"thermal", "time", 10},
                 {"kinematic", "position", 12, "direction"},   // a reversal that varies along the way
                 {"thermal", "position", 12, "temperature"}};  // what warms bends
      break;
    case Plant::droplet:
      choices = {{"flight", "time", 6},      {"flight", "height", 6},        {"camera", "image_x", 6},
                 {"camera", "image_y", 6},   {"valve", "pressure", 6},       {"valve", "velocity_x", 6},
                 {"valve", "velocity_y", 6}, {"flight", "target_x", 6},      {"flight", "target_y", 6},
                 {"valve", "on_time", 5},    {"flight", "time", 6, "height"}};
      break;
    case Plant::sensor:
      choices = {{"measurement", "velocity", 12},
                 {"measurement", "acceleration", 6},
                 {"measurement", "time", 10},
                 {"measurement", "true_position", 14},
                 {"measurement", "time", 10, "true_position"},  // a scale that grows
                 {"measurement", "time", 8, "velocity"}};
      break;
    default:
      break;
  }
  std::vector<Start> starts;
  // Beside a law of friction that was found, a course along the way would only take over what the law does.
  const bool has_law = has_found_friction(data, fitted.model);
  for (const auto& choice : choices) {
    const std::string_view with = choice.with;
    if (has_law && (with == "direction" || with == "velocity")) continue;
    std::vector<std::string> on{""};
    if (data.model.plant == Plant::thermal) on = data.model.thermal.nodes;
    if (data.model.plant == Plant::droplet || data.model.plant == Plant::sensor) on = data.outputs;
    for (const auto& place : on)
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

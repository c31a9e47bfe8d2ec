// The named terms of each plant, and from which shapes a fit of them begins.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/candidates/equation_candidates.hpp"
#include "core/diagnosis/candidates/further_temperatures.hpp"
#include "core/diagnosis/candidates/sizes.hpp"
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

bool has(const Case& data, std::string_view name) {
  return data.recordings.front().inputs.find(name) != nullptr;
}

/// Does an input take values that differ by more than a thousandth of their size?
bool varies(const Case& data, std::string_view name) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const auto& recording : data.recordings)
    if (const auto* values = recording.inputs.find(name))
      for (const double v : *values)
        if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  return high - low > 1e-3 * std::max(std::abs(low), std::abs(high));
}

/// Does a model have this parameter, or a term at this place that stands for it?
bool has_in(const physics::Model& model, std::string_view parameter, const std::string& on) {
  return (on.empty() && model.value(parameter) != 0.0) ||
         std::any_of(model.terms.begin(), model.terms.end(),
                     [&](const Term& term) { return term.info->stands_for == parameter && term.on == on; });
}

/// Does anything in the recordings let this term show at this place?
bool may_show(const Case& data, const physics::Model& model, const TermInfo& info, const std::string& on) {
  const bool is_further =
      info.plant == Plant::error_map && !on.empty();  // temperature, to which no parameter belongs
  if (!is_further && !info.needs.empty() && !has(data, info.needs)) return false;
  if (!info.needs_varied.empty() && !varies(data, info.needs_varied)) return false;
  if (!is_further && !info.stands_for.empty() && data.model.find(info.stands_for) != nullptr) return false;
  if (!info.acts_in.empty() && !has_in(model, info.acts_in, is_further ? on : "")) return false;
  const auto* kind = physics::thermal_kind(info);
  if (kind == nullptr) return true;
  return (!kind->couples || data.model.thermal.nodes.size() > 1) &&
         (kind->heater == nullptr || !data.model.thermal.heaters.empty());
}

/// At which nodes or outputs the term may act.
std::vector<std::string> places(const Case& data, const TermInfo& info) {
  switch (info.plant) {
    case Plant::thermal:
      if (physics::thermal_kind(info)->ambient != nullptr)
        return {data.model.thermal.nodes.front()};  // one air for all
      return data.model.thermal.nodes;
    case Plant::error_map: {
      std::vector<std::string> on{""};
      if (info.needs == "temperature")
        for (auto& name : further_temperatures(data)) on.push_back(std::move(name));
      return on;
    }
    case Plant::sensor: {
      using physics::Instrument;
      std::vector<std::string> on;
      for (const auto& output : data.outputs) {
        const auto instrument = output == "encoder" ? Instrument::counting : Instrument::analogue;
        if (info.instrument == Instrument::any || info.instrument == instrument) on.push_back(output);
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
        if (const auto shape = info.index_of(info.in_proportion.parameter);
            shape != physics::no_parameter && i == 0)
          start.term.values[shape] *= value / as_written;
        if (info.parameters[i].unit == "A") value = std::min(value, current);
      }
  }
}

/// What the starts are laid from, and where they are put.
struct Laying {
  const Case& data;
  const Fit& fitted;
  Periods periods;  // of an axis
  std::vector<Start> starts;
};

/// The finite values of an input in all recordings.
std::vector<double> finite_values(const Case& data, const char* input) {
  std::vector<double> all;
  for (const auto& recording : data.recordings)
    for (const double v : *recording.inputs.find(input))
      if (std::isfinite(v)) all.push_back(v);
  return all;
}

void give(Term& term, std::size_t parameter, double value) {
  term.values[parameter] = value;
  term.given[parameter] = true;
}

bool may_repeat(const TermInfo& info) { return info.has("pitch") || info.has("frequency"); }

/// The starts of a term from each shape; an angle may have a period that is too long for a length.
void add_shapes(Laying& to, const Term& term, const std::vector<double>& shapes) {
  const std::size_t first = to.starts.size();
  add_starts(to.starts, term, shapes);
  const auto pitch = term.info->index_of("pitch");
  if (pitch == physics::no_parameter || !physics::is_rotary(to.data.model)) return;
  const auto bounds = physics::bounds_of_parameter(to.data.model, term, pitch);
  for (std::size_t k = 0; k < shapes.size(); ++k)
    to.starts[first + k].term.values[pitch] = bounds.clamp(shapes[k]);
}

/// Two square waves a quarter apart make none between them, as sines do: each begins with a phase.
void add_square_waves(Laying& to, Term wave) {
  give(wave, wave.info->index_of("squareness"), 1.0);
  for (const auto& [frequency, phase] : to.periods.squares) {
    add_starts(to.starts, wave, {frequency});
    to.starts.back().term.values[wave.info->index_of("phase")] = phase;
    to.starts.back().directions.resize(1);
  }
}

/// From each shape; a term with an onset also from the beginning of each later recording on.
void add_with_onsets(Laying& to, Term term, const std::vector<double>& shapes) {
  const auto add = [&] {
    add_shapes(to, term, shapes);
    if (term.info->has("squareness")) add_square_waves(to, term);
  };
  add();
  const auto onset = term.info->index_of("onset");
  for (std::size_t r = 1; onset != physics::no_parameter && r < to.data.recordings.size(); ++r) {
    give(term, onset, to.data.recordings[r].inputs.time.front());
    add();
  }
}

/// A small store, that its effect goes with its size: how fast it fills is the shape, and `with` keeps that.
void add_hidden_nodes(Laying& to, Term term) {
  const double lasts = longest(to.data);
  const double capacity = 0.02 * to.data.model.value(term.on + ".capacity", 100.0);
  for (const double share : {0.003, 0.015, 0.07, 0.3, 1.5}) {
    give(term, 0, capacity / (share * lasts));
    add_starts(to.starts, term, {capacity});
  }
}

/// To each node that the model does not join to this one yet.
void add_couplings(Laying& to, Term term) {
  const auto& couplings = to.data.model.thermal.couplings;
  for (const auto& other : to.data.model.thermal.nodes) {
    const auto joined = [&](const auto& c) {
      return (c.first == term.on && c.second == other) || (c.first == other && c.second == term.on);
    };
    if (other <= term.on || std::any_of(couplings.begin(), couplings.end(), joined)) continue;
    term.with = other;
    add_starts(to.starts, term);
  }
}

/// The mean speed of the rows that move [the input's unit]; 1 where none do.
double mean_speed(const Case& data) {
  double sum = 0.0, rows = 0.0;
  for (const double v : finite_values(data, "speed"))
    if (v != 0.0) sum += std::abs(v), rows += 1.0;
  return rows > 0.0 ? sum / rows : 1.0;
}

/// Limits of a heater: close, as from one to the next a fit cannot go where no power lies between.
std::vector<double> power_limits(const Case& data, const std::string& node) {
  const double top = highest_power(data, node);
  std::vector<double> limits;
  for (const double share :
       {0.999, 0.998, 0.996, 0.992, 0.985, 0.97, 0.93, 0.88, 0.82, 0.75, 0.67, 0.57, 0.45})
    limits.push_back(share * top);
  return limits;
}

void add_thermal(Laying& to, Term term) {
  const auto& info = *term.info;
  const auto& kind = *physics::thermal_kind(info);
  if (info.lateness == physics::Lateness::store) return add_hidden_nodes(to, term);
  if (kind.couples) return add_couplings(to, term);
  if (info.has("at_speed")) give(term, info.index_of("at_speed"), mean_speed(to.data));
  if (info.has("over")) {
    double until = 0.0;
    for (const auto& r : to.data.recordings) until = std::max(until, r.inputs.time.back());
    give(term, info.index_of("over"), until);
  }
  add_with_onsets(to, term, kind.heater != nullptr ? power_limits(to.data, term.on) : std::vector<double>{});
}

void add_error_map(Laying& to, Term term) {
  const auto& info = *term.info;
  if (const auto at = info.index_of("reference_pressure");
      at != physics::no_parameter && has(to.data, "pressure")) {
    // Where it reads right is not known; from the wrong side of it a fit would not find over.
    const auto all = finite_values(to.data, "pressure");
    const auto [low, high] = std::minmax_element(all.begin(), all.end());
    give(term, at, median(all));
    return add_starts(to.starts, term, {median(all), 1013.25, *low, *high});
  }
  if (info.has("time_constant")) {
    // A lag of a minute and one of hours lie too far apart for one beginning.
    for (const double share : {0.01, 0.03, 0.1, 0.3}) {
      give(term, 0, info.parameters[0].bounds.clamp(share * longest(to.data)));
      add_starts(to.starts, term);
    }
    return;
  }
  if (!info.has("pitch")) return add_with_onsets(to, term, {});
  const auto pitches = pitch_grid(finite_values(to.data, "position"), 400);
  if (!pitches.empty()) add_with_onsets(to, term, pitches);
}

void add_droplet(Laying& to, Term term) {
  if (const auto at = term.info->index_of("reference_pressure");
      at != physics::no_parameter && has(to.data, "pressure"))
    give(term, at, median(finite_values(to.data, "pressure")));
  const double v = to.data.model.value("speed", 3.0);
  const bool carries = term.info->has("speed");
  add_with_onsets(to, term, carries ? std::vector<double>{v, 0.6 * v, 1.7 * v} : std::vector<double>{});
}

void add_sensor(Laying& to, const Term& term) {
  if (!term.info->has("pitch")) return add_with_onsets(to, term, {});
  const auto pitches = sensor_pitches(to.data, to.fitted);
  if (!pitches.empty()) add_with_onsets(to, term, pitches);
}

std::vector<double> axis_shapes(const Laying& to, const TermInfo& info) {
  if (info.is_wave_in_time()) return to.periods.force_frequency;
  if (info.is_wave())
    return info.site == "actuator"      ? to.periods.motor_pitch
           : info.site == "measurement" ? to.periods.reading_pitch
                                        : to.periods.force_pitch;
  if (info.springs_first) return bristles_for(to.data, info);
  std::vector<double> shapes;
  if (info.is_spring) {  // about a far center it is first of all a steady force
    shapes = {0.0};
    if (const auto way = covered(to.data, "reference")) shapes.push_back(0.5 * (way->lower + way->upper));
  }
  // A mode rings at one pitch: from far off it would seem to push the other way.
  if (info.has("frequency")) {
    shapes = to.periods.mode_frequency;
    for (double f = 20.0; f < 350.0; f *= 1.45) shapes.push_back(f);
  }
  return shapes;
}

void add_axis(Laying& to, const Term& term) {
  const auto shapes = axis_shapes(to, *term.info);
  if (shapes.empty() && may_repeat(*term.info)) return;
  add_with_onsets(to, term, shapes);
}

/// At one place, by the plant.
void add_at(Laying& to, const Term& term) {
  switch (term.info->plant) {
    case Plant::axis:
      return add_axis(to, term);
    case Plant::thermal:
      return add_thermal(to, term);
    case Plant::error_map:
      return add_error_map(to, term);
    case Plant::droplet:
      return add_droplet(to, term);
    case Plant::sensor:
      return add_sensor(to, term);
    default:
      return;
  }
}

/// Is the term in the model at this place, and such that it cannot act there twice?
bool is_used_up(const physics::Model& model, const TermInfo& info, const std::string& on) {
  if (info.is_wave()) return false;
  return std::any_of(model.terms.begin(), model.terms.end(), [&](const Term& term) {
    return term.info == &info && (term.on.empty() || term.on == on);
  });
}

/// The term at this place, with the shapes that are parameters of the user's model.
Term term_at(const Case& data, const TermInfo& info, const std::string& on) {
  Term term;
  term.info = &info;
  term.on = on;
  for (std::size_t i = 0; i < info.parameter_count(); ++i)
    if (const auto* shared = data.model.find(info.parameters[i].name);
        shared != nullptr && info.parameters[i].role == Role::shape)
      give(term, i, shared->value);
  return term;
}

}  // namespace

std::vector<Start> named_starts(const Case& data, const Weighing& weighing, const Fit& fitted,
                                const std::set<std::string, std::less<>>& without) {
  const auto& model = fitted.model;
  if (data.model.plant == Plant::equations) {
    auto starts = equation_starts(data, model);
    std::erase_if(starts, [&](const Start& start) { return without.contains(start.term.info->name); });
    return starts;
  }
  Laying to{data, fitted, {}, {}};
  if (data.model.plant == Plant::axis) to.periods = axis_periods(data, weighing, fitted);
  const bool has_friction = has_found_friction(data, model);
  for (const auto* info : physics::terms_of(data.model.plant)) {
    if (without.contains(info->name)) continue;
    // Two laws of one friction fit what neither is: a course over the velocity says it without a name.
    if (has_friction && info->is_friction) continue;
    for (const auto& on : places(data, *info))
      if (may_show(data, model, *info, on) && !is_used_up(model, *info, on))
        add_at(to, term_at(data, *info, on));
  }
  if (data.model.plant == Plant::axis) take_to_size(data, model, to.starts);
  return to.starts;
}

}  // namespace invar::diagnosis

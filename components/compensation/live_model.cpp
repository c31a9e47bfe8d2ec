#include "components/compensation/live_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "core/base/index.hpp"
#include "core/compensation/component_file.hpp"
#include "core/compensation/error_map_model.hpp"
#include "core/compensation/geometric_file.hpp"
#include "core/compensation/thermal_file.hpp"
#include "core/metrology/geometric/error_motions.hpp"
#include "core/model/model_file.hpp"

namespace invar::compensation {

namespace {

constexpr int steps = 20;               // of the grids on which a model is looked at
constexpr double most_compiled = 2e-7;  // m, by which the loop's tables may differ from networks

std::string in_um(double metres) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.3g um", 1e6 * metres);
  return text.data();
}

bool covers(const Range& range, const Range& travel) {
  const double margin = 0.1 * travel.width();
  return range.lower <= travel.lower + margin && range.upper >= travel.upper - margin;
}

std::string refusal_of_values(double largest, double steepest, double sigma, const ModelLimits& limits) {
  if (!(largest <= limits.bound))
    return "it corrects " + in_um(largest) + ", beyond the bound of " + in_um(limits.bound);
  if (!(steepest <= limits.steepest)) {
    return "its correction changes by " + in_um(steepest * 1e-3) + " in a millimetre, more than " +
           in_um(limits.steepest * 1e-3);
  }
  if (!(sigma <= limits.largest_sigma))
    return "it is not certain enough at mid travel: " + in_um(sigma) + " where " +
           in_um(limits.largest_sigma) + " are allowed";
  return {};
}

std::string refusal_of_machine(const metrology::Chain& chain, const std::array<Range, 3>& travel,
                               const ModelLimits& limits) {
  if (chain.axes != limits.axes)
    return "it is of another machine: one with " + std::to_string(chain.axes) + " axes, this one has " +
           std::to_string(limits.axes);
  if (!limits.machine) return {};
  const metrology::Machine& machine = *limits.machine;
  for (int place = 0; place < chain.axes; ++place) {
    if (chain.order[index(place)] != machine.chain.order[index(place)])
      return "it is of another machine: its axes stand in another order";
    const auto axis = index(chain.order[index(place)]);
    if (!covers(travel[axis], machine.travel[axis]) || !covers(machine.travel[axis], travel[axis]))
      return std::string{"it is of another machine: its axis "} + metrology::axis_letters[axis] +
             " has another travel";
  }
  return {};
}

/// Of a field over the travels: `error` and `sigma` [m] at a position.
template <class Error, class Sigma>
std::string refusal_of_field(const metrology::Chain& chain, const std::array<Range, 3>& travel,
                             Error error_at, Sigma sigma_at, const ModelLimits& limits) {
  // On a grid over the travels: the largest correction of an axis, and the steepest along any axis.
  double largest = 0.0;
  double steepest = 0.0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  std::array<int, 3> count{1, 1, 1};
  for (int k = 0; k < 3; ++k) {
    if (!chain.has(k)) continue;
    count[index(k)] = steps + 1;
    middle[k] = 0.5 * (travel[index(k)].lower + travel[index(k)].upper);
  }
  const auto at = [&](const std::array<int, 3>& node) {
    Eigen::Vector3d point = middle;
    for (int k = 0; k < 3; ++k)
      if (chain.has(k)) point[k] = travel[index(k)].lower + travel[index(k)].width() * node[index(k)] / steps;
    return point;
  };
  std::array<int, 3> node{};
  for (node[2] = 0; node[2] < count[2]; ++node[2])
    for (node[1] = 0; node[1] < count[1]; ++node[1])
      for (node[0] = 0; node[0] < count[0]; ++node[0]) {
        const Eigen::Vector3d error = error_at(at(node));
        if (!error.allFinite()) return "it gives no number at a point of the travels";
        largest = std::max(largest, error.cwiseAbs().maxCoeff());
        for (int k = 0; k < 3; ++k) {
          if (node[index(k)] + 1 >= count[index(k)]) continue;
          std::array<int, 3> next = node;
          ++next[index(k)];
          const double change = (error_at(at(next)) - error).cwiseAbs().maxCoeff();
          steepest = std::max(steepest, change * steps / travel[index(k)].width());
        }
      }
  Eigen::Vector3d sigma = sigma_at(middle);
  for (int k = 0; k < 3; ++k)
    if (!chain.has(k)) sigma[k] = 0.0;
  return refusal_of_values(largest, steepest, sigma.maxCoeff(), limits);
}

std::string refusal_of(const metrology::ThermalError& model, std::size_t axis, const ModelLimits& limits) {
  if (axis >= index(limits.axes)) return "it is of an axis that this machine lacks";
  if (limits.machine && !covers(model.x, limits.machine->travel[axis]))
    return "it is out of range: it was calibrated over a part of the travel only";
  double largest = 0.0;
  double steepest = 0.0;
  for (int t = 0; t <= 4; ++t)
    for (int r = 0; r <= 2; ++r) {
      double before = 0.0;
      for (int i = 0; i <= steps; ++i) {
        const double value =
            model.value(model.typical(model.x.lower + model.x.width() * i / steps,
                                      model.temperature.lower + model.temperature.width() * t / 4.0,
                                      model.heating_rate.lower + model.heating_rate.width() * r / 2.0));
        if (!std::isfinite(value)) return "it gives no number at a point of its range";
        largest = std::max(largest, std::abs(value));
        if (i > 0) steepest = std::max(steepest, std::abs(value - before) * steps / model.x.width());
        before = value;
      }
    }
  const double sigma = model.sigma(model.typical(0.5 * (model.x.lower + model.x.upper),
                                                 0.5 * (model.temperature.lower + model.temperature.upper)));
  return refusal_of_values(largest, steepest, sigma, limits);
}

std::string refusal_of_zone(const std::string& zone) {
  return "it needs the temperature of `" + zone + "`: name it below `zones` and connect it";
}

void take_thermal(LiveModel& live, const metrology::ThermalError& model, const ThermalPlace& place,
                  const ModelLimits& limits) {
  if (!place.axis && limits.axes > 1) {
    live.refusal = "it does not say which axis it is of: calibrate with --axis";
    return;
  }
  live.axis = index(place.axis.value_or(0));
  live.above = place.above;
  live.temperature = model.temperature;
  live.slope_temperature = model.slope_temperature;
  live.by_temperature = std::any_of(model.terms.begin(), model.terms.end(), [](const auto& term) {
    return term.factor != metrology::ThermalFactor::geometry &&
           term.factor != metrology::ThermalFactor::direction;
  });
  live.lag = model.lag;
  for (std::size_t z = 0; z < model.zones.size(); ++z) {
    const auto found = std::find(limits.zones.begin(), limits.zones.end(), model.zones[z].name);
    if (found == limits.zones.end()) {
      live.refusal = refusal_of_zone(model.zones[z].name);
      return;
    }
    live.zones[z] = static_cast<std::size_t>(found - limits.zones.begin());
    live.zone_ranges.push_back(model.zones[z].range);
  }
  live.refusal = refusal_of(model, live.axis, limits);
  if (live.refusal.empty()) live.thermal.emplace(model, 5e-9);
}

/// Networks are tried at the ends and the middle of the states' ranges.
std::string refusal_of(metrology::ErrorMotionTables& tables, const ModelLimits& limits) {
  const metrology::ErrorMotionNetworks& model = tables.model();
  if (std::string why = refusal_of_machine(model.chain, model.travel, limits); !why.empty()) return why;
  if (tables.bound() > most_compiled)
    return "its networks bend too much for the loop's tables: they would differ by " + in_um(tables.bound());
  // All combinations of few states; of many, each alone at its ends beside the others' middles, and all at once.
  const std::size_t states = model.states.size();
  std::vector<std::vector<int>> trials{std::vector<int>(states, 1)};
  if (states <= 3) {
    trials.clear();
    for (int c = 0; c < static_cast<int>(std::lround(std::pow(3, states))); ++c)
      trials.push_back({c % 3, c / 3 % 3, c / 9});
  } else {
    for (const int end : {0, 2}) {
      trials.emplace_back(states, end);
      for (std::size_t s = 0; s < states; ++s) (trials.emplace_back(states, 1))[s] = end;
    }
  }
  std::string why;
  for (const auto& levels : trials) {
    for (std::size_t s = 0; s < states; ++s) {
      const Range& range = model.states[s].range;
      tables.set(s, range.lower + 0.5 * levels[s] * range.width());
    }
    why = refusal_of_field(
        model.chain, model.travel, [&](const Eigen::Vector3d& p) { return tables.error(p); },
        [&](const Eigen::Vector3d& p) { return tables.sigma(p); }, limits);
    if (!why.empty()) break;
  }
  tables.forget();
  return why;
}

void read_components_into(LiveModel& live, const config::Yaml& yaml, const ModelLimits& limits) {
  const auto model = read_components(yaml.root());
  yaml.finish();
  live.by_temperature = !model.states.empty();
  live.temperature = {-HUGE_VAL, HUGE_VAL};
  for (const auto& state : model.states) {
    constexpr std::string_view prefix = "temperature_";
    if (state.name == "temperature") {
      live.states.push_back({LiveModel::Source::temperature, 0, state.range});
      live.temperature = state.range;
    } else if (state.name == "heating_rate") {
      live.states.push_back({LiveModel::Source::heating_rate, 0, state.range});
    } else if (state.name.starts_with(prefix)) {
      const auto found =
          std::find(limits.zones.begin(), limits.zones.end(), state.name.substr(prefix.size()));
      if (found == limits.zones.end()) {
        live.refusal = refusal_of_zone(state.name.substr(prefix.size()));
        return;
      }
      const auto zone = static_cast<std::size_t>(found - limits.zones.begin());
      live.states.push_back({LiveModel::Source::zone, zone, state.range});
    } else {
      live.refusal = "it depends on `" + state.name + "`, which the loop does not know";
      return;
    }
  }
  live.components.emplace(model);
  live.refusal = refusal_of(*live.components, limits);
}

void read_thermal_into(LiveModel& live, const config::Yaml& yaml, const ModelLimits& limits) {
  const ThermalPlace place = read_place(yaml.root());
  const metrology::ThermalError model = read_thermal(yaml.root());
  yaml.finish();
  take_thermal(live, model, place, limits);
}

/// What `invar diagnose` found in the readings of one axis: the whole of its error, so it stands above no geometric model.
void read_diagnosed_into(LiveModel& live, const config::Yaml& yaml, const ModelLimits& limits) {
  const auto diagnosed = model::read(yaml);
  yaml.finish();
  live.checksum = checksum_number(checksum(yaml.text()));
  live.text = yaml.text();
  if (diagnosed.plant != physics::Plant::error_map) {
    live.refusal = "it is a model of plant " + std::string{physics::name_of(diagnosed.plant)} +
                   ", not of an axis's position error";
    return;
  }
  const auto axis = metrology::axis_named(diagnosed.baseline.axis);
  if (!axis && (limits.axes > 1 || !diagnosed.baseline.axis.empty())) {
    live.refusal = "it does not say which axis it is of: add `axis: x` (or y, z) to the file";
    return;
  }
  live.refusal = why_not_corrected(diagnosed);
  if (live.refusal.empty()) take_thermal(live, thermal_error_of(diagnosed), {axis, 0}, limits);
}

}  // namespace

void load_live_model(const std::filesystem::path& file, const ModelLimits& limits, LiveModel& live) {
  const auto yaml = config::Yaml::load(file);
  if (yaml.root().has("invar_model")) return read_diagnosed_into(live, yaml, limits);
  live.checksum = check_seal(yaml);
  live.text = yaml.text();
  (void)yaml.root().integer("invar_compensation", 1, 1);
  yaml.root()["identified_from"].accept_all();
  const std::string kind = yaml.root().text("kind");
  if (live.checksum == 0) {
    live.refusal = "it carries no checksum: only a file as a calibration wrote it may move the machine";
  } else if (kind == "thermal") {
    read_thermal_into(live, yaml, limits);
  } else if (kind == "geometric") {
    const auto model = read_geometric(yaml.root());
    yaml.finish();
    live.geometric.emplace(model);
    live.expanding = model;
    live.expands = model.reference_temperature && std::any_of(model.expansion.begin(), model.expansion.end(),
                                                              [](double each) { return each != 0.0; });
    live.refusal = refusal_of_machine(model.chain, model.travel, limits);
    if (live.refusal.empty())
      live.refusal = refusal_of_field(
          model.chain, model.travel,
          [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
            return live.geometric->error(p) + model.reversal_at(p, Eigen::Vector3d::Ones());
          },
          [&](const Eigen::Vector3d& p) { return live.geometric->sigma(p); }, limits);
  } else if (kind == "components") {
    read_components_into(live, yaml, limits);
  } else {
    live.refusal = "a model of kind `" + kind + "` corrects no axis";
  }
}

}  // namespace invar::compensation

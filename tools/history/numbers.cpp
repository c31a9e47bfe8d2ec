// The numbers of calibrations that can be compared, by kind.
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/fault.hpp"
#include "core/compensation/component_file.hpp"
#include "core/compensation/geometric_file.hpp"
#include "core/compensation/model_file.hpp"
#include "core/compensation/rotary_file.hpp"
#include "core/compensation/thermal_file.hpp"
#include "core/compensation/trajectory_file.hpp"
#include "core/config/yaml.hpp"
#include "core/metrology/geometric/error_motions.hpp"
#include "core/metrology/thermal/thermistor.hpp"
#include "tools/calibration/predict.hpp"
#include "tools/history/calibrations.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

namespace fs = std::filesystem;
using Numbers = std::vector<CalibratedNumber>;
using report::si;

constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

/// What all ranges cover; empty where they do not meet.
Range common(const std::vector<Range>& ranges) {
  Range all = ranges.front();
  for (const Range& one : ranges)
    all = {std::max(all.lower, one.lower), std::max(all.lower, std::min(all.upper, one.upper))};
  return all;
}

std::vector<double> places(const Range& range, int count) {
  std::vector<double> out;
  if (range.width() <= 0.0) return {range.lower};
  for (int i = 0; i < count; ++i) out.push_back(range.lower + range.width() * i / (count - 1));
  return out;
}

void expect_common(const Range& range, const fs::path& file, const std::string& what) {
  if (std::isfinite(range.lower) && range.upper >= range.lower) return;
  throw InputError{file.string(), "has no " + what + " in common with the others",
                   "compare calibrations of one machine"};
}

using Reversals = std::array<metrology::ReversalCurve, 3>;

/// The lost motion of each axis over its travel: none of an axis that was read one way only.
void add_reversals(const Reversals& curves, const std::array<Range, 3>& travel, Numbers& numbers) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (curves[axis].empty()) continue;
    const std::string letter(1, metrology::axis_letters[axis]);
    for (const double q : places(travel[axis], 9)) {
      const double sigma = curves[axis].sigma_at(q);  // 0 in files that hold one value alone
      numbers.push_back({"reversal of " + letter, letter + " = " + si(q, "m", 4), "m", curves[axis].value(q),
                         sigma > 0.0 ? sigma : not_known, false});
    }
  }
}

void add_squareness(const metrology::Squareness& squareness, const metrology::Squareness& sigmas,
                    Numbers& numbers) {
  for (int pair = 0; pair < metrology::squareness_count; ++pair) {
    const auto k = static_cast<std::size_t>(pair);
    if (!(sigmas[k] > 0.0) || !std::isfinite(sigmas[k])) continue;
    numbers.push_back({std::string{metrology::squareness_iso_name(pair)}, "", "rad",
                       metrology::squareness_angle_from_cosine(pair, squareness[k]), sigmas[k], false});
  }
}

/// What the travels of all models have in common.
template <class Models>
std::array<Range, 3> common_travel(const Models& models, const fs::path& file) {
  std::array<Range, 3> travel = models.front().travel;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<Range> ranges;
    for (const auto& model : models) ranges.push_back(model.travel[axis]);
    travel[axis] = common(ranges);
    expect_common(travel[axis], file, "travel");
  }
  return travel;
}

std::vector<Numbers> geometric(const std::vector<Calibration>& all) {
  std::vector<metrology::GeometricModel> models;
  for (const auto& one : all) models.push_back(compensation::load_geometric(one.file));
  const std::array<Range, 3> travel = common_travel(models, all.front().file);
  std::vector<Numbers> out;
  for (const auto& model : models) {
    Numbers numbers;
    add_reversals(model.reversal, travel, numbers);
    for (int c = 0; c < metrology::error_motion_count; ++c) {
      const auto axis = static_cast<std::size_t>(metrology::axis_of(c));
      for (const double q : places(travel[axis], 9)) {
        const double sigma = model.error_motion_sigma(c, q);
        if (!std::isfinite(sigma)) continue;
        numbers.push_back({std::string{metrology::iso_name(c)},
                           std::string(1, metrology::axis_letters[axis]) + " = " + si(q, "m", 4),
                           metrology::is_rotation(c) ? "rad" : "m", model.error_motion(c, q), sigma, false});
      }
    }
    add_squareness(model.squareness, model.squareness_sigma, numbers);
    for (const double z : places(travel[2], 3))
      for (const double y : places(travel[1], 3))
        for (const double x : places(travel[0], 3)) {
          const Eigen::Vector3d at{x, y, z};
          const Eigen::Vector3d error = model.error(at, models.front().tool),
                                sigma = model.sigma_at(at, models.front().tool);
          for (Eigen::Index k = 0; k < 3; ++k)
            if (std::isfinite(sigma(k)))
              numbers.push_back({std::string{"error of the tool along "} + "xyz"[k],
                                 "(" + si(x, "m") + ", " + si(y, "m") + ", " + si(z, "m") + ")", "m",
                                 error(k), sigma(k), true});
        }
    out.push_back(std::move(numbers));
  }
  return out;
}

/// Error motions that were measured one by one, at the states in the middle of the first calibration's.
std::vector<Numbers> components(const std::vector<Calibration>& all) {
  std::vector<metrology::ErrorMotionNetworks> models;
  for (const auto& one : all) {
    const auto yaml = config::Yaml::load(one.file);
    models.push_back(compensation::read_components(yaml.root()));
    if (yaml.root().fault_count() > 0) yaml.finish();
  }
  const std::array<Range, 3> travel = common_travel(models, all.front().file);
  std::map<std::string, double> usual;
  for (const auto& model : models)
    for (const auto& state : model.states) usual.emplace(state.name, state.usual());
  std::vector<Numbers> out;
  for (const auto& model : models) {
    Numbers numbers;
    add_reversals(model.reversal, travel, numbers);
    std::vector<double> states;
    for (const auto& state : model.states) states.push_back(usual.at(state.name));
    for (int c = 0; c < metrology::error_motion_count; ++c) {
      const auto axis = static_cast<std::size_t>(metrology::axis_of(c));
      const auto& component = model.components[static_cast<std::size_t>(c)];
      if (!component) continue;
      for (const double q : places(travel[axis], 9))
        numbers.push_back({std::string{metrology::iso_name(c)},
                           std::string(1, metrology::axis_letters[axis]) + " = " + si(q, "m", 4),
                           metrology::is_rotation(c) ? "rad" : "m", component->value(q, states),
                           component->sigma_at(q, states), metrology::is_positioning(c)});
    }
    add_squareness(model.squareness, model.squareness_sigma, numbers);
    out.push_back(std::move(numbers));
  }
  return out;
}

/// Error and reversal of a rotary axis.
std::vector<Numbers> rotary(const std::vector<Calibration>& all) {
  std::vector<metrology::RotaryAxis> models;
  std::vector<Range> ranges;
  for (const auto& one : all) {
    models.push_back(compensation::load_rotary(one.file));
    ranges.push_back(models.back().travel);
  }
  const Range travel = common(ranges);
  expect_common(travel, all.front().file, "travel");
  std::vector<Numbers> out;
  for (const auto& model : models) {
    Numbers numbers;
    const std::string letter(1, model.letter), upper(1, static_cast<char>(model.letter - 'a' + 'A'));
    for (const double at : places(travel, 9)) {
      const std::string place = letter + " = " + report::number(at * 57.29577951308232, 4) + " deg";
      numbers.push_back({"E" + upper + upper, place, "rad", model.value(at), model.sigma(at), true});
      if (model.reversal.empty()) continue;
      numbers.push_back({"reversal of " + letter, place, "rad", model.reversal.value(model.place(at)),
                         model.reversal.sigma_at(model.place(at)), false});
    }
    out.push_back(std::move(numbers));
  }
  return out;
}

std::vector<Numbers> thermal(const std::vector<Calibration>& all) {
  std::vector<metrology::ThermalError> models;
  std::vector<Range> x, temperature;
  for (const auto& one : all) {
    const auto yaml = config::Yaml::load(one.file);
    models.push_back(compensation::read_thermal(yaml.root()));
    if (yaml.root().fault_count() > 0) yaml.finish();
    x.push_back(models.back().x);
    temperature.push_back(models.back().temperature);
  }
  const Range along = common(x), warm = common(temperature);
  expect_common(along, all.front().file, "travel");
  std::vector<Numbers> out;
  for (const auto& model : models) {
    Numbers numbers;
    for (const double t : places(warm, 3))
      for (const double at : places(along, 9)) {
        const auto state = model.typical(at, t);
        numbers.push_back({"error at " + report::number(t, 4) + " degC", "x = " + si(at, "m", 4), "m",
                           model.value(state), model.sigma(state), true});
      }
    out.push_back(std::move(numbers));
  }
  return out;
}

std::vector<Numbers> dispenser(const std::vector<Calibration>& all) {
  std::vector<metrology::DropletTrajectory> models;
  std::vector<Range> heights;
  for (const auto& one : all) {
    models.push_back(compensation::load_trajectory(one.file));
    heights.push_back({models.back().least_height, models.back().most_height});
  }
  const Range height = common(heights);
  std::vector<Numbers> out;
  for (const auto& path : models) {
    Numbers numbers;
    for (const double h : places(height, 2))
      for (Eigen::Index k = 0; k < 2; ++k)
        numbers.push_back({std::string{"offset "} + "xy"[k], "from " + si(h, "m"), "m", path.offset(h)(k),
                           path.sigma(h), true});
    const char* names[] = {"field scale x", "field shear xy", "field shear yx", "field scale y"};
    for (Eigen::Index k = 0; k < 4; ++k) {
      const double sigma = std::sqrt(path.field_covariance(k % 2, k % 2));
      numbers.push_back({names[k], "", "", path.field(k / 2, k % 2), sigma > 0.0 ? sigma : not_known, false});
    }
    out.push_back(std::move(numbers));
  }
  return out;
}

std::vector<Numbers> thermistor(const std::vector<Calibration>& all) {
  recording::Table inputs;
  std::vector<double> resistance;
  {
    const auto first = config::Yaml::load(all.front().file);
    const auto& root = first.root();
    const metrology::Thermistor found{
        root.number("resistance", "ohm"), root.number("base_temperature", "degC"),
        root.number("coefficient", "1"), root.has("third_order") ? root.number("third_order", "1/K") : 0.0};
    const auto ends = root.has("range") ? compensation::exactly(root["range"], 2, "1")
                                        : std::vector<double>{found.base_temperature, found.base_temperature};
    for (const double t : places({ends[0], std::max(ends[0], ends[1])}, 5))
      resistance.push_back(found.resistance(t));
  }
  inputs.add("resistance", "ohm", std::vector<double>{resistance});
  std::vector<Numbers> out;
  for (const auto& one : all) {
    const auto yaml = config::Yaml::load(one.file);
    (void)yaml.root().integer("invar_compensation", 1, 1);
    (void)yaml.root().text("kind");
    const auto predicted = predict_thermistor(yaml, inputs);
    const auto temperature = predicted.in("temperature", "degC"), sigma = predicted.in("sigma", "K");
    Numbers numbers;
    for (std::size_t i = 0; i < resistance.size(); ++i)
      numbers.push_back(
          {"temperature", "at " + si(resistance[i], "ohm", 5), "K", temperature[i], sigma[i], true});
    out.push_back(std::move(numbers));
  }
  return out;
}

std::vector<Numbers> camera(const std::vector<Calibration>& all) {
  std::vector<Numbers> out;
  for (const auto& one : all) {
    const auto yaml = config::Yaml::load(one.file);
    Numbers numbers;
    const auto take = [&](const config::Node& node, const std::string& name, const std::string& unit) {
      if (!node.has(name)) return;
      const auto quantity = node[name].as_quantity(unit == "" ? "1" : unit);
      numbers.push_back({name, "", unit, quantity.value, quantity.sigma.value_or(not_known), false});
    };
    take(yaml.root(), "scale", "m/px");
    take(yaml.root(), "aspect", "");
    if (yaml.root().has("pinhole"))
      for (const char* name : {"fx", "fy", "u0", "v0", "skew", "k1", "k2", "k3", "p1", "p2"})
        take(yaml.root()["pinhole"], name, std::string{name}.starts_with("k") || name[0] == 'p' ? "" : "px");
    out.push_back(std::move(numbers));
  }
  return out;
}

std::vector<Numbers> ripple(const std::vector<Calibration>& all) {
  std::vector<Numbers> out;
  for (const auto& one : all) {
    std::ifstream stream{one.file.parent_path() / "report.json"};
    const auto report = nlohmann::json::parse(stream, nullptr, false);
    Numbers numbers;
    const auto& families = report.contains("families") ? report["families"] : nlohmann::json::array();
    for (std::size_t k = 0; k < families.size(); ++k) {
      const auto& pitch = families[k]["pitch"];
      const std::string name = "family " + std::to_string(k + 1);
      numbers.push_back({name + ", pitch", "", pitch["unit"], pitch["value"], pitch["sigma"], false});
      for (const auto& h : families[k]["harmonics"]) {
        const bool turns = h.contains("amplitude_Nm");
        numbers.push_back({name + ", harmonic " + std::to_string(h["order"].get<int>()), "",
                           turns ? "N m" : "N", h[turns ? "amplitude_Nm" : "amplitude_N"],
                           h[turns ? "sigma_Nm" : "sigma_N"], false});
      }
    }
    out.push_back(std::move(numbers));
  }
  return out;
}

/// Only what every calibration has, in the order of the first.
void keep_common(std::vector<Numbers>& all) {
  using Key = std::pair<std::string, std::string>;
  std::map<Key, std::size_t> times;
  for (const auto& numbers : all)
    for (const auto& one : numbers) ++times[{one.name, one.place}];
  std::vector<Key> order;
  for (const auto& one : all.front())
    if (times[{one.name, one.place}] == all.size()) order.emplace_back(one.name, one.place);
  for (auto& numbers : all) {
    std::map<Key, CalibratedNumber> by_key;
    for (auto& one : numbers) by_key.emplace(Key{one.name, one.place}, one);
    numbers.clear();
    for (const auto& key : order) numbers.push_back(by_key.at(key));
  }
}

}  // namespace

std::vector<Numbers> comparable_numbers(const std::vector<Calibration>& calibrations) {
  const std::string& kind = calibrations.front().kind;
  std::vector<Numbers> all;
  if (kind == "geometric") all = geometric(calibrations);
  if (kind == "components") all = components(calibrations);
  if (kind.starts_with("rotary")) all = rotary(calibrations);
  if (kind.starts_with("thermal")) all = thermal(calibrations);
  if (kind == "dispenser") all = dispenser(calibrations);
  if (kind == "thermistor") all = thermistor(calibrations);
  if (kind.starts_with("camera")) all = camera(calibrations);
  if (kind == "ripple") all = ripple(calibrations);
  if (all.empty())
    throw InputError{calibrations.front().file.string(),
                     "a calibration of kind " + kind + " has no numbers to compare", "compare its pages"};
  keep_common(all);
  return all;
}

}  // namespace invar::tools

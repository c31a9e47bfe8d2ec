#include "core/compensation/error_map_model.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/spline.hpp"
#include "core/physics/static_plants.hpp"

namespace invar::compensation {

namespace {

using metrology::ThermalFactor;
using physics::Model;
using physics::Term;

/// The instrument's error is none of the machine's.
bool is_of_instrument(const Term& term) { return term.info->site == "measurement"; }

bool is_corrected(const Term& term) { return !is_of_instrument(term) && why_not_corrected(term).empty(); }

bool goes_with_warmth(const Model& model) {
  return model.value("expansion") != 0.0 ||
         std::any_of(model.terms.begin(), model.terms.end(), [](const Term& term) {
           return is_corrected(term) && term.info->name == "thermal_expansion";
         });
}

/// The error [m] at a position [m] and a temperature [degC].
using Map = std::function<double(double, double)>;

Map map_of(const Model& model) {
  const physics::CubicSpline baseline{model.baseline.positions, model.baseline.errors};
  const double first = model.baseline.positions.front(), last = model.baseline.positions.back();
  return [model, baseline, first, last](double x, double temperature) {
    physics::MapPoint at;
    at.position = x, at.warmth = temperature - model.value("reference_temperature", 20.0);
    at.first = first, at.last = last;
    double error = baseline(x) + model.value("expansion") * at.warmth * x;
    for (const auto& term : model.terms) {
      if (!is_corrected(term)) continue;
      if (const auto* kind = physics::error_map_kind(*term.info); kind->error != nullptr)
        error += kind->error(at, term.values.data());
      if (!term.curve.knots.empty()) error += term.curve(x);
    }
    return error;
  };
}

/// A network through `function` at its centres, which reach past both ends of `range`.
metrology::ThermalTerm network(ThermalFactor factor, const Range& range,
                               const std::function<double(double)>& function, double spacing) {
  constexpr double beyond = 6.0;  // centres: what lies further does not count
  metrology::ThermalTerm term{factor, range.lower - beyond * spacing, spacing, {}};
  const auto n = static_cast<Eigen::Index>(std::ceil(range.width() / spacing + 2.0 * beyond)) + 1;
  Eigen::MatrixXd influence(n, n);
  Eigen::VectorXd values(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    values(i) = function(term.first + spacing * static_cast<double>(i));
    for (Eigen::Index k = 0; k < n; ++k)
      influence(i, k) =
          std::exp(-0.5 * static_cast<double>((i - k) * (i - k))) / std::sqrt(2.0 * std::numbers::pi);
  }
  term.weights = numerics::solve_positive(influence, values);
  return term;
}

/// The coarsest network that meets `function` to 5 nm.
metrology::ThermalTerm network_of(ThermalFactor factor, const Range& range,
                                  const std::function<double(double)>& function) {
  constexpr double tolerance = 5e-9;
  constexpr int most = 1000;
  metrology::ThermalError alone;
  alone.x = range;
  metrology::ThermalTerm term;
  for (int parts = 15; parts < most; parts = parts * 8 / 5) {
    term = network(factor, range, function, range.width() / parts);
    double worst = 0.0;
    for (int i = 0; i <= 7 * parts; ++i) {
      const double x = range.lower + range.width() * i / (7.0 * parts);
      auto flat = term;
      flat.factor = ThermalFactor::geometry;
      worst = std::max(
          worst,
          std::abs(thermal_basis(flat, alone, {x, 0.0, 0.0, {}}).dot(flat.weights.col(0)) - function(x)));
    }
    if (worst <= tolerance) break;
  }
  return term;
}

/// Each number of the model one sigma further, as models of their own.
std::vector<Model> displaced(const Model& model) {
  std::vector<Model> all;
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    const auto& parameter = model.parameters[i];
    // What the reference temperature is, is known where nothing else is said: the baseline was read there.
    const double sigma =
        parameter.sigma.value_or(parameter.name == "reference_temperature" ? 0.0 : parameter.value);
    if (sigma == 0.0) continue;
    all.push_back(model);
    all.back().parameters[i].value += sigma;
  }
  for (std::size_t t = 0; t < model.terms.size(); ++t)
    for (std::size_t i = 0; i < model.terms[t].info->parameter_count() && is_corrected(model.terms[t]); ++i) {
      const double sigma = model.terms[t].sigmas[i].value_or(model.terms[t].values[i]);
      if (sigma == 0.0) continue;
      all.push_back(model);
      all.back().terms[t].values[i] += sigma;
    }
  return all;
}

}  // namespace

std::string_view why_not_corrected(const Term& term) {
  const auto name = term.info->name;
  if (is_of_instrument(term)) return {};
  if (name == "backlash")
    return "a correction knows no direction of approach; take up the play or home from one side";
  if (name == "abbe_offset")
    return "how far the tool lies beside the scale is no input of it; `invar calibrate geometric` finds the "
           "angle";
  if (!term.on.empty() && term.on != "temperature")
    return "a correction reads one temperature, and this goes with another";
  if (!term.curve.knots.empty() && term.curve.over != "position")
    return "a curve over anything but the position tells a correction nothing";
  return {};
}

std::string why_not_corrected(const Model& model) {
  const auto& baseline = model.baseline;
  if (baseline.positions.size() < 2 || !(baseline.positions.back() > baseline.positions.front()))
    return "its baseline has no length: two positions at least say over which way it holds";
  if (goes_with_warmth(model) && !baseline.temperature)
    return "it goes with the temperature and does not say over which it was found: add `range: {temperature: "
           "[from, to]}`";
  return {};
}

metrology::ThermalError thermal_error_of(const Model& model) {
  INVAR_EXPECTS(model.plant == physics::Plant::error_map && why_not_corrected(model).empty());
  metrology::ThermalError out;
  out.x = {model.baseline.positions.front(), model.baseline.positions.back()};
  const double reference = model.value("reference_temperature", 20.0);
  out.temperature = model.baseline.temperature.value_or(Range{reference, reference});
  out.heating_rate = {0.0, 0.0};
  for (const auto& term : model.terms)
    if (is_corrected(term) && physics::error_map_kind(*term.info)->delays_warmth)
      out.lag = std::max(0.0, term.values[0]);
  if (const auto noise = model.noise.find("error"); noise != model.noise.end()) out.noise = noise->second;
  const auto error = map_of(model);
  const double low = out.temperature.lower, high = out.temperature.upper;
  // Straight in the temperature: a mean and half a difference.
  const auto mean = [&](double x) { return 0.5 * (error(x, low) + error(x, high)); };
  const auto half = [&](double x) { return 0.5 * (error(x, high) - error(x, low)); };
  out.terms.push_back(network_of(ThermalFactor::geometry, out.x, mean));
  if (goes_with_warmth(model)) out.terms.push_back(network_of(ThermalFactor::temperature, out.x, half));

  constexpr int steps = 40;
  for (int i = 0; i < steps; ++i) {
    const double x = out.x.lower + out.x.width() * i / steps, step = out.x.width() / steps;
    out.slope_x = std::max(out.slope_x, std::abs(mean(x + step) - mean(x)) / step);
    if (high > low)
      out.slope_temperature = std::max(out.slope_temperature, 2.0 * std::abs(half(x + step)) / (high - low));
  }
  std::vector<Map> maps;
  for (const auto& other : displaced(model)) maps.push_back(map_of(other));
  out.sigma_table = {
      {numerics::GridAxis{out.x, 21}, numerics::GridAxis{out.temperature, high > low ? 5U : 1U},
       numerics::GridAxis{out.heating_rate, 1}},
      [&](const numerics::LookupTable<3>::Point& at) {
        double sum = 0.0;
        for (const auto& map : maps) sum += std::pow(map(at[0], at[1]) - error(at[0], at[1]), 2);
        return std::sqrt(sum);
      }};
  return out;
}

}  // namespace invar::compensation

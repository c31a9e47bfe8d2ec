#include "core/diagnosis/estimate/common_factor.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace invar::diagnosis {

namespace {

using physics::Plant;

bool ends_with(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

/// A number of the balance of forces, or of heat, that is homogeneous in all of them.
bool in_balance(Plant plant, std::string_view parameter) {
  if (plant == Plant::axis)
    return parameter == "mass" || parameter == "motor_constant" || parameter == "viscous_damping";
  return ends_with(parameter, ".capacity") || ends_with(parameter, ".loss") ||
         ends_with(parameter, ".gain") || ends_with(parameter, ".conductance");
}

bool in_balance(Plant plant, const physics::Term& term, std::size_t index) {
  const std::string_view unit = term.info->parameters[index].unit;
  if (plant == Plant::axis) return unit == "N" || unit.substr(0, 2) == "N " || unit.substr(0, 2) == "N/";
  return unit == "J/K" || unit == "ohm" || unit.substr(0, 2) == "W/" || unit.substr(0, 2) == "W ";
}

bool has_force_curve(const physics::Term& term) {
  return !term.curve.values.empty() && (term.info->site == "force" || term.info->site == "loss" ||
                                        term.info->site == "source" || term.info->site == "disturbance");
}

bool is_free(const std::vector<Freedom>& free, Freedom::Where where, std::size_t term, std::size_t index) {
  return std::any_of(free.begin(), free.end(), [&](const Freedom& f) {
    return f.where == where && f.index == index && (where == Freedom::Where::parameter || f.term == term);
  });
}

}  // namespace

std::vector<bool> with_common_factor(const physics::Model& model, const std::vector<Freedom>& free) {
  if (model.plant != Plant::axis && model.plant != Plant::thermal) return {};
  for (std::size_t i = 0; i < model.parameters.size(); ++i)
    if (in_balance(model.plant, model.parameters[i].name) && model.parameters[i].value != 0.0 &&
        !is_free(free, Freedom::Where::parameter, 0, i))
      return {};
  for (std::size_t t = 0; t < model.terms.size(); ++t)
    for (std::size_t i = 0; i < model.terms[t].info->parameter_count(); ++i)
      if (in_balance(model.plant, model.terms[t], i) && model.terms[t].values[i] != 0.0 &&
          !is_free(free, Freedom::Where::term, t, i))
        return {};
  std::vector<bool> goes;
  for (const auto& f : free)
    goes.push_back(f.where == Freedom::Where::parameter
                       ? in_balance(model.plant, model.parameters[f.index].name)
                   : f.where == Freedom::Where::term ? in_balance(model.plant, model.terms[f.term], f.index)
                                                     : has_force_curve(model.terms[f.term]));
  return goes;
}

double take_common_factor(physics::Model& model, const std::vector<Freedom>& free,
                          const std::function<double(const physics::Model&)>& prior_cost) {
  const auto goes = with_common_factor(model, free);
  const auto times = [&](double factor) {
    auto scaled = model;
    for (std::size_t k = 0; k < goes.size(); ++k)
      if (goes[k]) set(scaled, free[k], factor * get(model, free[k]));
    return scaled;
  };
  const auto is_possible = [&](double factor) {
    for (std::size_t k = 0; k < goes.size(); ++k)
      if (const double v = factor * get(model, free[k]); goes[k] && free[k].bounds.clamp(v) != v)
        return false;
    return factor > 0.0;
  };
  double best = 1.0, least = prior_cost(model) - 1.0;
  const auto weigh = [&](double factor) {
    if (!is_possible(factor)) return;
    if (const double cost = prior_cost(times(factor)); cost < least) least = cost, best = factor;
  };
  // The prior has a valley where each of the numbers is as it was believed, as wide as that belief.
  for (std::size_t k = 0; k < goes.size(); ++k) {
    const double value = get(model, free[k]);
    if (!goes[k] || !(free[k].sigma > 0.0) || value == 0.0 || free[k].where == Freedom::Where::curve)
      continue;
    for (int i = -20; i <= 20; ++i) weigh((free[k].center + 0.1 * i * free[k].sigma) / value);
  }
  if (best != 1.0) model = times(best);
  return best;
}

}  // namespace invar::diagnosis

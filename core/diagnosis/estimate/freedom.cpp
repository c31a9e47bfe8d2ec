#include "core/diagnosis/estimate/freedom.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"

namespace invar::diagnosis {

using physics::Model;
using physics::Role;

double get(const Model& model, const Freedom& f) {
  switch (f.where) {
    case Freedom::Where::parameter:
      return model.parameters[f.index].value;
    case Freedom::Where::term:
      return model.terms[f.term].values[f.index];
    case Freedom::Where::curve:
      return model.terms[f.term].curve.values[f.index];
  }
  return 0.0;
}

void set(Model& model, const Freedom& f, double value) {
  switch (f.where) {
    case Freedom::Where::parameter: {
      auto& parameter = model.parameters[f.index];
      parameter.value = value;
      for (auto& term : model.terms)
        for (std::size_t i = 0; i < term.info->parameter_count(); ++i)
          if (!term.given[i] && term.info->parameters[i].name == parameter.name) term.values[i] = value;
      break;
    }
    case Freedom::Where::term:
      model.terms[f.term].values[f.index] = value;
      break;
    case Freedom::Where::curve:
      model.terms[f.term].curve.values[f.index] = value;
      break;
  }
}

namespace {

Freedom of_parameter(const physics::Parameter& parameter, std::size_t index) {
  Freedom f;
  f.index = index;
  f.center = parameter.value;
  f.sigma = parameter.sigma.value_or(0.0);
  const double size = parameter.usual > 0.0 ? parameter.usual : std::abs(parameter.value);
  if (!parameter.sigma)
    f.scale = parameter.usual > 0.0 ? parameter.usual : std::max(0.05 * size, 1e-9);
  else  // who says that he knows nothing gives no size
    f.scale = size > 0.0 ? std::min(*parameter.sigma, size) : *parameter.sigma;
  f.bounds = parameter.bounds;
  return f;
}

/// One value of a curve; `takes_energy`: it is a friction, which cannot drive.
Freedom of_curve(const physics::Term& term, std::size_t t, std::size_t index, bool takes_energy) {
  double size = term.curve.usual;
  for (double v : term.curve.values)
    if (!(term.curve.usual > 0.0)) size = std::max(size, std::abs(v));
  Freedom f;
  f.where = Freedom::Where::curve, f.term = t, f.index = index;
  f.scale = std::max(0.1 * size, 1e-12);
  if (takes_energy) f.bounds.lower = 0.0;
  f.sigma = term.curve.usual > 0.0 ? size : 30.0 * std::max(size, 1e-11);
  return f;
}

/// A typical change of a term's number that the user says nothing of.
double scale_of(const physics::Term& term, std::size_t index) {
  const auto& number = term.info->parameters[index];
  if (number.name == "center") return 0.01;
  if (number.role == Role::shape &&
      (number.name == "pitch" || number.name == "frequency" || number.name == "period"))
    return 0.003 * std::abs(term.values[index]);
  if (number.role == Role::phase) return 0.3;
  const double usual = std::abs(number.starts[0]);
  return std::max({0.1 * std::abs(term.values[index]), usual < 1e100 ? 0.02 * usual : 0.0, 1e-12});
}

/// `believed`: the same term as the user wrote it; null for one that was found. Nothing where the number may not move.
std::optional<Freedom> of_term(const Model& model, std::size_t t, std::size_t index,
                               const physics::Term* believed) {
  const auto& term = model.terms[t];
  const auto& number = term.info->parameters[index];
  if (number.role == Role::reference || number.name == "squareness") return std::nullopt;
  if (!term.given[index] && model.find(number.name) != nullptr)
    return std::nullopt;  // moves with the nominal one
  Freedom f;
  f.where = Freedom::Where::term, f.term = t, f.index = index;
  f.bounds = physics::bounds_of_parameter(model, term, index);
  f.scale = scale_of(term, index);
  if (believed == nullptr) return f;
  const auto sigma = believed->sigmas[index];
  if (sigma && *sigma == 0.0) return std::nullopt;
  if (!sigma && !believed->given[index]) return std::nullopt;  // left out on purpose
  f.center = believed->values[index];
  f.sigma = sigma.value_or(0.0);
  if (sigma)
    f.scale = f.center != 0.0 ? std::min(*sigma, std::abs(f.center)) : *sigma;
  else if (const double size = believed->usual[index]; size > 0.0)
    f.scale = size;
  return f;
}

}  // namespace

std::vector<Freedom> freedoms(const Model& model, const Model& believed) {
  std::vector<Freedom> free;
  for (std::size_t i = 0; i < model.parameters.size(); ++i)
    if (const auto& sigma = believed.parameters[i].sigma; !sigma || *sigma != 0.0)
      free.push_back(of_parameter(believed.parameters[i], i));
  const bool has_friction = std::any_of(model.terms.begin(), model.terms.end(),
                                        [](const physics::Term& term) { return term.info->is_friction; });
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    const auto& term = model.terms[t];
    const auto* nominal = t < believed.terms.size() ? &believed.terms[t] : nullptr;
    const bool is_known = nominal != nullptr && nominal->sigmas[0].value_or(1.0) == 0.0;
    const bool takes_energy =
        term.with == "direction" && model.plant == physics::Plant::axis && !has_friction;
    for (std::size_t i = 0; i < term.curve.values.size() && !is_known; ++i)
      free.push_back(of_curve(term, t, i, takes_energy));
    for (std::size_t i = 0; i < term.info->parameter_count(); ++i)
      if (const auto f = of_term(model, t, i, nominal)) free.push_back(*f);
  }
  return free;
}

}  // namespace invar::diagnosis

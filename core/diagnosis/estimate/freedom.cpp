#include "core/diagnosis/estimate/freedom.hpp"

#include <algorithm>
#include <cmath>

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

std::vector<Freedom> freedoms(const Model& model, const Model& believed) {
  std::vector<Freedom> free;
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    const auto& parameter = believed.parameters[i];
    if (parameter.sigma && *parameter.sigma == 0.0) continue;
    Freedom f;
    f.index = i;
    f.center = parameter.value;
    f.sigma = parameter.sigma.value_or(0.0);
    const double size = parameter.usual > 0.0 ? parameter.usual : std::abs(parameter.value);
    if (!parameter.sigma)
      f.scale = parameter.usual > 0.0 ? parameter.usual : std::max(0.05 * size, 1e-9);
    else  // who says that he knows nothing gives no size
      f.scale = size > 0.0 ? std::min(*parameter.sigma, size) : *parameter.sigma;
    f.bounds = parameter.bounds;
    free.push_back(f);
  }
  const bool has_friction = std::any_of(model.terms.begin(), model.terms.end(),
                                        [](const physics::Term& term) { return term.info->is_friction; });
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    const auto& term = model.terms[t];
    const bool is_nominal = t < believed.terms.size();
    const bool is_known = is_nominal && believed.terms[t].sigmas[0].value_or(1.0) == 0.0;
    for (std::size_t i = 0; i < term.curve.values.size() && !is_known; ++i) {
      double size = term.curve.usual;
      for (double v : term.curve.values)
        if (!(term.curve.usual > 0.0)) size = std::max(size, std::abs(v));
      Freedom f;
      f.where = Freedom::Where::curve, f.term = t, f.index = i;
      f.scale = std::max(0.1 * size, 1e-12);
      if (term.with == "direction" && model.plant == physics::Plant::axis && !has_friction)
        f.bounds.lower = 0.0;  // friction takes energy
      f.sigma = term.curve.usual > 0.0 ? size : 30.0 * std::max(size, 1e-11);
      free.push_back(f);
    }
    for (std::size_t i = 0; i < term.info->parameter_count(); ++i) {
      const auto& info = term.info->parameters[i];
      if (info.role == Role::reference || info.name == "squareness") continue;
      if (!term.given[i] && model.find(info.name) != nullptr) continue;  // moves with the nominal one
      Freedom f;
      f.where = Freedom::Where::term, f.term = t, f.index = i;
      f.bounds = physics::bounds_of_parameter(model, term, i);
      const double usual = std::abs(info.starts[0]);
      f.scale = info.role == Role::phase
                    ? 0.3
                    : std::max({0.1 * std::abs(term.values[i]), usual < 1e100 ? 0.02 * usual : 0.0, 1e-12});
      if (info.role == Role::shape &&
          (info.name == "pitch" || info.name == "frequency" || info.name == "period"))
        f.scale = 0.003 * std::abs(term.values[i]);
      if (info.name == "center") f.scale = 0.01;
      if (is_nominal) {
        const auto sigma = believed.terms[t].sigmas[i];
        if (sigma && *sigma == 0.0) continue;
        if (!sigma && !believed.terms[t].given[i]) continue;  // left out on purpose
        f.center = believed.terms[t].values[i];
        f.sigma = sigma.value_or(0.0);
        if (sigma)
          f.scale = f.center != 0.0 ? std::min(*sigma, std::abs(f.center)) : *sigma;
        else if (const double size = believed.terms[t].usual[i]; size > 0.0)
          f.scale = size;
      }
      free.push_back(f);
    }
  }
  return free;
}

}  // namespace invar::diagnosis

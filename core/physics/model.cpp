#include "core/physics/model.hpp"

#include <algorithm>

#include "core/base/contract.hpp"
#include "core/physics/library.hpp"

namespace invar::physics {

const Parameter* Model::find(std::string_view name) const {
  const auto at =
      std::find_if(parameters.begin(), parameters.end(), [&](const auto& p) { return p.name == name; });
  return at == parameters.end() ? nullptr : &*at;
}

double Model::value(std::string_view name, double otherwise) const {
  const auto* parameter = find(name);
  return parameter == nullptr ? otherwise : parameter->value;
}

const Signal* Model::signal(std::string_view name) const {
  const auto at = std::find_if(signals.begin(), signals.end(), [&](const auto& s) { return s.name == name; });
  return at == signals.end() ? nullptr : &*at;
}

std::vector<std::string> Model::outputs() const {
  std::vector<std::string> names;
  for (const auto& signal : signals)
    if (signal.is_output) names.push_back(signal.name);
  return names;
}

std::vector<std::string> states_of(const Model& model) {
  if (model.plant == Plant::axis && !model.controller) return {"position", "velocity"};
  std::vector<std::string> names;
  for (const auto& state : model.equations.states) names.push_back(state.name);
  return names;
}

Model without_term(Model model, std::size_t place) {
  model.terms.erase(model.terms.begin() + static_cast<std::ptrdiff_t>(place));
  return model;
}

AxisPlant make_axis(const Model& model, double longest_step) {
  INVAR_EXPECTS(model.plant == Plant::axis);
  std::vector<AxisTerm> terms;
  for (const auto& term : model.terms) {
    const auto acts = term.with == "direction"      ? CurveActs::as_friction
                      : term.with == "velocity"     ? CurveActs::as_damping
                      : term.with == "acceleration" ? CurveActs::as_mass
                      : term.with == "command"      ? CurveActs::as_current
                                                    : CurveActs::as_force;
    terms.push_back({axis_kind(*term.info), term.values, term.curve, acts});
  }
  return {{model.value("mass", 1.0), model.value("motor_constant", 1.0), model.value("viscous_damping")},
          std::move(terms),
          longest_step};
}

ThermalPlant make_thermal(const Model& model) {
  INVAR_EXPECTS(model.plant == Plant::thermal);
  const auto& names = model.thermal.nodes;
  const auto place = [&](const std::string& node) {
    const auto at = std::find(names.begin(), names.end(), node);
    return at == names.end() ? std::size_t{0} : static_cast<std::size_t>(at - names.begin());
  };
  std::vector<ThermalNode> nodes;
  for (const auto& name : names)
    nodes.push_back({model.value(name + ".capacity", 1.0), model.value(name + ".loss")});
  std::vector<ThermalHeater> heaters;
  for (const auto& heater : model.thermal.heaters)
    heaters.push_back({place(heater.node), model.value(heater.name + ".gain", 1.0)});
  std::vector<ThermalCoupling> couplings;
  for (const auto& [a, b] : model.thermal.couplings)
    couplings.push_back({place(a), place(b), model.value(a + "-" + b + ".conductance")});
  std::vector<ThermalTerm> terms;
  for (const auto& term : model.terms)
    terms.push_back({thermal_kind(*term.info), term.values, place(term.on), place(term.with), term.curve,
                     !term.curve.knots.empty() && term.with == "power"});
  return {std::move(nodes), std::move(heaters), std::move(couplings), std::move(terms)};
}

}  // namespace invar::physics

// How the terms of a model enter an EquationsMachine.
#pragma once

#include "core/physics/equations_machine.hpp"

namespace invar::physics {

template <std::size_t lanes>
inline void EquationsMachine<lanes>::add(const Models& models, std::size_t t) {
  const Term& term = models[0]->terms[t];
  const auto* kind = equations_kind(*term.info);
  const std::size_t on = compiled_.place(term.on),
                    with = std::min(term.with.empty() ? on : compiled_.place(term.with),
                                    compiled_.variables() - 1);
  if (on >= states_) {  // at an input or output: the simulation bends those
    if (is_added(term)) add_to_output(models, t, with);
    return;
  }
  if (!term.curve.knots.empty()) {
    Course course;
    course.on = on;
    course.over = std::min(compiled_.place(term.curve.over), compiled_.variables() - 1);
    if (!term.with.empty()) course.with = with;
    for (std::size_t l = 0; l < lanes; ++l) course.curve[l] = &models[l]->terms[t].curve;
    curves_.push_back(course);
    return;
  }
  Use use{kind, on, with, {}, is_felt_by_others_alone(term)};
  if (use.by_others_alone && std::find(spared_.begin(), spared_.end(), on) == spared_.end())
    spared_.push_back(on);
  for (std::size_t l = 0; l < lanes; ++l) use.p[l] = models[l]->terms[t].values.data();
  if (kind->rate != nullptr) rate_terms_.push_back(use);
  switch (kind->memory) {
    case EquationsMemory::dry_friction:
      if (sticks(term))
        sticking_.push_back(use);
      else
        frictions_.push_back({use});
      break;
    case EquationsMemory::upper_limit:
      uppers_.push_back(use);
      break;
    case EquationsMemory::lower_limit:
      lowers_.push_back(use);
      break;
    case EquationsMemory::overflow:
      overflows_.push_back(use);
      break;
    case EquationsMemory::hidden_state:
      if (all_states() < most_states) hidden_.push_back(use);
      break;
    case EquationsMemory::lag:
      if (all_states() < most_states) lags_.push_back(use);
      break;
    case EquationsMemory::delay:
      delays_.push_back({use, {}});
      break;
    case EquationsMemory::dead_zone:
      dead_zones_.push_back(use);
      break;
    default:
      break;
  }
}

template <std::size_t lanes>
inline void EquationsMachine<lanes>::add_to_output(const Models& models, std::size_t t, std::size_t with) {
  const Term& term = models[0]->terms[t];
  const auto& equations = models[0]->equations;
  for (std::size_t o = 0; o < equations.outputs.size(); ++o) {
    if (place_of_output(equations, equations.outputs[o].name) != term.on) continue;
    const bool is_curve = !term.curve.knots.empty();
    Added added{o,
                is_curve ? compiled_.place(term.curve.over) : with,
                {equations_kind(*term.info), o, with, {}, false},
                {}};
    for (std::size_t l = 0; l < lanes; ++l) {
      added.use.p[l] = models[l]->terms[t].values.data();
      added.curve[l] = is_curve ? &models[l]->terms[t].curve : nullptr;
    }
    added.over = std::min(added.over, compiled_.variables() - 1);
    added_.push_back(added);
    shown_.resize(equations.outputs.size());
  }
}

}  // namespace invar::physics

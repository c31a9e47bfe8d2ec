// A loop whose recorded current is not what the law of the model asks for.
#include "core/diagnosis/search/search.hpp"

#include "core/diagnosis/search/one_name.hpp"
#include "core/diagnosis/search/verdict.hpp"

namespace invar::diagnosis {

bool Search::is_another_controller() {
  d_.off_law = off_the_law(data_);
  if (d_.off_law && d_.off_law->is_another_law()) d_.off_law->share = share_of_law(data_, d_.retuned.model);
  return d_.off_law && d_.off_law->is_chief();
}

void Search::stop_at_the_law() {
  check(options_.claims());
  d_.best = fit(data_, d_.weighing, data_.model, data_.model,
                Effort::evaluate());  // numbers that a wrong loop asks for are none
  for (auto* rows : {&d_.heldout, &d_.train})
    for (auto& row : *rows) row.after = row.before;
  conclude(data_, d_);
  say_controller();
}

void Search::say_controller() {
  d_.off_law->share = 1.0;  // nothing else explains any of it
  d_.verdict = Verdict::unknown_physics;
  d_.suspect = Suspect{"axis.controller", "controller", {"reference", "position"}};
}

bool Search::add_applied() {
  const auto& added = data_.beside_law;
  if (!added || options_.without.contains(added->info->name)) return false;
  progress_(0.06, "looking at the current beside the controller's law");
  auto model = d_.best.model;
  model.terms.push_back(*added);
  for (const int steps : {8, 6, 4}) {  // the nearer the fit, the finer its scale
    const auto weighing = weigh(data_, simulate(data_, model), Colour::white);
    model = fit(data_, weighing, model, data_.model, Effort::follow(steps)).model;
  }
  d_.weighing = weigh(data_, simulate(data_, model));
  d_.best = fit(data_, d_.weighing, model, data_.model, Effort::follow(4));
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, Effort::follow(5), &d_.retuned);
  if (added->curve.knots.empty()) {
    rivals_.emplace_back();
  } else {
    d_.is_unnamed = true;
    d_.findings.emplace_back().term = d_.best.model.terms.back();
  }
  return true;
}

}  // namespace invar::diagnosis

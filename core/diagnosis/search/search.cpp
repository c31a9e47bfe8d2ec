#include "core/diagnosis/search/search.hpp"

#include <tuple>
#include <utility>

#include "core/diagnosis/evidence/detectable.hpp"
#include "core/diagnosis/evidence/loop_noise.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/search/among_names.hpp"
#include "core/diagnosis/search/handed_over.hpp"
#include "core/diagnosis/search/one_name.hpp"
#include "core/diagnosis/search/unnamed.hpp"
#include "core/diagnosis/search/unsure.hpp"
#include "core/diagnosis/search/verdict.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

using physics::Model;
using physics::Plant;
using physics::Term;

void Search::check(Claims claims) {
  const Case fitted_to = data_;
  auto readings = noise_->put_back();
  try {
    hold_out(fitted_to, data_, d_, claims);
  } catch (const Stopped&) {
    noise_->put(std::move(readings));
    throw;
  }
  noise_->put(std::move(readings));
}

void Search::finish() {
  const auto named = std::tuple{d_.best, d_.weighing, d_.retuned, d_.findings};
  const bool is_at_drive = d_.is_unnamed;  // what stands in the current has its curve already
  progress_(0.75, "trying other causes in place of names");
  const bool any = d_.best.model.terms.size() > given();
  if (any && options_.refuses && !is_at_drive)
    take("other causes in place of names", [&] { return doubt(data_, d_, beside_), true; });
  progress_(0.78, "looking for physics without a name");
  take("physics without a name", [&] {
    if (is_at_drive) return true;
    // Only of equations the spans go with the model; all else was looked at already.
    if (!beside_ || data_.model.plant == physics::Plant::equations)
      beside_ = courses_beside(data_, d_.best, &d_.best);
    const auto without_rest = d_;
    add_unnamed(data_, d_, *beside_);
    name_friction_beside(data_, d_, options_.without);
    if (d_.has_rest && !noise_->shows(d_.best.model, without_rest.best.model, thresholds::seen_beside))
      d_ = without_rest;
    return true;
  });
  const bool curved = d_.is_unnamed || d_.has_rest;
  // What a run without noise left over may be what noise makes of the others.
  if (!curved && any) take("the noise of what was found", [&] { return settle(), true; });
  if (!curved && any && options_.refuses)
    take(all_needed, [&] { return prune(data_, d_, rivals_, options_.without), true; });
  if (!curved && options_.refuses) take(all_needed, [&] { return leave_out_drift(data_, d_); });
  if (d_.best.model.terms.size() > given() && options_.refuses)
    take(all_needed, [&] { return leave_out_nothings(data_, d_), true; });
  progress_(0.88, "checking on held-out stretches");
  const auto checked = [&] { return check(options_.claims()), true; };
  if (!take("refits to their end on held-out stretches", checked)) {  // in few steps, and not to be stopped
    d_.is_partial = true;
    data_.stop = {};
    (void)checked();
  }
  d_.is_partial = stopped();
  data_.stop = {};
  if (curved && d_.findings.empty() &&
      !std::get<3>(named).empty()) {  // the curve does not hold, what has a name may
    std::tie(d_.best, d_.weighing, d_.retuned, d_.findings) = named;
    d_.heldout.clear();
    d_.train.clear();
    check(Claims::checked);
  }
  smallest_effects(data_, last_screen_, d_);
  conclude(data_, d_);
  if (options_.refuses && leave_out_unseen(d_)) conclude(data_, d_);
}

Diagnosis Search::run() {
  data_.stop = options_.stop;
  try {
    prepare();
  } catch (const Stopped&) {  // the model as it stands
    data_.stop = {};
    if (!noise_) noise_.emplace(data_);
    d_.weighing = weigh(data_, simulate(data_, data_.model), Colour::white);
    d_.best = d_.retuned = fit(data_, d_.weighing, data_.model, data_.model, Effort::evaluate());
    data_.stop = options_.stop;
    leave(own_numbers);
  }
  const bool is_applied = options_.refuses && take(beside_the_law, [&] { return add_applied(); });
  if (!is_applied && options_.refuses &&
      take("the controller's law", [&] { return is_another_controller(); })) {
    stop_at_the_law();
    return d_;
  }
  if (d_.is_unnamed) {
    finish();
    return d_;
  }
  const Diagnosis begun = d_;
  const bool paired = is_equations() && take("two terms at once", [&] { return add_pair(); });
  name(!paired                                                                     ? (is_applied ? 1 : 0)
       : take("one term in place of two", [&] { return put_one_in_place(begun); }) ? 1
                                                                                   : 2);
  finish();
  if (!is_equations() && !is_applied) try_pairs(begun);
  try_believed(begun);
  try_other_power(begun);
  if (options_.refuses && !d_.is_partial) {
    const auto stated = d_;
    if (set_aside(data_, d_)) {
      d_.heldout.clear();
      d_.train.clear();
      check(Claims::checked);
      if (d_.findings.empty())
        d_ = stated;  // the curve does not hold
      else
        conclude(data_, d_);
    }
  }
  data_.count.left_to_chance = noise_->left_to_chance();
  (void)noise_->put_back();
  if (d_.findings.empty() && d_.off_law && d_.off_law->is_another_law()) say_controller();
  say_not_tried(d_, not_tried_);
  return d_;
}

}  // namespace invar::diagnosis

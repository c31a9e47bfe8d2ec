// The search begun anew from elsewhere: from two terms at once, or from the numbers that the user believes.
#include "core/diagnosis/search/search.hpp"

#include <algorithm>
#include <utility>

#include "core/diagnosis/candidates/kin.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/detectable.hpp"
#include "core/diagnosis/evidence/loop_noise.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/search/one_name.hpp"
#include "core/diagnosis/search/pairs.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

template <class Start, class Better>
void Search::begin_anew(const Diagnosis& begun, int next, Start start, Better better) {
  auto before = std::exchange(d_, begun);
  auto readings = noise_->put_back();
  const auto screened = std::exchange(last_screen_, {});
  rivals_.assign(begun.best.model.terms.size() - given(), {});
  beside_.reset();
  data_.stop = options_.stop;
  if (take("the search begun anew", [&] { return start(before); })) {
    name(next);
    finish();
  }
  data_.stop = {};
  auto anew = noise_->put_back();
  if (!better(before)) {
    before.is_partial = before.is_partial || stopped();
    d_ = std::move(before);
    noise_->put(std::move(readings));
    return;
  }
  noise_->put(std::move(anew));
  for (const auto& r : before.rejected) d_.reject(r.term, r.why, r.gain);
  std::erase_if(d_.rejected, [&](const Rejection& r) {
    return std::any_of(d_.findings.begin(), d_.findings.end(),
                       [&](const Finding& f) { return f.term.info->name == r.term; });
  });
  d_.detectable.clear();
  smallest_effects(data_, screened, d_);
}

void Search::try_pairs(const Diagnosis& begun) {
  const bool has_rest = d_.verdict == Verdict::unknown_physics || d_.verdict == Verdict::partly_explained ||
                        (d_.verdict == Verdict::ambiguous && d_.still_follows > thresholds::little_left);
  if (!has_rest || !options_.refuses || was_stopped("two terms at once")) return;
  begin_anew(
      begun, 2, [&](const Diagnosis& single) { return add_pair(&single.best); },
      [&](const Diagnosis& single) {
        return d_.findings.size() >= 2 && !d_.is_unnamed &&
               lead(data_, d_.best, single.best) >= thresholds::claim_margin;
      });
}

void Search::try_believed(const Diagnosis& begun) {
  if (!(d_.parameter_excursion > thresholds::far_astray) || !options_.refuses ||
      was_stopped("a name sought from the numbers that the user believes"))
    return;
  begin_anew(
      begun, 1,
      [&](const Diagnosis&) {
        auto sought = seek(From::believed, 0.9);
        if (!sought.best || sought.best->gain < margin()) return false;
        claim(std::move(sought));
        return true;
      },
      [&](const Diagnosis& astray) {
        return !d_.findings.empty() && !(d_.parameter_excursion > thresholds::far_astray) &&
               lead(data_, d_.best, astray.best) > -thresholds::claim_margin;
      });
}

void Search::try_other_power(const Diagnosis& begun) {
  if (!is_quick(data_) || d_.findings.size() < 2 || !options_.refuses) return;
  const auto chief = std::max_element(d_.findings.begin(), d_.findings.end(),
                                      [](const Finding& a, const Finding& b) { return a.share < b.share; });
  if (chief->term.info->power == 0 || was_stopped("another power in place of the chief effect's")) return;
  const physics::Term term = chief->term;
  begin_anew(
      begun, 1,
      [&](const Diagnosis&) {
        auto model = begun.best.model;
        model.terms.push_back(term);
        const auto plain = weigh(data_, simulate(data_, model), Colour::white);
        const auto alone = fit(data_, plain, model, data_.model, Effort::follow(8));
        auto others = fits_of_other_laws(data_, plain, alone, given(), options_.without);
        std::erase_if(others, [&](const Fit& f) { return !stands(data_, f, given()); });
        if (others.empty()) return false;
        d_.best = std::move(others.front());
        d_.weighing = weigh(data_, simulate(data_, d_.best.model));
        rivals_.assign(1, {alone.model.terms.back()});
        return true;
      },
      [&](const Diagnosis& before) {
        return !d_.is_unnamed && lead(data_, d_.best, before.best) >= thresholds::claim_margin;
      });
}

}  // namespace invar::diagnosis

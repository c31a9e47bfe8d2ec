#include "core/diagnosis/search/search.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>

#include "core/diagnosis/candidates/kin.hpp"
#include "core/diagnosis/checks/added_to_command.hpp"
#include "core/diagnosis/checks/own_units.hpp"
#include "core/diagnosis/dataset/outliers.hpp"
#include "core/diagnosis/estimate/unknown_sizes.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/detectable.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/evidence/loop_noise.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/evidence/shaken_loose.hpp"
#include "core/diagnosis/search/among_names.hpp"
#include "core/diagnosis/search/handed_over.hpp"
#include "core/diagnosis/search/misrecorded.hpp"
#include "core/diagnosis/search/one_name.hpp"
#include "core/diagnosis/search/pairs.hpp"
#include "core/diagnosis/search/quiet_inputs.hpp"
#include "core/diagnosis/search/reference_hold.hpp"
#include "core/diagnosis/search/steady_speed.hpp"
#include "core/diagnosis/search/unnamed.hpp"
#include "core/diagnosis/search/unsure.hpp"
#include "core/diagnosis/search/verdict.hpp"
#include "core/diagnosis/segments/steps.hpp"
#include "core/diagnosis/segments/windows.hpp"

namespace invar::diagnosis {

namespace {

using physics::Model;
using physics::Plant;
using physics::Role;
using physics::Term;

/// Has no number of a term that stands in both moved by more than a fiftieth?
bool settled(const Model& before, const Model& now) {
  for (std::size_t t = 0; t < now.terms.size(); ++t)
    for (std::size_t i = 0; i < now.terms[t].info->parameter_count(); ++i)
      if (now.terms[t].info->parameters[i].role == Role::amplitude &&
          std::abs(now.terms[t].values[i] - before.terms[t].values[i]) >
              0.02 * std::abs(before.terms[t].values[i]))
        return false;
  return true;
}

/// Does a run stay far from the machine for long, by far more than what comes anew from row to row (second differences: a
/// motion at a steady rate is none)?
bool goes_another_way(const Case& data, const Fit& fit) {
  constexpr double far = 20.0;
  const auto simulated = simulate(data, fit.model);
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    std::vector<double> left, anew;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& y = data.recordings[r].measured[o];
      for (std::size_t i = 0; i < y.size(); ++i) {
        left.push_back(y[i] - simulated[r][o][i]);
        if (i > 1) anew.push_back((y[i] - 2.0 * y[i - 1] + y[i - 2]) / std::sqrt(6.0));
      }
    }
    for (auto* all : {&left, &anew}) std::erase_if(*all, [](double e) { return !std::isfinite(e); });
    if (robust_sigma(left) > far * robust_sigma(anew)) return true;
  }
  return false;
}

/// Steps of the search, as the report names those that were not tried.
constexpr const char* own_numbers = "the model's own numbers refitted to their end";
constexpr const char* in_step_columns = "columns that come early";
constexpr const char* quiet_inputs = "inputs without their noise";
constexpr const char* all_needed = "whether all that was found is needed";
constexpr const char* rivals_weighed = "other names in place of what was found";

void add_once(std::vector<std::string>& all, const std::string& one) {
  if (std::find(all.begin(), all.end(), one) == all.end()) all.push_back(one);
}

/// Adds what was not tried. Whoever reads the verdict alone must not take half a search for a whole one that found nothing, nor
/// a name for sure that was never held against its rivals.
void say_not_tried(Diagnosis& d, const std::vector<std::string>& not_tried) {
  for (const auto& one : not_tried) add_once(d.not_tried, one);
  d.is_partial = d.is_partial || !d.not_tried.empty();
  const bool is_unweighed =
      std::find(d.not_tried.begin(), d.not_tried.end(), rivals_weighed) != d.not_tried.end();
  if (d.is_partial && (d.findings.empty() || (is_unweighed && d.verdict == Verdict::explained)))
    d.verdict = Verdict::ambiguous;
}

class Search {
 public:
  Search(Case& data, const std::function<void(double, const std::string&)>& progress, const Options& options)
      : data_{data},
        // What is sought again from elsewhere does not go back on the bar.
        progress_{[this, &progress](double share, const std::string& what) {
          progress(reached_ = std::max(reached_, share), what);
        }},
        options_{options} {}
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;

  Diagnosis run();

 private:
  /// The model fitted to the readings without those that stand far from their neighbours.
  void begin();
  void prepare();
  /// From where a name is sought: the best model under the filters of its residual, with every row alike, or, where what is
  /// missing led the user's numbers astray, from what he believes.
  enum class From { coloured, plain, believed };
  struct Sought {
    Fit base;
    std::vector<Fit> fits;  // the short list
    std::optional<OneName> best;
  };
  Sought seek(From from, double share);
  /// Why a name that pays is not claimed beside others.
  std::optional<std::string> why_not(const OneName& name);
  bool add_named(double round);
  /// Does a name do no more than lead the user's numbers out of a valley in which they were stuck (a pendulum that went over
  /// the top)? Then the search goes on from there. Asked once.
  bool leads_out(const OneName& name);
  void claim(Sought sought);
  /// In a window of its own friction looks like a motor without force, and from numbers that went far astray what is missing
  /// may look like its own opposite: from there no name is found.
  [[nodiscard]] bool may_lead_astray(const Fit& fit) const {
    return (data_.model.plant == physics::Plant::axis && data_.windows.count > 0) ||
           (data_.model.plant == physics::Plant::error_map && excursion_of(fit) > 5.0);
  }
  /// Two terms at once, where neither does anything alone. `rival`: what the search one by one came to.
  bool add_pair(const Fit* rival = nullptr);
  /// Where a pair leads the user's numbers far astray: one name that does better from what he believes, in its place.
  bool put_one_in_place(const Diagnosis& begun);
  /// Claims friction, play or a dead zone that the noise shakes loose, where it explains more than what leads without noise
  /// (null: nothing does). Where that is the same, it gets its size under noise and is left to be claimed.
  bool take_shaken(const Fit& base, Fit* otherwise);
  /// Names one by one, weighed against each other, on top of what is claimed.
  void name(int first_round);
  /// What has no name, what holds on held-out stretches, and the verdict.
  void finish();
  /// Where names one by one leave a rest or none is found: begins anew with two at once and keeps what explains more.
  void try_pairs(const Diagnosis& begun);
  /// Where names lead the user's numbers far astray: begins anew with one that is sought from what he believes.
  void try_believed(const Diagnosis& begun);
  /// Begins anew with what `start` claims, goes on from round `next` and keeps what is `better` than before.
  template <class Start, class Better>
  void begin_anew(const Diagnosis& begun, int next, Start start, Better better);
  /// Is most of what there is to explain that the machine's controller is another than the model's?
  bool is_another_controller();
  /// What is said then: nothing of what lies behind it.
  void stop_at_the_law();
  void say_controller();
  /// Claims what stands in the recorded current beside the law; false: nothing does.
  bool add_applied();
  /// Takes off the readings what their noise makes of the claims so far, and fits anew. The share of rows that it leaves to
  /// chance.
  double quieten();
  /// The same until the strengths stay: what noise makes of a bend goes with its size, which a fit to readings that still
  /// hold it takes too small.
  void settle();
  /// Holds the model out: on the readings that it was fitted to, and told of those recorded.
  void check(bool refuses);
  /// Takes a step; one that is interrupted counts for nothing, so that nothing is claimed on half a fit. False: not taken,
  /// or the step says so.
  template <class Step>
  bool take(const std::string& what, Step step) {
    if (was_stopped(what)) return false;
    const auto kept = std::tuple{d_, rivals_};
    const auto readings = noise_->now();
    try {
      return step();
    } catch (const Stopped&) {
      std::tie(d_, rivals_) = kept;
      noise_->put(readings);
      beside_.reset();
      leave(what);
      return false;
    }
  }
  [[nodiscard]] bool stopped() const { return options_.stopped && options_.stopped(); }
  void leave(const std::string& what) { add_once(not_tried_, what); }
  /// Is it over? Then `what` is not tried.
  [[nodiscard]] bool was_stopped(const std::string& what) {
    const bool is_over = stopped();
    if (is_over) leave(what);
    return is_over;
  }
  [[nodiscard]] double margin() const { return options_.refuses ? claim_margin_of(d_.weighing) : 0.0; }
  [[nodiscard]] bool is_equations() const { return data_.model.plant == physics::Plant::equations; }
  [[nodiscard]] std::size_t given() const { return data_.model.terms.size(); }

  Case& data_;
  double reached_ = 0.0;
  const std::function<void(double, const std::string&)> progress_;
  const Options& options_;
  Diagnosis d_;
  Rivals rivals_;
  std::vector<Screened> last_screen_;
  std::vector<Model> alone_;  // with one term, which a pair that was tried came to
  std::optional<LoopNoise> noise_;
  bool led_out_ = false;
  std::optional<Beside> beside_;  // of the best model, once it was looked for
  std::vector<std::string> not_tried_;
};

void Search::begin() {
  progress_(0.02, "simulating the nominal model");
  const auto simulated = simulate(data_, data_.model);
  drop_outliers(data_, simulated);
  d_.weighing = weigh(data_, simulated, false);  // far from the truth a filter would hide what to follow
  d_.retuned = fit(data_, d_.weighing, data_.model, data_.model, 8);
}

void Search::prepare() {
  find_unknown_sizes(data_);
  const Case as_given = data_;
  cut_into_windows(data_);
  Case as_read = data_;
  begin();
  if (goes_another_way(data_, d_.retuned))
    if (const auto near = begun_in_windows(data_)) {
      const auto found = fit(data_, d_.weighing, *near, data_.model, 8);
      if (least_ratio(data_, found, d_.retuned) < 0.5) d_.retuned = found;
      // What is thrown here and there by the least disturbance has no one run.
      if (auto cut = as_given; goes_another_way(data_, d_.retuned)) {
        cut_into_windows(cut, *near);
        if (cut.windows.count > 0) {
          data_ = std::move(cut);
          as_read = data_;
          begin();
        }
      }
    }
  drop_outliers_anew(data_, as_read, simulate(data_, d_.retuned.model));
  for (int again = 0; again < 2; ++again) {  // the nearer the fit, the finer its scale
    d_.weighing = weigh(data_, simulate(data_, d_.retuned.model), false);
    d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 8);
  }
  std::vector<double> noise;
  for (const auto& filter : d_.weighing.filters) noise.push_back(filter.sigma);
  if (step_finely(data_, d_.retuned.model, noise))
    for (int again = 0; again < 2; ++again) {
      d_.weighing = weigh(data_, simulate(data_, d_.retuned.model), false);
      d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 8);
    }
  check_own_units(data_, d_.retuned);
  noise_.emplace(data_);
  d_.weighing = weigh(data_, simulate(data_, d_.retuned.model));
  // Coloured weights may follow the colour of what is missing; a fit that they make plainly worse is not taken.
  auto coloured = fit(data_, d_.weighing, d_.retuned.model, data_.model, 6, &d_.retuned);
  d_.retuned = least_ratio(data_, d_.retuned, coloured) < 0.9
                   ? fit(data_, d_.weighing, d_.retuned.model, data_.model, 0, &d_.retuned)
                   : std::move(coloured);
  d_.best = d_.retuned;
}

Search::Sought Search::seek(From from, double share) {
  // Filters fitted to a residual that is not noise yet take much of the effect away; where they leave nothing to see,
  // every row counts alike. Either way a claim is judged under the filters of its own residual.
  const bool coloured = from == From::coloured;
  Sought sought;
  const Weighing weighing =
      coloured ? d_.weighing
               : weigh(data_, simulate(data_, from == From::believed ? data_.model : d_.best.model), false);
  sought.base = coloured ? d_.best : fit(data_, weighing, d_.best.model, data_.model, 4, &d_.best);
  progress_(share, "screening candidates");
  const Naming naming{data_, *noise_, options_, rivals_.empty(), margin()};
  const bool is_first = d_.best.model.terms.size() == given();
  auto list = shortlisted(
      naming, weighing,
      from == From::believed ? fit(data_, weighing, data_.model, data_.model, 0) : sought.base,
      is_first ? alone_ : std::vector<Model>{}, [&] { progress_(share + 0.04, "fitting the short list"); });
  for (const auto& r : list.impossible) d_.reject(r.term, r.why, r.gain);
  last_screen_ = std::move(list.screened);
  sought.fits = std::move(list.fits);
  sought.best = leader(naming, sought.base, sought.fits);
  return sought;
}

std::optional<std::string> Search::why_not(const OneName& name) {
  if (rivals_.empty() || !options_.refuses) return std::nullopt;
  const auto &with = name.with, &without = name.without;
  if (!noise_->shows(with.model, without.model, 0.95) &&
      noise_->gain(with.model, without.model, name.weighing) < plainly * margin())
    return "in the noise of this loop its effect would not show";
  if (is_trifle(data_, d_.retuned, without, with))
    return "less than what the idealised form of the others may leave";
  // What the wrong form of an earlier term leaves over is no further physics.
  if (const auto other = other_form(data_, name.weighing, without, with))
    return "another course of " + std::string{without.model.terms[other->term].info->name} +
           " over its own variable explains the same";
  return std::nullopt;
}

bool Search::leads_out(const OneName& name) {
  if (std::exchange(led_out_, true)) return false;
  const auto model = physics::without_term(name.with.model, given());
  auto anew = fit(data_, name.weighing, model, data_.model, 8, &name.with);
  if (!(anew.cost < name.without.cost) || least_ratio(data_, anew, name.without) > 0.7) return false;
  d_.weighing = weigh(data_, simulate(data_, anew.model), false);
  anew = fit(data_, d_.weighing, anew.model, data_.model, 8, &anew);
  d_.weighing = weigh(data_, simulate(data_, anew.model));
  d_.best = d_.retuned = fit(data_, d_.weighing, anew.model, data_.model, 4, &anew);
  return true;
}

/// Adds the term that explains most, if one stands under the filters that its own residual asks for.
bool Search::add_named(double round) {
  const bool is_first = d_.best.model.terms.size() == given();
  for (const auto from : {From::coloured, From::plain, From::believed}) {
    if (from == From::believed && !(is_first && may_lead_astray(d_.best))) break;
    const double share = 0.1 + 0.2 * round + (from == From::coloured ? 0.0 : 0.1);
    auto sought = seek(from, share);
    const bool pays = sought.best && sought.best->gain >= margin();
    if (from == From::coloured && take_shaken(sought.base, pays ? &sought.best->with : nullptr)) return true;
    if (!pays) {
      for (const auto& f : sought.fits)
        d_.reject(std::string{f.model.terms.back().info->name},
                  "what it explains is no more than chance would", f.evidence - sought.base.evidence);
      continue;
    }
    const auto rather = [&](From other_base) {
      if (auto other = seek(other_base, share); other.best && other.best->gain >= margin() &&
                                                lead(data_, other.best->with, sought.best->with) > 0.0)
        sought = std::move(other);
    };
    // What is steady or slow is not seen through filters that hold it for noise; what is swift is, and comes first.
    if (is_first && data_.is_time_series && !noise_->is_fed_back() && from == From::coloured)
      rather(From::plain);
    if (is_first && is_equations() && excursion_of(sought.best->with) > far_astray) rather(From::believed);
    const auto& best = *sought.best;
    if (is_first && is_equations() && leads_out(best)) return add_named(round);
    if (const auto why = why_not(best)) {
      d_.reject(std::string{best.with.model.terms.back().info->name}, *why, best.gain);
      continue;
    }
    claim(std::move(sought));
    return true;
  }
  return false;
}

void Search::claim(Sought sought) {
  auto& [base, fits, best] = sought;
  std::vector<Term> rivals;
  std::set<std::string> named{label(best->with.model.terms.back())};
  for (const auto& f : fits) {
    if (!named.insert(label(f.model.terms.back())).second) continue;
    if (f.evidence > base.evidence + 0.3 * (fits[best->place].evidence - base.evidence) && rivals.size() < 4)
      rivals.push_back(f.model.terms.back());
    else
      d_.reject(std::string{f.model.terms.back().info->name}, "another term explains the same better",
                f.evidence - base.evidence);
  }
  if (auto twin = twin_at_steady_speed(data_, best->with.model.terms.back()))
    rivals.push_back(std::move(*twin));
  d_.weighing = std::move(best->weighing);
  d_.best = std::move(best->with);
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 5, &d_.retuned);
  rivals_.push_back(std::move(rivals));
}

bool Search::take_shaken(const Fit& base, Fit* otherwise) {
  if (!options_.refuses) return false;
  const auto found = shaken_loose(data_, *noise_, d_.weighing, base, options_.without);
  if (!found || found->gain < (rivals_.empty() ? 1.0 : plainly) * margin()) return false;
  if (otherwise != nullptr) {
    const double numbers =
                     static_cast<double>(otherwise->free.size()) - static_cast<double>(base.free.size()),
                 rows = std::max(10.0, found->weighing.temper * static_cast<double>(base.residual.size())),
                 gain = noise_->gain(otherwise->model, found->without, found->weighing) -
                        0.5 * numbers * std::log(rows);
    if (gain > found->gain) return false;
    const auto &term = otherwise->model.terms.back(), &own = found->model.terms.back();
    if (term.info == own.info) {
      otherwise->model = found->model;
      return false;
    }
    if (term.info->is_friction && own.info->is_friction)
      return false;  // of the laws the ordinary way decides
  }
  const auto without = d_;
  const auto readings = noise_->now();
  d_.best.model = found->model;
  (void)quieten();
  if (!stands(data_, d_.best, d_.best.model.terms.size() - 1)) {
    d_ = without;
    noise_->put(readings);
    return false;
  }
  rivals_.emplace_back();
  if (otherwise != nullptr)
    d_.reject(std::string{otherwise->model.terms.back().info->name},
              "what the noise shakes loose explains the same better", found->gain);
  return true;
}

double Search::quieten() {
  if (!options_.refuses || data_.model.plant != physics::Plant::axis) return 0.0;
  const double untold = noise_->take_off(d_.best.model);
  d_.weighing = weigh(data_, simulate(data_, d_.best.model));
  d_.best = fit(data_, d_.weighing, d_.best.model, data_.model, 4, &d_.best);
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 4, &d_.retuned);
  return untold;
}

void Search::settle() {
  if (d_.best.model.terms.size() == given()) return;
  for (int again = 0; again < 4; ++again) {
    const auto was = d_.best.model;
    (void)quieten();
    if (settled(was, d_.best.model)) return;
  }
}

void Search::check(bool refuses) {
  const Case fitted_to = data_;
  auto readings = noise_->put_back();
  try {
    hold_out(fitted_to, data_, d_, refuses);
  } catch (const Stopped&) {
    noise_->put(std::move(readings));
    throw;
  }
  noise_->put(std::move(readings));
}

bool Search::add_pair(const Fit* rival) {
  progress_(rival == nullptr ? 0.05 : 0.9, "screening pairs");
  auto [claim, alone] = claim_pair(data_, d_.best, options_.without, rival);
  alone_ = std::move(alone);
  if (!claim) return false;
  d_.best = std::move(claim->fit);
  d_.weighing = std::move(claim->weighing);
  rivals_ = std::move(claim->rivals);
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 5, &d_.retuned);
  (void)quieten();
  return true;
}

bool Search::put_one_in_place(const Diagnosis& begun) {
  if (!(excursion_of(d_.best) > far_astray)) return false;
  auto pair = std::exchange(d_, begun);
  auto pairs_rivals = std::exchange(rivals_, {});
  auto screened = last_screen_;
  auto sought = seek(From::believed, 0.1);
  if (sought.best && sought.best->gain >= margin() && lead(data_, sought.best->with, pair.best) > 0.0) {
    claim(std::move(sought));
    return true;
  }
  d_ = std::move(pair);
  rivals_ = std::move(pairs_rivals);
  last_screen_ = std::move(screened);
  return false;
}

void Search::name(int first_round) {
  for (int round = first_round; round < 3; ++round)
    if (!take("further terms of the library", [&] { return add_named(round); }) ||
        !take("further terms of the library", [&] {
          if (quieten() > 0.02) settle();  // which rows are chance shows once the claims have their size
          return true;
        }))
      break;
  if (rivals_.empty()) return;
  take("other laws of the same kind",
       [&] { return put_laws_right(data_, d_, rivals_, options_.without), true; });
  if (options_.refuses) take(all_needed, [&] { return prune(data_, d_, rivals_, options_.without), true; });
  progress_(0.7, "comparing with near twins");
  if (!take(rivals_weighed, [&] { return weigh_alternatives(data_, d_, rivals_, options_.refuses), true; })) {
    data_.stopped = {};
    weigh_alternatives(data_, d_, rivals_, options_.refuses);  // the terms as they stand
  }
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
    if (d_.has_rest && !noise_->shows(d_.best.model, without_rest.best.model, 0.9)) d_ = without_rest;
    return true;
  });
  const bool curved = d_.is_unnamed || d_.has_rest;
  // What a run without noise left over may be what noise makes of the others.
  if (!curved && any) take("the noise of what was found", [&] { return settle(), true; });
  if (!curved && any && options_.refuses)
    take(all_needed, [&] { return prune(data_, d_, rivals_, options_.without), true; });
  if (d_.best.model.terms.size() > given() && options_.refuses)
    take(all_needed, [&] { return leave_out_nothings(data_, d_), true; });
  progress_(0.88, "checking on held-out stretches");
  const auto checked = [&] { return check(options_.refuses), true; };
  if (!take("refits to their end on held-out stretches", checked)) {  // in few steps, and not to be stopped
    d_.is_partial = true;
    data_.stopped = {};
    (void)checked();
  }
  d_.is_partial = stopped();
  data_.stopped = {};
  if (curved && d_.findings.empty() &&
      !std::get<3>(named).empty()) {  // the curve does not hold, what has a name may
    std::tie(d_.best, d_.weighing, d_.retuned, d_.findings) = named;
    d_.heldout.clear();
    d_.train.clear();
    check(true);
  }
  smallest_effects(data_, last_screen_, d_);
  conclude(data_, d_);
  if (options_.refuses && leave_out_unseen(d_)) conclude(data_, d_);
}

template <class Start, class Better>
void Search::begin_anew(const Diagnosis& begun, int next, Start start, Better better) {
  auto before = std::exchange(d_, begun);
  auto readings = noise_->put_back();
  const auto screened = std::exchange(last_screen_, {});
  rivals_.assign(begun.best.model.terms.size() - given(), {});
  beside_.reset();
  data_.stopped = options_.stopped;
  if (take("the search begun anew", [&] { return start(before); })) {
    name(next);
    finish();
  }
  data_.stopped = {};
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
                        (d_.verdict == Verdict::ambiguous && d_.still_follows > 0.05);
  if (!has_rest || !options_.refuses || was_stopped("two terms at once")) return;
  begin_anew(
      begun, 2, [&](const Diagnosis& single) { return add_pair(&single.best); },
      [&](const Diagnosis& single) {
        return d_.findings.size() >= 2 && !d_.is_unnamed && lead(data_, d_.best, single.best) >= claim_margin;
      });
}

void Search::try_believed(const Diagnosis& begun) {
  if (!(d_.parameter_excursion > far_astray) || !options_.refuses ||
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
        return !d_.findings.empty() && !(d_.parameter_excursion > far_astray) &&
               lead(data_, d_.best, astray.best) > -claim_margin;
      });
}

bool Search::is_another_controller() {
  d_.off_law = off_the_law(data_);
  if (d_.off_law && d_.off_law->is_another_law()) d_.off_law->share = share_of_law(data_, d_.retuned.model);
  return d_.off_law && d_.off_law->is_chief();
}

void Search::stop_at_the_law() {
  check(options_.refuses);
  d_.best =
      fit(data_, d_.weighing, data_.model, data_.model, 0);  // numbers that a wrong loop asks for are none
  for (auto* rows : {&d_.heldout, &d_.train})
    for (auto& row : *rows) row.after = row.before;
  conclude(data_, d_);
  say_controller();
  progress_(1.0, "done");
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
  for (const int iterations : {8, 6, 4}) {  // the nearer the fit, the finer its scale
    const auto weighing = weigh(data_, simulate(data_, model), false);
    model = fit(data_, weighing, model, data_.model, iterations).model;
  }
  d_.weighing = weigh(data_, simulate(data_, model));
  d_.best = fit(data_, d_.weighing, model, data_.model, 4);
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 5, &d_.retuned);
  if (added->curve.knots.empty()) {
    rivals_.emplace_back();
  } else {
    d_.is_unnamed = true;
    d_.findings.emplace_back().term = d_.best.model.terms.back();
  }
  return true;
}

Diagnosis Search::run() {
  data_.stopped = options_.stopped;
  try {
    prepare();
  } catch (const Stopped&) {  // the model as it stands
    data_.stopped = {};
    if (!noise_) noise_.emplace(data_);
    d_.weighing = weigh(data_, simulate(data_, data_.model), false);
    d_.best = d_.retuned = fit(data_, d_.weighing, data_.model, data_.model, 0);
    data_.stopped = options_.stopped;
    leave(own_numbers);
  }
  const bool is_applied =
      options_.refuses && take("the current beside the controller's law", [&] { return add_applied(); });
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
  if (options_.refuses && !d_.is_partial) {
    const auto stated = d_;
    if (set_aside(data_, d_)) {
      d_.heldout.clear();
      d_.train.clear();
      check(true);
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
  progress_(1.0, "done");
  return d_;
}

/// How much a verdict says of what is missing.
int named_by(const Diagnosis& d) {
  return d.verdict == Verdict::explained                                             ? 2
         : d.verdict == Verdict::partly_explained || d.verdict == Verdict::ambiguous ? 1
                                                                                     : 0;
}

/// Does the one leave plainly less of an output than the other? What lags behind its inputs is like one whose inputs were
/// smoothed, but not as near.
bool is_nearer(const Case& data, const Diagnosis& d, const Case& other_data, const Diagnosis& other) {
  constexpr double plainly_less = 0.7;  // of the squares
  const auto left = squares_left(data, d.best.model),
             left_by_other = squares_left(other_data, other.best.model);
  for (std::size_t o = 0; o < left.size(); ++o)
    if (left[o] < plainly_less * left_by_other[o]) return true;
  return false;
}

}  // namespace

Diagnosis search(Case& data, const std::function<void(double, const std::string&)>& progress,
                 const Options& options) {
  std::vector<std::string> not_tried;
  // A step beside the search proper: one that is interrupted counts for nothing. Beside half a search none is taken.
  Diagnosis d;
  const auto unless_over = [&](const char* what, auto step) -> decltype(step()) {
    if (d.is_partial) return {};
    data.stopped = options.stopped;
    try {
      if (!data.stopped || !data.stopped()) {
        auto found = step();
        data.stopped = {};
        return found;
      }
    } catch (const Stopped&) {
    }
    data.stopped = {};
    add_once(not_tried, what);
    return {};
  };
  if (data.model.plant == Plant::axis)
    unless_over("how the reference goes on between rows", [&] { return settle_hold(data), true; });
  if (data.model.plant == Plant::axis)
    unless_over("the current beside the controller's law",
                [&] { return settle_recorded_current(data), true; });
  Case as_read = data;
  as_read.stopped = {};
  d = Search{data, progress, options}.run();
  if (!options.refuses) return d;
  if (auto in_step = unless_over(in_step_columns, [&] { return with_columns_in_step(as_read, data, d); })) {
    Case before_search = *in_step;
    before_search.remembered = std::make_shared<Remembered>();
    auto after = Search{*in_step, progress, options}.run();
    if (after.is_partial) {
      add_once(not_tried, in_step_columns);
    } else if (!comes_late_again(*in_step, after)) {
      as_read = std::move(before_search);
      data = std::move(*in_step);
      d = std::move(after);
    }
  }
  if ((named_by(d) < 2 || d.findings.size() > 1) && !d.is_partial && has_longer_windows(data)) {
    Case longer = as_read;
    longer.windows.few = true;
    longer.remembered = std::make_shared<Remembered>();
    auto in_long = Search{longer, progress, options}.run();
    if (in_long.is_partial) add_once(not_tried, "longer windows");
    // The same with fewer names is what more evidence makes of it.
    if (!in_long.is_partial && (named_by(in_long) > named_by(d) ||
                                (named_by(in_long) == 2 && in_long.findings.size() < d.findings.size()))) {
      as_read.windows.few = true;
      data = std::move(longer);
      d = std::move(in_long);
    }
  }
  if (auto quiet = unless_over(quiet_inputs, [&] { return with_quiet_inputs(as_read, data, d); })) {
    auto in_quiet = Search{*quiet, progress, options}.run();
    if (in_quiet.is_partial || !is_nearer(data, d, *quiet, in_quiet)) {
      data = std::move(*quiet);
      d = std::move(in_quiet);
    }
  }
  say_not_tried(d, not_tried);
  return d;
}

}  // namespace invar::diagnosis

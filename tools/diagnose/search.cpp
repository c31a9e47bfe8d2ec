#include "tools/diagnose/search.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "tools/diagnose/screen.hpp"

namespace invar::diagnose {

namespace {

using physics::Model;
using physics::Role;
using physics::Term;

constexpr auto none = physics::most_parameters;

std::string label(const Term& term) {
  std::string text{term.info->name};
  if (!term.on.empty()) text += "@" + term.on;
  if (!term.with.empty()) text += "+" + term.with;
  return text;
}

/// A claim must have a strength that is possible and clearly not zero.
bool stands(const Fit& fit, std::size_t term) {
  const auto& info = *fit.model.terms[term].info;
  const auto& values = fit.model.terms[term].values;
  // A shape at the end of its range is another term in disguise.
  for (std::size_t i = 0; i < info.parameter_count(); ++i) {
    const auto& p = info.parameters[i];
    if (p.role == Role::amplitude && p.bounds.upper < 1e100 && std::abs(values[i]) > 0.99 * p.bounds.upper)
      return false;
    if (p.role != Role::shape || p.name == "center" || p.name == "limit") continue;
    if (p.bounds.lower > 0.0 && p.bounds.upper > 100.0 * p.bounds.lower && values[i] < 1.3 * p.bounds.lower)
      return false;
    if (p.bounds.upper < 1e100 && p.bounds.upper > 0.0 && values[i] > 0.99 * p.bounds.upper) return false;
  }
  // Friction that is smaller at rest than at speed is none.
  if (info.name == "stribeck_friction" && values[1] < 1.1 * values[0]) return false;

  for (std::size_t k = 0; k < fit.free.size(); ++k) {
    const auto& f = fit.free[k];
    if (f.where != Freedom::Where::term || f.term != term) continue;
    if (info.parameters[f.index].role != Role::amplitude) continue;
    if (std::abs(get(fit.model, f)) > 3.0 * fit.sigma(static_cast<Eigen::Index>(k))) return true;
  }
  for (std::size_t i = 0; i < info.parameter_count(); ++i)
    if (info.parameters[i].role == Role::amplitude) return false;
  return true;  // a term of shapes alone, or a curve
}

class Search {
 public:
  Search(Case& data, const std::function<void(double, const std::string&)>& progress)
      : data_{data}, progress_{progress} {}

  Diagnosis run();

 private:
  struct Trial {
    std::vector<Term> added;  // in order
    Fit fit;
  };

  void prepare();
  /// Candidates fitted on top of `base`, best first.
  std::vector<Fit> shortlisted(const Weighing& weighing, const Fit& base, double share);
  bool add_named(double round);
  /// Drops terms that the others make needless.
  void prune();
  /// The smallest ratio of residual RMS of any output, a over b.
  [[nodiscard]] double least_ratio(const Fit& a, const Fit& b) const;
  void weigh_alternatives();
  void try_unmodelled();
  void sharpen(Fit& curved, Weighing& weighing, double& gain) const;
  void hold_out();
  void conclude();
  void smallest_effects();
  void reject(const std::string& term, const std::string& why, double gain);
  [[nodiscard]] std::size_t given() const { return data_.model.terms.size(); }

  Case& data_;
  const std::function<void(double, const std::string&)>& progress_;
  Diagnosis d_;
  std::vector<std::vector<Term>> rivals_;  // by finding: other terms that were nearly as good in its place
  std::vector<Screened> last_screen_;
  bool unnamed_ = false, rest_ = false;
};

void Search::prepare() {
  progress_(0.02, "simulating the nominal model");
  auto simulated = simulate(data_, data_.model);
  drop_outliers(data_, simulated);
  d_.weighing = weigh(data_, simulated, false);  // far from the truth a filter would hide what to follow
  d_.retuned = fit(data_, d_.weighing, data_.model, data_.model, 8);
  for (int again = 0; again < 2; ++again) {  // the nearer the fit, the finer its scale
    d_.weighing = weigh(data_, simulate(data_, d_.retuned.model), false);
    d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 8);
  }
  simulated = simulate(data_, d_.retuned.model);
  d_.weighing = weigh(data_, simulated);
  // Coloured weights may follow the colour of what is missing; a fit that they make plainly worse is not taken.
  auto coloured = fit(data_, d_.weighing, d_.retuned.model, data_.model, 6, &d_.retuned);
  d_.retuned = least_ratio(d_.retuned, coloured) < 0.9
                   ? fit(data_, d_.weighing, d_.retuned.model, data_.model, 0, &d_.retuned)
                   : std::move(coloured);
  d_.best = d_.retuned;
}

void Search::reject(const std::string& term, const std::string& why, double gain) {
  for (auto& r : d_.rejected)
    if (r.term == term) {
      if (gain > r.gain) r = {term, why, gain};
      return;
    }
  d_.rejected.push_back({term, why, gain});
}

std::vector<Fit> Search::shortlisted(const Weighing& weighing, const Fit& base, double share) {
  progress_(share, "screening candidates");
  auto screened = screen(data_, weighing, base, named_starts(data_, weighing, base), 0);
  std::vector<const Screened*> shortlist;
  std::map<std::string, int> seen;
  for (const auto& s : screened) {
    if (s.impossible) {
      if (s.merit > 3.0)
        reject(std::string{s.start.term.info->name}, "would need an impossible sign", s.merit);
      continue;
    }
    if (s.merit < -3.0 || shortlist.size() >= 9) break;
    if (seen[label(s.start.term)]++ < 2) shortlist.push_back(&s);
  }
  progress_(share + 0.04, "fitting the short list");
  // A few steps each; those that lag far behind the leader are not driven further.
  std::vector<Fit> fits;
  double leader = -1e300;
  for (const auto* s : shortlist) {
    fits.push_back(fit(data_, weighing, with(base, {s}), data_.model, 3, &base));
    leader = std::max(leader, fits.back().evidence);
  }
  for (auto& f : fits) {
    const double gained = std::max(1.0, leader - base.evidence);
    if (f.evidence > leader - std::max(15.0, 0.5 * gained))
      f = fit(data_, weighing, f.model, data_.model, 8, &f);
    leader = std::max(leader, f.evidence);
  }
  std::erase_if(fits, [](const Fit& f) { return !stands(f, f.model.terms.size() - 1); });
  std::sort(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) { return a.evidence > b.evidence; });
  last_screen_ = std::move(screened);
  return fits;
}

/// Adds the term that explains most, if one stands under the filters that its own residual asks for.
bool Search::add_named(double round) {
  for (const bool coloured : {true, false}) {
    // Filters fitted to a residual that is not noise yet take much of the effect away; where they leave nothing to see,
    // every row counts alike. Either way a claim is judged under the filters of its own residual.
    const Weighing weighing = coloured ? d_.weighing : weigh(data_, simulate(data_, d_.best.model), false);
    const Fit base = coloured ? d_.best : fit(data_, weighing, d_.best.model, data_.model, 4, &d_.best);
    auto fits = shortlisted(weighing, base, 0.1 + 0.2 * round + (coloured ? 0.0 : 0.1));
    double best_gain = -1e300;
    std::size_t winner = 0;
    Weighing own_weighing;
    Fit own_fit, own_base;
    std::set<std::string> tried;
    for (std::size_t i = 0; i < fits.size() && tried.size() < 3; ++i) {
      if (fits[i].evidence < base.evidence + 2.0) break;
      if (!tried.insert(label(fits[i].model.terms.back())).second) continue;
      if (fits[i].evidence < fits[0].evidence - 0.3 * (fits[0].evidence - base.evidence)) break;
      // Filters that a wrong residual asked for would keep it wrong: all rows alike first, then the filters of what is left.
      Weighing plain = weigh(data_, simulate(data_, fits[i].model), false);
      auto settled = fit(data_, plain, fits[i].model, data_.model, 6, &fits[i]);
      for (int again = 0; again < 3; ++again) {  // the nearer the fit, the finer its scale
        plain = weigh(data_, simulate(data_, settled.model), false);
        auto nearer = fit(data_, plain, settled.model, data_.model, 5, &settled);
        const bool arrived = least_ratio(nearer, settled) > 0.97;
        settled = std::move(nearer);
        if (arrived) break;
      }
      const Weighing own = weigh(data_, simulate(data_, settled.model));

      auto with_term = fit(data_, own, settled.model, data_.model, 6, &settled);
      auto without = fit(data_, own, base.model, data_.model, 4, &base);
      const double gain = with_term.evidence - without.evidence;
      // A further claim must be one that an engineer would see in the residual.
      const double ratio = rivals_.empty() ? 0.995 : 0.95;
      if (gain > best_gain && stands(with_term, with_term.model.terms.size() - 1) &&
          least_ratio(with_term, without) < ratio) {
        best_gain = gain, winner = i;
        own_weighing = own, own_fit = std::move(with_term), own_base = std::move(without);
      }
    }
    if (best_gain < claim_margin_of(d_.weighing)) {
      for (const auto& f : fits)
        reject(std::string{f.model.terms.back().info->name}, "its gain does not pay for its numbers",
               f.evidence - base.evidence);
      continue;
    }
    std::vector<Term> rivals;
    std::set<std::string> named{label(fits[winner].model.terms.back())};
    for (const auto& f : fits) {
      if (!named.insert(label(f.model.terms.back())).second) continue;
      if (f.evidence > base.evidence + 0.3 * (fits[winner].evidence - base.evidence) && rivals.size() < 4)
        rivals.push_back(f.model.terms.back());
      else
        reject(std::string{f.model.terms.back().info->name}, "another term explains the same better",
               f.evidence - base.evidence);
    }
    d_.weighing = std::move(own_weighing);
    d_.best = std::move(own_fit);
    d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 5, &d_.retuned);
    rivals_.push_back(std::move(rivals));
    return true;
  }
  return false;
}

double Search::least_ratio(const Fit& a, const Fit& b) const {
  double least = 1.0;
  const auto with_a = simulate(data_, a.model), with_b = simulate(data_, b.model);
  for (std::size_t o = 0; o < data_.outputs.size(); ++o) {
    double sum_a = 0.0, sum_b = 0.0;
    for (std::size_t r = 0; r < data_.recordings.size(); ++r)
      for (std::size_t i = 0; i < with_a[r][o].size(); ++i)
        if (const double y = data_.recordings[r].measured[o][i]; std::isfinite(y)) {
          sum_a += std::pow(y - with_a[r][o][i], 2);
          sum_b += std::pow(y - with_b[r][o][i], 2);
        }
    if (sum_b > 0.0) least = std::min(least, std::sqrt(sum_a / sum_b));
  }
  return least;
}

void Search::prune() {
  const auto is_friction = [](const Term& term) {
    return term.info->name.find("friction") != std::string_view::npos;
  };
  for (std::size_t i = 0; i < rivals_.size() && rivals_.size() > 1; ++i) {
    const std::size_t place = given() + i;
    Model model = d_.best.model;
    const Term removed = model.terms[place];
    model.terms.erase(model.terms.begin() + static_cast<std::ptrdiff_t>(place));
    // What one friction law gives up another may take over.
    for (std::size_t t = given(); t < model.terms.size(); ++t)
      if (is_friction(removed) && is_friction(model.terms[t])) {
        model.terms[t].values[0] += 0.7 * removed.values[0];
        if (model.terms[t].info->name == "stribeck_friction") model.terms[t].values[1] += removed.values[0];
      }
    auto without = fit(data_, d_.weighing, model, data_.model, 10);
    bool possible = true;
    for (std::size_t t = given(); t < without.model.terms.size(); ++t)
      possible = possible && stands(without, t);
    if (!possible) continue;
    if (without.evidence < d_.best.evidence - claim_margin_of(d_.weighing) &&
        least_ratio(d_.best, without) < 0.95)
      continue;
    reject(std::string{removed.info->name}, "the others explain it without",
           d_.best.evidence - without.evidence);
    d_.best = std::move(without);
    rivals_.erase(rivals_.begin() + static_cast<std::ptrdiff_t>(i));
    d_.weighing = weigh(data_, simulate(data_, d_.best.model));
    d_.best = fit(data_, d_.weighing, d_.best.model, data_.model, 4, &d_.best);
    d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 5, &d_.retuned);
    i = static_cast<std::size_t>(-1);
  }
}

void Search::weigh_alternatives() {
  progress_(0.7, "comparing with near twins");
  for (int pass = 0; pass < 2; ++pass)
    for (std::size_t i = 0; i < rivals_.size(); ++i) {
      const std::size_t place = given() + i;
      if (place >= d_.best.model.terms.size()) break;
      Finding finding;
      std::vector<Term> kept;
      for (const auto& rival : rivals_[i]) {
        Model model = d_.best.model;
        model.terms[place] = rival;
        auto f = fit(data_, d_.weighing, model, data_.model, 8, &d_.best);
        const double odds = f.evidence - d_.best.evidence;
        if (odds > 0.5 && stands(f, place)) {  // better after all, beside the other terms
          kept.push_back(d_.best.model.terms[place]);
          finding.alternatives.push_back({d_.best.model.terms[place], -odds});
          for (auto& a : finding.alternatives) a.log_odds -= odds;
          d_.best = std::move(f);
          continue;
        }
        kept.push_back(f.model.terms[place]);
        finding.alternatives.push_back({f.model.terms[place], odds});
      }
      rivals_[i] = kept;
      finding.term = d_.best.model.terms[place];
      if (pass == 1 || rivals_.size() == 1) {
        if (d_.findings.size() <= i) d_.findings.resize(i + 1);
        d_.findings[i] = finding;
      }
      if (rivals_.size() == 1 && pass == 0) pass = 1;
    }
}

/// A dent or a step is narrow: the knots are gathered where the curve is not flat.
void Search::sharpen(Fit& curved, Weighing& weighing, double& gain) const {
  const auto& curve = curved.model.terms.back().curve;
  const double level = median(curve.values);
  double top = 0.0;
  for (double v : curve.values) top = std::max(top, std::abs(v - level));
  std::size_t first = curve.knots.size(), last = 0;
  for (std::size_t k = 0; k < curve.knots.size(); ++k)
    if (std::abs(curve.values[k] - level) > 0.3 * top) first = std::min(first, k), last = k;
  if (first > last || (last - first + 3) * 2 > curve.knots.size()) return;
  const double spacing = curve.knots[1] - curve.knots[0];
  const double low = curve.knots[first] - 1.2 * spacing, high = curve.knots[last] + 1.2 * spacing;
  Model model = curved.model;
  auto& fine = model.terms.back().curve;
  fine.knots.clear(), fine.values.clear();
  constexpr int count = 18;
  for (int k = 0; k < count; ++k) {
    fine.knots.push_back(low + (high - low) * k / (count - 1));
    fine.values.push_back(curve(fine.knots.back()) - level);
  }
  auto rough = fit(data_, weighing, model, data_.model, 4);
  const Weighing own = weigh(data_, simulate(data_, rough.model));
  auto sharp = fit(data_, own, rough.model, data_.model, 4, &rough);
  const auto blunt = fit(data_, own, curved.model, data_.model, 3, &curved);
  if (sharp.evidence < blunt.evidence) return;
  gain += sharp.evidence - blunt.evidence;
  curved = std::move(sharp);
  weighing = own;
}

void Search::try_unmodelled() {
  progress_(0.78, "looking for physics without a name");
  const auto starts = unmodelled_starts(data_, d_.best);
  if (starts.empty()) return;
  struct Curved {
    Fit fit;
    Weighing weighing;
    double gain = -1e300;  // over `base`, under its own filters
  };
  const auto best_curve = [&](const Fit& base) {
    Curved best;
    const Weighing plain = weigh(data_, simulate(data_, base.model), false);
    const Fit under_plain = fit(data_, plain, base.model, data_.model, 4, &base);
    const auto screened = screen(data_, plain, under_plain, starts, 3);
    int tried = 0;
    for (const auto& s : screened) {
      if (tried++ >= 3 || s.merit < claim_margin) break;
      const Fit near = with_columns(data_, under_plain, s);
      auto rough = fit(data_, plain, near.model, data_.model, 2, &near);
      const Weighing own = weigh(data_, simulate(data_, rough.model));
      auto curved = fit(data_, own, rough.model, data_.model, 3, &rough);
      const auto without = fit(data_, own, base.model, data_.model, 4, &base);
      const double gain = curved.evidence - without.evidence;
      if (gain > best.gain) best = {std::move(curved), own, gain};
    }
    if (best.gain > claim_margin) sharpen(best.fit, best.weighing, best.gain);
    return best;
  };
  const bool named = d_.best.model.terms.size() > given();
  const double margin = 2.0 * claim_margin_of(d_.weighing);
  auto beside = best_curve(d_.best);
  if (named) {
    auto instead = best_curve(d_.retuned);
    if (instead.gain > margin) {
      const auto named_there = fit(data_, instead.weighing, d_.best.model, data_.model, 4, &d_.best);
      if (instead.fit.evidence > named_there.evidence + margin &&
          instead.fit.evidence - named_there.evidence > 0.25 * instead.gain) {
        for (std::size_t t = given(); t < d_.best.model.terms.size(); ++t)
          reject(std::string{d_.best.model.terms[t].info->name}, "a curve without a name explains far more",
                 1.0);
        d_.best = std::move(instead.fit);
        d_.weighing = std::move(instead.weighing);
        d_.findings.clear();
        rivals_.clear();
        unnamed_ = true;
      }
    }
  }
  // A rest counts where an engineer would see it.
  if (!unnamed_ && beside.gain > margin && least_ratio(beside.fit, d_.best) < (named ? 0.9 : 0.985)) {
    d_.best = std::move(beside.fit);
    d_.weighing = std::move(beside.weighing);
    (named ? rest_ : unnamed_) = true;
  }
  if (!unnamed_ && !rest_) return;
  Finding finding;
  finding.term = d_.best.model.terms.back();
  d_.findings.push_back(finding);
  d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, 5, &d_.retuned);
}

void Search::hold_out() {
  progress_(0.88, "checking on held-out stretches");
  // Every third stretch is kept from the fit; the simulation runs through, so its horizon is the whole recording.
  Weighing train = d_.weighing, test = d_.weighing;
  for (std::size_t r = 0; r < data_.recordings.size(); ++r) {
    const std::size_t rows = data_.recordings[r].inputs.rows();
    const std::size_t stretch = std::max<std::size_t>(1, rows / 18);
    for (std::size_t o = 0; o < data_.outputs.size(); ++o)
      for (std::size_t i = 0; i < rows; ++i) {
        const bool out = (i / stretch) % 3 == 1;
        (out ? train : test).present[r][o][i] = false;
      }
  }
  const auto retuned = fit(data_, train, d_.retuned.model, data_.model, 3, &d_.retuned);
  const auto after = d_.best.model.terms.size() > given()
                         ? fit(data_, train, d_.best.model, data_.model, 3, &d_.best)
                         : retuned;
  const auto nominal_out = simulate(data_, data_.model), retuned_out = simulate(data_, retuned.model),
             after_out = simulate(data_, after.model);
  const auto rms = [&](const std::vector<physics::Outputs>& simulated, std::size_t o, const Weighing& on) {
    double sum = 0.0;
    std::size_t n = 0;
    for (std::size_t r = 0; r < data_.recordings.size(); ++r)
      for (std::size_t i = 0; i < data_.recordings[r].inputs.rows(); ++i)
        if (on.present[r][o][i])
          sum += std::pow(data_.recordings[r].measured[o][i] - simulated[r][o][i], 2), ++n;
    return n > 0 ? std::sqrt(sum / static_cast<double>(n)) : 0.0;
  };
  for (std::size_t o = 0; o < data_.outputs.size(); ++o) {
    const auto& signal = *data_.model.signal(data_.outputs[o]);
    FitRow row{signal.name,
               signal.unit == "degC" ? "K" : signal.unit,
               rms(nominal_out, o, test),
               rms(retuned_out, o, test),
               rms(after_out, o, test),
               0.0};
    FitRow trained{signal.name,
                   row.unit,
                   rms(nominal_out, o, train),
                   rms(retuned_out, o, train),
                   rms(after_out, o, train),
                   0.0};
    row.noise_floor = trained.noise_floor = std::isfinite(data_.given_noise[o])
                                                ? data_.given_noise[o]
                                                : std::min(row.after, d_.weighing.filters[o].sigma);
    d_.heldout.push_back(row);
    d_.train.push_back(trained);
  }
  if (d_.best.model.terms.size() == given()) return;
  // A claim must help on what it has not seen, counted in whitened residuals.
  const double gain =
      0.5 * d_.weighing.temper *
      (residual(data_, test, retuned_out).squaredNorm() - residual(data_, test, after_out).squaredNorm());
  if (gain < 3.0) {
    for (const auto& finding : d_.findings)
      reject(std::string{finding.term.info->name}, "no gain on held-out data",
             d_.best.evidence - d_.retuned.evidence);
    d_.findings.clear();
    d_.best = d_.retuned;
    unnamed_ = rest_ = false;
    for (auto* rows : {&d_.heldout, &d_.train})
      for (auto& row : *rows) row.after = row.retuned;
  }
}

void Search::smallest_effects() {
  std::map<std::string, Detectable> smallest;
  for (const auto& s : last_screen_) {
    const auto& info = *s.start.term.info;
    if (s.start.directions.empty() || s.start.directions[0].amplitude >= none || !(s.gain > 0.0)) continue;
    const auto& p = info.parameters[s.start.directions[0].amplitude];
    double size = s.strength.norm();
    // The gain goes with the square of the strength: where it would just reach the margin.
    const double value = size * std::sqrt((claim_margin + 12.0) / s.gain);
    auto& entry = smallest[std::string{info.name}];
    if (entry.term.empty() || value < entry.value)
      entry = {std::string{info.name}, std::string{p.name}, std::string{p.unit}, value};
  }
  for (const auto& [name, entry] : smallest) d_.detectable.push_back(entry);
}

void Search::conclude() {
  for (std::size_t i = 0; i < d_.findings.size(); ++i) {
    auto& finding = d_.findings[i];
    const std::size_t place = given() + i;
    finding.term = d_.best.model.terms[place];
    finding.sigmas.assign(finding.term.info->parameter_count(), 0.0);
    for (std::size_t k = 0; k < d_.best.free.size(); ++k) {
      const auto& f = d_.best.free[k];
      if (f.where == Freedom::Where::term && f.term == place)
        finding.sigmas[f.index] = d_.best.sigma(static_cast<Eigen::Index>(k));
    }
    // What is lost without it.
    Model without = d_.best.model;
    without.terms.erase(without.terms.begin() + static_cast<std::ptrdiff_t>(place));
    const auto lost = residual(data_, d_.weighing, without).squaredNorm() - d_.best.residual.squaredNorm();
    const auto all = residual(data_, d_.weighing, data_.model).squaredNorm() - d_.best.residual.squaredNorm();
    finding.share = all > 0.0 ? std::clamp(lost / all, 0.0, 1.0) : 0.0;
    double sum = 1.0;
    for (const auto& a : finding.alternatives) sum += std::exp(std::min(0.0, 0.5 * a.log_odds));
    finding.probability = std::min(0.995, 1.0 / sum);
  }
  for (std::size_t k = 0; k < d_.best.free.size(); ++k) {
    const auto& f = d_.best.free[k];
    if (f.where == Freedom::Where::curve || f.sigma <= 0.0) continue;
    d_.parameter_excursion =
        std::max(d_.parameter_excursion, std::abs(get(d_.best.model, f) - f.center) / f.sigma);
  }
  d_.nominal = fit(data_, d_.weighing, data_.model, data_.model, 0, &d_.retuned);
  d_.mismatch_gain = d_.best.evidence - d_.nominal.evidence;
  bool ambiguous = false;
  for (const auto& finding : d_.findings)
    for (const auto& a : finding.alternatives) ambiguous = ambiguous || a.log_odds > -ambiguous_margin;
  if (d_.findings.empty())
    d_.verdict = d_.parameter_excursion > 3.0 ? Verdict::parameters_only : Verdict::no_mismatch;
  else if (unnamed_)
    d_.verdict = Verdict::unknown_physics;
  else if (ambiguous)
    d_.verdict = Verdict::ambiguous;
  else
    d_.verdict = rest_ ? Verdict::partly_explained : Verdict::explained;
  double sum = 0.0;
  for (const auto& row : d_.heldout) sum += row.noise_floor > 0.0 ? row.after / row.noise_floor : 1.0;
  d_.unexplained = sum / static_cast<double>(std::max<std::size_t>(1, d_.heldout.size()));
  std::sort(d_.rejected.begin(), d_.rejected.end(),
            [](const auto& a, const auto& b) { return a.gain > b.gain; });
  std::erase_if(d_.rejected, [&](const Rejection& r) {
    return std::any_of(d_.findings.begin(), d_.findings.end(),
                       [&](const Finding& f) { return f.term.info->name == r.term; });
  });
}

Diagnosis Search::run() {
  prepare();
  for (int round = 0; round < 3; ++round)
    if (!add_named(round)) break;
  prune();
  weigh_alternatives();
  const auto named = std::tuple{d_.best, d_.weighing, d_.retuned, d_.findings};
  try_unmodelled();
  const bool curved = unnamed_ || rest_;
  hold_out();
  if (curved && d_.findings.empty() &&
      !std::get<3>(named).empty()) {  // the curve does not hold, what has a name may
    std::tie(d_.best, d_.weighing, d_.retuned, d_.findings) = named;
    d_.heldout.clear();
    d_.train.clear();
    hold_out();
  }
  smallest_effects();
  conclude();
  progress_(1.0, "done");
  return d_;
}

}  // namespace

Diagnosis search(Case& data, const std::function<void(double, const std::string&)>& progress) {
  return Search{data, progress}.run();
}

std::string name_of(Verdict verdict) {
  static const std::array<const char*, 6> names{"no_mismatch",      "parameters_only", "explained",
                                                "partly_explained", "ambiguous",       "unknown_physics"};
  return names[static_cast<std::size_t>(verdict)];
}

}  // namespace invar::diagnose

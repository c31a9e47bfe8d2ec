#include "core/diagnosis/evidence/screen.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "core/diagnosis/candidates/equation_candidates.hpp"
#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/estimate/priors.hpp"
#include "core/diagnosis/estimate/sensitivities.hpp"
#include "core/diagnosis/segments/excerpt.hpp"
#include "core/physics/counted_units.hpp"

namespace invar::diagnosis {

namespace {

using physics::Role;
using physics::Term;

constexpr auto none = physics::most_parameters;

/// The base's own directions, to be taken out of every other, and how far they still have to go: a fit that ends within a
/// fraction of its own uncertainty is not at its end for what is nearly along its numbers.
struct Nuisance {
  Eigen::MatrixXd columns;
  Eigen::LDLT<Eigen::MatrixXd> hessian;
  Eigen::VectorXd slope;
};

Nuisance nuisance(const Case& data, const Weighing& weighing, const Fit& base) {
  Nuisance n;
  n.columns = whitened(data, weighing,
                       base.columns.cols() == static_cast<Eigen::Index>(base.free.size())
                           ? base.columns
                           : sensitivities(data, base.model, base.free));
  Eigen::MatrixXd h = weighing.temper * (n.columns.transpose() * n.columns);
  for (Eigen::Index k = 0; k < h.rows(); ++k) {
    const double sigma = base.free[static_cast<std::size_t>(k)].sigma;
    if (sigma > 0.0) h(k, k) += 1.0 / (sigma * sigma);
    h(k, k) += 1e-9 * h(k, k) + 1e-300;
  }
  n.hessian.compute(h);
  n.slope = Eigen::VectorXd::Zero(h.rows());
  // Elsewhere sensitivities are carried along from fit to fit and do not say so finely where the end is.
  if (data.model.plant != physics::Plant::equations) return n;
  n.slope =
      weighing.temper * (n.columns.transpose() * base.residual) + slope_of_priors(base.model, base.free);
  for (Eigen::Index k = 0; k < n.slope.size(); ++k) {  // what a bound holds has arrived
    const auto& f = base.free[static_cast<std::size_t>(k)];
    const double value = get(base.model, f);
    if ((n.slope(k) > 0.0 && value <= f.bounds.lower) || (n.slope(k) < 0.0 && value >= f.bounds.upper))
      n.slope(k) = 0.0;
  }
  // Farther off, it is not this slope that holds it there: the valley bends.
  constexpr double a_fraction = 1.0;
  if (!(0.5 * n.slope.dot(n.hessian.solve(n.slope)) < a_fraction)) n.slope.setZero();
  return n;
}

/// The start among `starts` whose curve has every knot of that of `start` and more; none: `start` itself.
std::size_t finer_than(const std::vector<Start>& starts, std::size_t start) {
  const auto& own = starts[start].term;
  std::size_t finest = start;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const auto& other = starts[i].term;
    const auto& knots = other.curve.knots;
    if (other.info != own.info || other.on != own.on || other.with != own.with ||
        other.curve.over != own.curve.over || own.with.empty() || own.curve.knots.empty() ||
        own.curve.period > 0.0 || other.curve.period > 0.0 || starts[i].step != starts[start].step ||
        knots.size() <= starts[finest].term.curve.knots.size())
      continue;
    const double near = 1e-9 * (knots.back() - knots.front());
    const bool has_all = own.curve.knots.front() <= knots.front() + near &&
                         own.curve.knots.back() >= knots.back() - near &&
                         std::all_of(own.curve.knots.begin(), own.curve.knots.end(), [&](double at) {
                           return std::any_of(knots.begin(), knots.end(),
                                              [&](double knot) { return std::abs(knot - at) <= near; });
                         });
    if (has_all) finest = i;
  }
  return finest;
}

/// What each direction of a curve is of those of a finer one.
Eigen::MatrixXd shares_of(const Start& start, const Start& finer) {
  const auto& knots = finer.term.curve.knots;
  Eigen::MatrixXd shares{static_cast<Eigen::Index>(finer.directions.size()),
                         static_cast<Eigen::Index>(start.directions.size())};
  auto curve = start.term.curve;
  for (std::size_t d = 0; d < start.directions.size(); ++d) {
    curve.values.assign(curve.knots.size(), 0.0);
    curve.values[start.directions[d].knot] = 1.0;
    for (std::size_t f = 0; f < finer.directions.size(); ++f)
      shares(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(d)) =
          curve(knots[finer.directions[f].knot]);
  }
  return shares;
}

/// By how much a value of the curve is moved for its slope.
double step_of_curve(const Case& data, const Start& start) {
  if (start.step > 0.0) return start.step;
  if (data.model.plant == physics::Plant::sensor) return 1e-7;
  const auto site = start.term.info->site;
  if (site == "actuator" || site == "thermal" || site == "measurement") return 1e-3;
  if (data.model.plant == physics::Plant::thermal) return 0.1;
  return data.model.plant == physics::Plant::axis ? 0.05 : 1e-6;
}

/// The term of a start moved along one direction alone, and how far.
std::pair<Term, double> moved(const Case& data, const Start& start, const Start::Direction& direction) {
  Term term = start.term;
  if (!term.curve.knots.empty()) {
    const double by = step_of_curve(data, start);
    term.curve.values[direction.knot] = by;
    return {std::move(term), by};
  }
  if (direction.amplitude >= none) return {std::move(term), 1.0};
  for (std::size_t i = 0; i < term.info->parameter_count(); ++i) {
    if (term.info->parameters[i].role == Role::amplitude && i != direction.amplitude) term.values[i] = 0.0;
    if (term.info->parameters[i].role == Role::phase && direction.quadrature)
      term.values[i] += 0.5 * std::numbers::pi;
  }
  const double by = term.values[direction.amplitude];
  return {std::move(term), by};
}

/// Of all directions of all starts: terms of one kind at one place run together. A curve of few knots is
/// the sum of one of many that has them too.
std::vector<Eigen::MatrixXd> columns_of(const Case& data, const Fit& base, const Eigen::VectorXd& at,
                                        const std::vector<Start>& starts) {
  std::vector<physics::Model> models;
  struct Place {
    std::size_t start;
    Eigen::Index direction;
    double step;
  };
  std::vector<Place> places;  // of each model
  std::vector<std::size_t> source;
  for (std::size_t i = 0; i < starts.size(); ++i) source.push_back(finer_than(starts, i));
  std::vector<Eigen::MatrixXd> all(starts.size());
  for (std::size_t s = 0; s < starts.size(); ++s) {
    if (source[s] != s) continue;
    const auto& start = starts[s];
    all[s].resize(at.size(), static_cast<Eigen::Index>(start.directions.size()));
    for (const auto& direction : start.directions) {
      auto [term, by] = moved(data, start, direction);
      models.emplace_back(base.model).terms.push_back(std::move(term));
      places.push_back({s, &direction - start.directions.data(), by});
    }
  }
  for_differences_of(data, models, [&](std::size_t k, const Eigen::VectorXd& left) {
    const auto& [start, direction, step] = places[k];
    all[start].col(direction) =
        ((left - at) / step).unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; });
  });
  for (std::size_t i = 0; i < starts.size(); ++i)
    if (source[i] != i) all[i] = all[source[i]] * shares_of(starts[i], starts[source[i]]);
  return all;
}

/// The slope of the cost along the columns once the base's own numbers, which share `shared` with them, have arrived.
Eigen::VectorXd slope_along(const Weighing& weighing, const Fit& base, const Nuisance& n,
                            const Eigen::MatrixXd& columns, const Eigen::MatrixXd& shared) {
  return weighing.temper * (columns.transpose() * base.residual) -
         shared.transpose() * n.hessian.solve(n.slope);
}

/// Fills strength and gain of a set of columns with the nuisance taken out.
double solve(const Weighing& weighing, const Fit& base, const Nuisance& n, const Eigen::MatrixXd& columns,
             Eigen::VectorXd& strength) {
  const Eigen::MatrixXd b = weighing.temper * (n.columns.transpose() * columns);
  Eigen::MatrixXd m = weighing.temper * (columns.transpose() * columns);
  for (Eigen::Index k = 0; k < m.rows(); ++k) m(k, k) += 1e-8 * m(k, k) + 1e-300;
  const Eigen::MatrixXd reduced = m - b.transpose() * n.hessian.solve(b);
  const Eigen::VectorXd g = slope_along(weighing, base, n, columns, b);
  Eigen::MatrixXd regular = reduced;
  for (Eigen::Index k = 0; k < m.rows(); ++k) regular(k, k) += 1e-6 * m(k, k);
  strength = -regular.ldlt().solve(g);
  if (!strength.allFinite()) {
    strength.setZero();
    return 0.0;
  }
  return std::max(0.0, -0.5 * strength.dot(g));
}

std::size_t directions_of(const std::vector<Start>& starts) {
  std::size_t sum = 0;
  for (const auto& start : starts) sum += start.directions.size();
  return sum;
}

/// Strength, gain and merit of one start, whose columns are there already.
void weigh_start(const Case& data, const Weighing& weighing, const Fit& base, const Nuisance& n,
                 Screened& s) {
  const double observations = std::max(10.0, weighing.temper * static_cast<double>(base.residual.size()));
  s.gain = solve(weighing, base, n, whitened(data, weighing, s.columns), s.strength);
  const auto& info = *s.start.term.info;
  if (s.start.directions.size() == 1 && s.start.term.curve.knots.empty() &&
      s.start.directions[0].amplitude >= none && s.strength(0) > 1.5) {
    // A term without a strength is there once, not eight times: the gain of one.
    const double full = s.strength(0);
    s.gain *= (2.0 * full - 1.0) / (full * full);
    s.strength(0) = 1.0;
  }
  // An amplitude without a phase has one possible sign where its bounds say so.
  bool periodic = false;
  std::size_t shapes = 0;
  for (std::size_t k = 0; k < info.parameter_count(); ++k) {
    periodic = periodic || info.parameters[k].role == Role::phase;
    shapes += info.parameters[k].role == Role::shape ? 1U : 0U;
  }
  if (s.start.term.curve.knots.empty() && !periodic && s.start.directions.size() == 1) {
    const auto& d = s.start.directions.front();
    const double lower =
        d.amplitude < none ? physics::bounds_of_parameter(base.model, s.start.term, d.amplitude).lower : 0.0;
    s.impossible = s.strength(0) < 0.0 && lower >= 0.0;
  }
  const double numbers = static_cast<double>(s.start.directions.size() + shapes);
  // More than all there is of something is none of it: the gain of what may be.
  if (s.start.term.curve.knots.empty() && s.start.directions.size() == 1 &&
      s.start.directions[0].amplitude < none) {
    const double upper =
                     physics::bounds_of_parameter(base.model, s.start.term, s.start.directions[0].amplitude)
                         .upper,
                 full = s.strength(0);
    if (full > upper) {
      s.gain *= upper * (2.0 * full - upper) / (full * full);
      s.strength(0) = upper;
    }
  }
  s.merit = s.gain - 0.5 * numbers * std::log(observations);
}

/// On all rows.
std::vector<Screened> screen_on_all(const Case& data, const Weighing& weighing, const Fit& base,
                                    const std::vector<Start>& starts, std::size_t keep) {
  const auto n = nuisance(data, weighing, base);
  const Eigen::VectorXd at = differences(data, simulate(data, base.model));
  std::vector<Screened> all(starts.size());
  // So many at a time: their columns are as long as the recording.
  const std::size_t most = data.model.plant == physics::Plant::equations ? 64 : 16;
  for (std::size_t begin = 0; begin < starts.size(); begin += most) {
    const std::size_t end = std::min(starts.size(), begin + most);
    auto found = columns_of(data, base, at,
                            {starts.begin() + static_cast<std::ptrdiff_t>(begin),
                             starts.begin() + static_cast<std::ptrdiff_t>(end)});
    for (std::size_t i = begin; i < end; ++i) all[i].columns = std::move(found[i - begin]);
    in_parallel(end - begin, [&](std::size_t of) {
      const std::size_t i = begin + of;
      auto& s = all[i];
      s.start = starts[i];
      weigh_start(data, weighing, base, n, s);
      if (keep == 0 || s.merit < 0.0) s.columns.resize(0, 0);
    });
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.merit > b.merit; });
  for (std::size_t i = std::min(keep, all.size()); i < all.size(); ++i) all[i].columns.resize(0, 0);
  return all;
}

}  // namespace

std::vector<Screened> screen(const Case& data, const Weighing& weighing, const Fit& base,
                             const std::vector<Start>& starts, std::size_t keep) {
  const auto some = excerpt(data, weighing, base, directions_of(starts));
  if (!some) return screen_on_all(data, weighing, base, starts, keep);
  auto ranked = screen_on_all(some->data, some->weighing, some->base, starts, 0);
  // The best of them, two of a kind at most, on all rows.
  constexpr std::size_t enough = 40;  // directions
  std::vector<Start> best;
  std::vector<Screened> others;
  for (auto& s : ranked) {
    const auto is_kin = [&](const Start& start) {
      const auto &a = start.term, &b = s.start.term;
      return a.info == b.info && a.on == b.on && a.with == b.with && a.curve.over == b.curve.over &&
             a.curve.memory == b.curve.memory;
    };
    const bool is_good = !s.impossible && std::count_if(best.begin(), best.end(), is_kin) < 2 &&
                         (directions_of(best) < enough || best.size() < 2 * keep);
    if (is_good)
      best.push_back(s.start);
    else
      others.push_back(std::move(s));
  }
  auto all = screen_on_all(data, weighing, base, best, keep);
  const double least = all.empty() ? 0.0 : all.back().merit;
  for (auto& s : others) {  // what they would gain, if they go on as in the excerpt
    s.merit += s.gain / some->share - s.gain;
    s.gain /= some->share;
    if (!s.impossible) s.merit = std::min(s.merit, least);
    all.push_back(std::move(s));
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.merit > b.merit; });
  return all;
}

std::string why_impossible(const Start& start) {
  const auto& d = start.directions.front();
  if (d.amplitude >= none) return "fits best with the opposite of what it does, which nothing has";
  std::string name{start.term.info->parameters[d.amplitude].name};
  std::replace(name.begin(), name.end(), '_', ' ');
  return "fits best with a negative " + name + ", which nothing has";
}

namespace {

/// A strength that its bounds forbid, or a limit that would hardly be there.
bool is_impossible(const physics::Model& model, const Start& start, const Eigen::VectorXd& strength,
                   Eigen::Index at) {
  if (start.directions.size() != 1) return false;  // a sine has any phase
  const auto& d = start.directions.front();
  if (d.amplitude >= none) return strength(at) < 0.2;
  return strength(at) < 0.0 && physics::bounds_of_parameter(model, start.term, d.amplitude).lower >= 0.0;
}

double price(const Start& start, double observations) {
  std::size_t numbers = start.directions.size();
  for (std::size_t k = 0; k < start.term.info->parameter_count(); ++k)
    numbers += start.term.info->parameters[k].role == Role::shape ? 1U : 0U;
  return 0.5 * static_cast<double>(numbers) * std::log(observations);
}

bool is_of_one_term(const Start& x, const Start& y) {
  return x.term.info == y.term.info && x.term.on == y.term.on && x.term.with == y.term.with;
}

/// Of each term the two starts that gain most alone. In the user's equations, which have many places, what repeats is left
/// to the search one by one: it shows alone, at its own place in the spectrum.
std::vector<Start> best_alone(const Case& data, const Weighing& weighing, const Fit& base,
                              const std::vector<Start>& starts, bool may_repeat) {
  const auto single = screen(data, weighing, base, starts, 0);
  std::vector<Start> chosen;
  for (const auto& s : single) {
    const auto same = std::count_if(chosen.begin(), chosen.end(),
                                    [&](const Start& start) { return is_of_one_term(start, s.start); });
    if (same < 2 && (may_repeat || s.start.directions.size() == 1)) chosen.push_back(s.start);
  }
  return chosen;
}

/// The normal equations of all directions of all starts, from which those of any two are taken.
class PairScreen {
 public:
  PairScreen(const Case& data, const Weighing& weighing, const Fit& base, const std::vector<Start>& starts)
      : base_{base},
        starts_{starts},
        nuisance_{nuisance(data, weighing, base)},
        observations_{std::max(10.0, weighing.temper * static_cast<double>(base.residual.size()))} {
    const Eigen::VectorXd at = differences(data, simulate(data, base.model));
    for (const auto& start : starts)
      begins_.push_back(begins_.back() + static_cast<Eigen::Index>(start.directions.size()));
    Eigen::MatrixXd columns(at.size(), begins_.back());
    const auto found = columns_of(data, base, at, starts);
    for (std::size_t i = 0; i < starts.size(); ++i)
      columns.middleCols(begins_[i], begins_[i + 1] - begins_[i]) = found[i];
    columns = whitened(data, weighing, columns);
    shared_ = weighing.temper * (nuisance_.columns.transpose() * columns);
    all_ = weighing.temper * (columns.transpose() * columns);
    gram_ = all_ - shared_.transpose() * nuisance_.hessian.solve(shared_);
    slope_ = slope_along(weighing, base, nuisance_, columns, shared_);
  }

  /// Nothing where the two together need what their bounds forbid.
  [[nodiscard]] std::optional<ScreenedPair> pair(std::size_t i, std::size_t k) const {
    std::vector<Eigen::Index> places;
    for (auto c = begins_[i]; c < begins_[i + 1]; ++c) places.push_back(c);
    const auto second = static_cast<Eigen::Index>(places.size());
    for (auto c = begins_[k]; c < begins_[k + 1]; ++c) places.push_back(c);
    Eigen::MatrixXd m = gram_(places, places);
    for (Eigen::Index c = 0; c < m.rows(); ++c) {
      const auto place = places[static_cast<std::size_t>(c)];
      m(c, c) += 1e-6 * all_(place, place) + 1e-300;
    }
    const Eigen::VectorXd g = slope_(places);
    const Eigen::VectorXd strength = -m.ldlt().solve(g);
    if (!strength.allFinite() || is_impossible(base_.model, starts_[i], strength, 0) ||
        is_impossible(base_.model, starts_[k], strength, second))
      return std::nullopt;
    ScreenedPair pair;
    pair.merit = -0.5 * strength.dot(g) - price(starts_[i], observations_) - price(starts_[k], observations_);
    pair.first.start = starts_[i], pair.second.start = starts_[k];
    pair.first.strength = strength.head(second),
    pair.second.strength = strength.tail(strength.size() - second);
    pair.shift = -nuisance_.hessian.solve(shared_(Eigen::all, places) * strength);
    return pair;
  }

 private:
  const Fit& base_;
  const std::vector<Start>& starts_;
  Nuisance nuisance_;
  double observations_;
  std::vector<Eigen::Index> begins_{0};  // of the columns of each start
  Eigen::MatrixXd shared_, all_, gram_;
  Eigen::VectorXd slope_;
};

/// Of two names their best beginning alone, so that others have their turn; `pairs` come best first.
std::vector<ScreenedPair> best_of_each_two(std::vector<ScreenedPair> pairs, std::size_t most) {
  const auto is_same = [](const ScreenedPair& x, const ScreenedPair& y) {
    return (is_of_one_term(x.first.start, y.first.start) && is_of_one_term(x.second.start, y.second.start)) ||
           (is_of_one_term(x.first.start, y.second.start) && is_of_one_term(x.second.start, y.first.start));
  };
  std::vector<ScreenedPair> best;
  for (auto& pair : pairs)
    if (best.size() < most && std::none_of(best.begin(), best.end(),
                                           [&](const ScreenedPair& other) { return is_same(pair, other); }))
      best.push_back(std::move(pair));
  return best;
}

}  // namespace

std::vector<ScreenedPair> screen_pairs(const Case& data, const Weighing& weighing, const Fit& base,
                                       const std::vector<Start>& starts, std::size_t most) {
  if (const auto some = excerpt(data, weighing, base, directions_of(starts))) {
    auto pairs = screen_pairs(some->data, some->weighing, some->base, starts, most);
    for (auto& pair : pairs)
      pair.shift.setZero(static_cast<Eigen::Index>(base.free.size()));  // of the excerpt's
    return pairs;
  }
  const bool may_repeat = data.model.plant != physics::Plant::equations;
  const auto chosen = best_alone(data, weighing, base, starts, may_repeat);
  const PairScreen screened{data, weighing, base, chosen};
  std::vector<ScreenedPair> pairs;
  for (std::size_t i = 0; i < chosen.size(); ++i)
    for (std::size_t k = i + 1; k < chosen.size(); ++k) {
      if (is_of_one_term(chosen[i], chosen[k]) || same_law(chosen[i].term, chosen[k].term)) continue;
      if (auto pair = screened.pair(i, k)) pairs.push_back(std::move(*pair));
    }
  std::sort(pairs.begin(), pairs.end(), [](const auto& x, const auto& y) { return x.merit > y.merit; });
  if (may_repeat) return best_of_each_two(std::move(pairs), most);
  if (pairs.size() > most) pairs.resize(most);
  return pairs;
}

physics::Model with(const Fit& base, const std::vector<const Screened*>& added, double share) {
  physics::Model model = base.model;
  for (const auto* s : added) {
    Term term = s->start.term;
    const auto& info = *term.info;
    for (std::size_t d = 0; d < s->start.directions.size(); ++d) {
      const auto& direction = s->start.directions[d];
      const double value = share * s->strength(static_cast<Eigen::Index>(d));
      if (!term.curve.knots.empty()) {
        term.curve.values[direction.knot] = value;
        continue;
      }
      if (direction.amplitude >= none) continue;
      auto p = info.parameters[direction.amplitude];
      p.bounds = physics::bounds_of_parameter(model, term, direction.amplitude);
      const auto phase = info.index_of("phase");
      if (phase < none && d + 1 < s->start.directions.size() && s->start.directions[d + 1].quadrature) {
        const double cosine = share * s->strength(static_cast<Eigen::Index>(d + 1));
        term.values[direction.amplitude] = p.bounds.clamp(std::hypot(value, cosine));
        term.values[phase] = std::atan2(cosine, value);
        ++d;
        continue;
      }
      // Never at zero itself: there the shapes would have no slope.
      const double floor = 0.02 * std::abs(p.starts[0]);
      term.values[direction.amplitude] =
          p.bounds.lower >= 0.0
              ? p.bounds.clamp(std::max(value, std::min(floor, 0.1 * std::abs(value) + 1e-3 * floor)))
              : p.bounds.clamp(value);
      // A store as fast as it was, however large.
      if (info.name == "hidden_node" && d == 0) {
        const auto capacity = info.index_of("capacity");
        term.values[capacity] = info.parameters[capacity].bounds.clamp(
            term.values[0] / s->start.term.values[0] * s->start.term.values[capacity]);
      }
      // Where the force is less than it began with, the loop goes over the same way: it is as much less stiff.
      if (info.name == "presliding_friction" && d == 0) {
        const auto stiffness = info.index_of("stiffness");
        const double times =
            std::min(1.0, term.values[direction.amplitude] / s->start.term.values[direction.amplitude]);
        term.values[stiffness] =
            info.parameters[stiffness].bounds.clamp(times * s->start.term.values[stiffness]);
      }
    }
    model.terms.push_back(term);
  }
  return model;
}

Fit fit_with(const Case& data, const Weighing& weighing, const Fit& base, const Screened& added,
             int iterations) {
  const physics::Model whole = with(base, {&added});
  const auto from_whole = [&] { return fit(data, weighing, whole, data.model, iterations, &base); };
  physics::Model best = whole;
  double least = residual(data, weighing, best).squaredNorm();
  bool is_whole = true;
  for (double share = 0.4; share > 0.02 && least > base.residual.squaredNorm(); share *= 0.4) {
    auto tried = with(base, {&added}, share);
    const double square = residual(data, weighing, tried).squaredNorm();
    if (square < least) least = square, best = std::move(tried), is_whole = false;
  }
  if (is_whole) return from_whole();
  // The whole strength may be right once the other numbers give way, which they have not here.
  auto near = fit(data, weighing, best, data.model, iterations, &base);
  auto far = from_whole();
  return far.evidence > near.evidence ? far : near;
}

Fit with_columns(const Case& data, const Fit& base, const Screened& added) {
  Fit near;
  near.model = with(base, {&added});
  near.free = freedoms(near.model, data.model);
  near.columns.resize(base.columns.rows(), base.columns.cols() + added.columns.cols());
  near.columns << base.columns, added.columns;
  return near;
}

}  // namespace invar::diagnosis

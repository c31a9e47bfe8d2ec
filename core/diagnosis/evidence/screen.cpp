#include "core/diagnosis/evidence/screen.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/evidence/first_order.hpp"
#include "core/diagnosis/segments/excerpt.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/counted_units.hpp"

namespace invar::diagnosis {

namespace {

using physics::Role;
using physics::Term;

/// Does the model do the same by its own numbers? Then a gain is what they have not been led to yet, divided by nearly
/// nothing.
bool is_of_own_numbers(const Eigen::MatrixXd& reduced, const Eigen::MatrixXd& whole) {
  constexpr double apart = 1e-5;  // sine squared of the angle; finite differences reach 1e-8
  return (reduced.diagonal().array() < apart * whole.diagonal().array()).all();
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
  strength = -numerics::solve_symmetric(regular, g);
  if (!strength.allFinite() || is_of_own_numbers(reduced, m)) {
    strength.setZero();
    return 0.0;
  }
  return std::max(0.0, -0.5 * strength.dot(g));
}

/// Strength, gain and merit of one start, whose columns are there already.
void weigh_start(const Case& data, const Weighing& weighing, const Fit& base, const Nuisance& n,
                 Screened& s) {
  const double observations = std::max(10.0, weighing.temper * static_cast<double>(base.residual.size()));
  s.gain = solve(weighing, base, n, whitened(data, weighing, s.columns), s.strength);
  const auto& info = *s.start.term.info;
  if (s.start.directions.size() == 1 && s.start.term.curve.knots.empty() &&
      s.start.directions[0].amplitude >= physics::no_parameter && s.strength(0) > 1.5) {
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
    const double lower = d.amplitude < physics::no_parameter
                             ? physics::bounds_of_parameter(base.model, s.start.term, d.amplitude).lower
                             : 0.0;
    s.impossible = s.strength(0) < 0.0 && lower >= 0.0;
  }
  const double numbers = static_cast<double>(s.start.directions.size() + shapes);
  // More than all there is of something is none of it: the gain of what may be.
  if (s.start.term.curve.knots.empty() && s.start.directions.size() == 1 &&
      s.start.directions[0].amplitude < physics::no_parameter) {
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
  if (d.amplitude >= physics::no_parameter)
    return "the best fit has the opposite of its effect, which is impossible";
  std::string name{start.term.info->parameters[d.amplitude].name};
  std::replace(name.begin(), name.end(), '_', ' ');
  return "the best fit needs a negative " + name + ", which is impossible";
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
      if (direction.amplitude >= physics::no_parameter) continue;
      auto p = info.parameters[direction.amplitude];
      p.bounds = physics::bounds_of_parameter(model, term, direction.amplitude);
      const auto phase = info.index_of("phase");
      if (phase < physics::no_parameter && d + 1 < s->start.directions.size() &&
          s->start.directions[d + 1].quadrature) {
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
      // A store as fast as it was, however large; bristles that bend over the same way.
      if (const auto shape = info.index_of(info.in_proportion.parameter);
          shape < physics::no_parameter && d == 0) {
        const double times = std::min(info.in_proportion.most, term.values[direction.amplitude] /
                                                                   s->start.term.values[direction.amplitude]);
        term.values[shape] = info.parameters[shape].bounds.clamp(times * s->start.term.values[shape]);
      }
    }
    model.terms.push_back(term);
  }
  return model;
}

Fit fit_with(const Case& data, const Weighing& weighing, const Fit& base, const Screened& added,
             Effort effort) {
  const physics::Model whole = with(base, {&added});
  const auto from_whole = [&] { return fit(data, weighing, whole, data.model, effort, &base); };
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
  auto near = fit(data, weighing, best, data.model, effort, &base);
  auto far = from_whole();
  return far.evidence > near.evidence ? far : near;
}

Fit with_columns(const Case& data, const Fit& base, const Screened& added) {
  Fit near;
  near.model = with(base, {&added});
  near.free = freedoms(near.model, data.model);
  near.columns = base.columns.with(added.columns);
  return near;
}

}  // namespace invar::diagnosis

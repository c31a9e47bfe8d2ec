// What two starts would gain together.
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/diagnosis/candidates/equation_candidates.hpp"
#include "core/diagnosis/evidence/first_order.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/segments/excerpt.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/counted_units.hpp"

namespace invar::diagnosis {

using physics::Role;

namespace {

/// A strength that its bounds forbid, or a limit that would hardly be there.
bool is_impossible(const physics::Model& model, const Start& start, const Eigen::VectorXd& strength,
                   Eigen::Index at) {
  if (start.directions.size() != 1) return false;  // a sine has any phase
  const auto& d = start.directions.front();
  if (d.amplitude >= physics::no_parameter) return strength(at) < 0.2;
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
    const Eigen::VectorXd strength = -numerics::solve_symmetric(m, g);
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

}  // namespace invar::diagnosis

#include "core/diagnosis/evidence/detectable.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/evidence/wander.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/counted_units.hpp"

namespace invar::diagnosis {

namespace {

/// What an effect changes in measured - simulated once the model's own numbers have given way to it.
struct Effect {
  Eigen::VectorXd raw, whitened;
};

class Series {
 public:
  Series(const Case& data, const Diagnosis& d)
      : data_{data},
        d_{d},
        raw_{differences(data, simulate(data, d.best.model))},
        left_{residual(data, d.weighing, d.best.model)},
        own_{whitened(data, d.weighing, d.best.columns).dense()} {
    Eigen::MatrixXd curvature = own_.transpose() * own_;
    for (std::size_t k = 0; k < d.best.free.size(); ++k)
      if (const double sigma = d.best.free[k].sigma; sigma > 0.0) {
        const auto at = static_cast<Eigen::Index>(k);
        curvature(at, at) += 1.0 / (sigma * sigma);
      }
    curvature_.compute(curvature);
  }

  [[nodiscard]] Effect effect(const Screened& screened, double share) const {
    Effect e;
    e.raw = differences(data_, simulate_once(data_, with(d_.best, {&screened}, share))) - raw_;
    e.raw = e.raw.array().isFinite().select(e.raw, 0.0).eval();
    e.whitened = whitened(data_, d_.weighing, e.raw);
    if (own_.cols() == 0) return e;
    const Eigen::VectorXd gives_way = curvature_.solve(own_.transpose() * e.whitened);
    e.raw -= d_.best.columns.times(gives_way);
    e.whitened -= own_ * gives_way;
    return e;
  }

  /// Would so many times this effect be claimed?
  [[nodiscard]] bool shows(const Effect& effect, double times) const {
    Fit one, other;
    one.residual = left_;
    other.residual = left_ - times * effect.whitened;
    one.data_cost = 0.5 * d_.weighing.temper * one.residual.squaredNorm();
    other.data_cost = 0.5 * d_.weighing.temper * other.residual.squaredNorm();
    one.evidence = -one.data_cost - thresholds::price_of_a_term;
    other.evidence = -other.data_cost;
    one.model = other.model = d_.best.model;
    const double margin = claim_margin_of(d_.weighing);
    if (one.evidence - other.evidence < margin) return false;
    const auto [ratio, lead, independent] = led(effect, times);
    const bool coloured = std::any_of(d_.weighing.filters.begin(), d_.weighing.filters.end(),
                                      [](const Whitening& filter) { return !filter.a.empty(); });
    if (!coloured && lead - thresholds::price_of_a_term < margin) return false;
    return (ratio < thresholds::seen_first || lead > thresholds::claim_margin) &&
           advantage_over_wander(data_, d_.weighing, one, other) > margin;
  }

 private:
  /// The residual with the effect that nobody modelled over the one without.
  [[nodiscard]] Lead led(const Effect& effect, double times) const {
    Left with(data_.outputs.size()), without(data_.outputs.size());
    Eigen::Index at = 0;
    for (const auto& recording : data_.recordings)
      for (std::size_t o = 0; o < with.size(); ++o) {
        auto &e = with[o].emplace_back(), &f = without[o].emplace_back();
        for (std::size_t i = 0; i < recording.inputs.rows(); ++i, ++at)
          e.push_back(raw_(at)), f.push_back(raw_(at) - times * effect.raw(at));
      }
    return lead_of(data_, with, without);
  }

  const Case& data_;
  const Diagnosis& d_;
  Eigen::VectorXd raw_, left_;
  Eigen::MatrixXd own_;
  Eigen::LDLT<Eigen::MatrixXd> curvature_;
};

struct Smallest {
  const Screened* screened = nullptr;
  double value = 0.0;
};

/// A wave shows at other sizes by how fine it is: the finest alone would say too much.
struct Range {
  Smallest least, most;
};

/// Parameter that says how fine a wave is; `most_parameters` where a term is none.
std::size_t fineness(const physics::TermInfo& info) {
  return std::min({info.index_of("pitch"), info.index_of("frequency"), physics::most_parameters});
}

Detectable described(const Case& data, const Smallest& smallest, double times) {
  const auto& term = smallest.screened->start.term;
  const auto& info = *term.info;
  const auto amplitude = smallest.screened->start.directions[0].amplitude;
  const auto unit = [&](std::size_t i) { return physics::unit_of_parameter(data.model, term, i); };
  Detectable effect{
      std::string{info.name}, term.on, std::string{info.parameters[amplitude].name}, unit(amplitude),
      times * smallest.value, {}};
  if (const auto i = fineness(info); i < physics::most_parameters)
    effect.at = Quantity{std::string{info.parameters[i].name}, unit(i), term.values[i]};
  return effect;
}

/// Can a term be of that size at all? Beyond the bound of its parameter the recording shows the effect at no size.
bool is_possible(const Case& data, const Smallest& smallest, double times) {
  const auto& start = smallest.screened->start;
  return times * smallest.value <=
         physics::bounds_of_parameter(data.model, start.term, start.directions[0].amplitude).upper;
}

}  // namespace

void smallest_effects(const Case& data, const std::vector<Screened>& screened, Diagnosis& d) {
  std::map<std::string, Range> ranges;
  for (const auto& s : screened) {
    const auto& info = *s.start.term.info;
    if (s.start.directions.empty() || s.start.directions[0].amplitude >= physics::most_parameters ||
        !(s.gain > 0.0))
      continue;
    // The gain goes with the square of the strength: where it would just reach the margin.
    const double value =
        s.strength.norm() * std::sqrt((claim_margin_of(d.weighing) + thresholds::price_of_a_term) / s.gain);
    auto& [least, most] = ranges[std::string{info.name}];
    if (least.screened == nullptr || value < least.value) least = {&s, value};
    if (most.screened == nullptr || value > most.value) most = {&s, value};
  }
  std::vector<Smallest> smallest;
  for (const auto& [name, range] : ranges) {
    smallest.push_back(range.least);
    const auto& info = *range.least.screened->start.term.info;
    if (fineness(info) < physics::most_parameters && range.most.screened != range.least.screened)
      smallest.push_back(range.most);
  }
  if (!data.is_time_series || d.best.columns.cols() != static_cast<Eigen::Index>(d.best.free.size())) {
    for (const auto& one : smallest)
      if (is_possible(data, one, 1.0)) d.detectable.push_back(described(data, one, 1.0));
    return;
  }
  const Series series{data, d};
  constexpr double finer = 1.25, most = 100.0;
  std::vector<double> times(smallest.size(), 1.0);
  in_parallel(smallest.size(), [&](std::size_t i) {
    const auto& one = smallest[i];
    const auto effect = series.effect(*one.screened, one.value / one.screened->strength.norm());
    while (times[i] < most && !series.shows(effect, times[i])) times[i] *= finer;
  });
  for (std::size_t i = 0; i < smallest.size(); ++i)
    if (times[i] < most && is_possible(data, smallest[i], times[i]))  // else it could be a wander at any size
      d.detectable.push_back(described(data, smallest[i], times[i]));
}

}  // namespace invar::diagnosis

#include "core/diagnosis/evidence/shaken_loose.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/diagnosis/thresholds.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

physics::Model with_bend(const Fit& base, const char* name, double size) {
  auto model = base.model;
  auto& term = model.terms.emplace_back();
  term.info = physics::find_term(physics::Plant::axis, name);
  term.values[0] = size;
  term.given[0] = true;
  return model;
}

struct Step {
  double size = 0.0, sigma = 0.0;
  Eigen::VectorXd numbers;  // of the base, by how much they move
};

/// Size and numbers that fit best if the effect goes with the size as from 0 to here.
Step solved(const Weighing& weighing, const Fit& base, const Eigen::MatrixXd& columns,
            const Eigen::VectorXd& effect, double size) {
  Eigen::MatrixXd all(columns.rows(), columns.cols() + 1);
  all << columns, effect / size;
  Eigen::MatrixXd normal = weighing.temper * (all.transpose() * all);
  Eigen::VectorXd slope = -weighing.temper * (all.transpose() * base.residual);
  for (Eigen::Index k = 0; k < columns.cols(); ++k)
    if (const double sigma = base.free[static_cast<std::size_t>(k)].sigma; sigma > 0.0)
      normal(k, k) += 1.0 / (sigma * sigma);
  normal.diagonal() *= 1.0 + 1e-9;
  const Eigen::Index last = columns.cols();
  const Eigen::MatrixXd covariance =
      numerics::solve_symmetric(normal, Eigen::MatrixXd::Identity(last + 1, last + 1));
  const Eigen::VectorXd found = covariance * slope;
  return {found(last), std::sqrt(std::max(0.0, covariance(last, last))), found.head(last)};
}

/// Size and numbers as the runs of this size say, if `at` are those without it.
Step looked_for(const Case& data, const LoopNoise& noise, const Weighing& weighing, const Fit& base,
                const Eigen::MatrixXd& columns, const Eigen::VectorXd& at, const char* name, double size,
                LoopNoise::Runs runs) {
  const Eigen::VectorXd raw = differences(data, noise.shaken_mean(with_bend(base, name, size), runs)) - at;
  return solved(weighing, base, columns, filtered(data, weighing, raw), size);
}

bool is_seen(const Step& step, double sigmas) {
  return std::isfinite(step.size) && step.size >= sigmas * step.sigma;
}

std::optional<ShakenLoose> best_size(const Case& data, const LoopNoise& noise, const Weighing& weighing,
                                     const Fit& base, const Eigen::MatrixXd& columns,
                                     const Eigen::VectorXd& at, const char* name, double size) {
  Step step;
  for (int i = 0; i < 5; ++i) {
    step = looked_for(data, noise, weighing, base, columns, at, name, size, LoopNoise::Runs::few);
    if (!is_seen(step, thresholds::shaken_sure)) return std::nullopt;
    const double next = std::clamp(step.size, 0.1 * size, 10.0 * size);
    const bool arrived = std::abs(next - size) < 0.1 * size;
    size = next;
    if (arrived) break;
  }
  auto moved = base;
  for (std::size_t k = 0; k < base.free.size(); ++k)
    set(moved.model, base.free[k],
        base.free[k].bounds.clamp(get(base.model, base.free[k]) +
                                  step.numbers(static_cast<Eigen::Index>(k))));
  ShakenLoose found{with_bend(moved, name, size), {}, {}, 0.0};
  found.weighing = weigh(data, noise.shaken_mean(found.model));
  found.without = fit(data, found.weighing, base.model, data.model, Effort::follow(4), &base).model;
  const double rows = std::max(10.0, found.weighing.temper * static_cast<double>(base.residual.size()));
  found.gain = noise.gain(found.model, found.without, found.weighing) - 0.5 * std::log(rows);
  return found;
}

}  // namespace

std::optional<ShakenLoose> shaken_loose(const Case& data, const LoopNoise& noise, const Weighing& weighing,
                                        const Fit& base, const std::set<std::string, std::less<>>& without) {
  if (!noise.is_fed_back() || data.outputs.size() < 2) return std::nullopt;
  const auto is_known = [&](std::string_view site) {
    return std::any_of(base.model.terms.begin(), base.model.terms.end(), [&](const auto& term) {
      return term.info->sticks_and_slips && term.info->site == site;
    });
  };
  // Of about the size that the noise has: what is far smaller or larger takes a few steps more.
  const double current = weighing.filters[1].sigma, reading = weighing.filters[0].sigma;
  struct Bend {
    const char *name, *site;
    double size;
  };
  const Eigen::MatrixXd columns = whitened(data, weighing, base.columns).dense();
  const Eigen::VectorXd roughly_at = differences(data, noise.shaken_mean(base.model, LoopNoise::Runs::two));
  Eigen::VectorXd at;  // once something is seen
  std::optional<ShakenLoose> best;
  for (const Bend& bend :
       {Bend{"coulomb_friction", "force", 0.05 * base.model.value("motor_constant", 1.0) * current},
        Bend{"dead_zone", "actuator", 0.2 * current}, Bend{"backlash", "measurement", reading}}) {
    if (without.contains(bend.name) || is_known(bend.site)) continue;
    if (!is_seen(looked_for(data, noise, weighing, base, columns, roughly_at, bend.name, bend.size,
                            LoopNoise::Runs::two),
                 thresholds::shaken_perhaps))
      continue;
    if (at.size() == 0) at = differences(data, noise.shaken_mean(base.model));
    auto one = best_size(data, noise, weighing, base, columns, at, bend.name, bend.size);
    if (one && (!best || one->gain > best->gain)) best = std::move(one);
  }
  return best;
}

}  // namespace invar::diagnosis

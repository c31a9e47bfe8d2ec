#include "core/diagnosis/checks/late_command.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/base/quantity.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

using physics::Term;

Term started(const char* name) {
  Term term;
  term.info = physics::find_term(physics::Plant::axis, name);
  for (std::size_t i = 0; i < term.info->parameter_count(); ++i)
    term.values[i] = term.info->parameters[i].starts[0], term.given[i] = true;
  return term;
}

namespace {

/// What the law asked for, as it would come late: some cycles later, or through a lag.
struct Late {
  Term term;
  std::string words;
  std::vector<std::vector<double>> asked;  // by recording
};

std::vector<double> lagged(const std::vector<double>& asked, double cycles) {
  const double share = -std::expm1(-1.0 / cycles);
  std::vector<double> late = asked;
  for (std::size_t i = 1; i < late.size(); ++i)
    if (std::isfinite(late[i]) && std::isfinite(asked[i - 1]))
      late[i] = late[i - 1] + share * (asked[i - 1] - late[i - 1]);
  return late;
}

/// The first is not late at all.
std::vector<Late> late_commands(const Case& data, const std::vector<LawRows>& law) {
  const double cycle = 1.0 / data.model.controller->rate;
  std::vector<Late> all;
  for (std::size_t d = 0; d <= thresholds::most_cycles_late; ++d) {
    auto& late = all.emplace_back(
        Late{started("transport_delay"), "a delay of " + si(static_cast<double>(d) * cycle, "s"), {}});
    late.term.values[0] = (static_cast<double>(d) - 0.5) * cycle;  // what is held for a cycle comes within it
    for (const auto& rows : law) {
      auto& asked = late.asked.emplace_back(rows.asked.size(), std::nan(""));
      std::copy(rows.asked.begin(), rows.asked.end() - static_cast<std::ptrdiff_t>(std::min(d, asked.size())),
                asked.begin() + static_cast<std::ptrdiff_t>(std::min(d, asked.size())));
    }
  }
  constexpr double finer = 1.15;
  for (double cycles = 0.3; cycles < static_cast<double>(thresholds::most_cycles_late); cycles *= finer) {
    auto& late =
        all.emplace_back(Late{started("amplifier_lag"), "a lag of " + si(cycles * cycle, "s", 2), {}});
    late.term.values[0] = cycles * cycle;
    for (const auto& rows : law) late.asked.push_back(lagged(rows.asked, cycles));
  }
  return all;
}

}  // namespace

std::optional<Added> comes_late_from_law(const Case& data, const std::vector<LawRows>& law) {
  constexpr Eigen::Index lags = 12;
  const auto place = std::find(data.outputs.begin(), data.outputs.end(), "current") - data.outputs.begin();
  const auto simulated = simulate(data, data.model);
  const auto all = late_commands(data, law);
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(lags, lags),
                  product = Eigen::MatrixXd::Zero(lags, static_cast<Eigen::Index>(all.size()));
  Eigen::VectorXd white = Eigen::VectorXd::Zero(product.cols()), instruments(lags), left(product.cols());
  double rows = 0.0;
  for (std::size_t r = 0; r < law.size(); ++r)
    for (std::size_t i = thresholds::most_cycles_late; i < law[r].asked.size(); ++i) {
      if (!std::isfinite(law[r].asked[i]) || !std::isfinite(law[r].asked[i - thresholds::most_cycles_late]))
        continue;
      const auto& expected = simulated[r][static_cast<std::size_t>(place)];
      for (std::size_t j = 0; j < static_cast<std::size_t>(lags); ++j)
        instruments(static_cast<Eigen::Index>(j)) = expected[i - j] - expected[i - j - 1];
      for (std::size_t k = 0; k < all.size(); ++k)
        left(static_cast<Eigen::Index>(k)) = law[r].asked[i] + law[r].beyond[i] - all[k].asked[r][i];
      square += instruments * instruments.transpose(), product += instruments * left.transpose();
      white += left.cwiseAbs2(), rows += 1.0;
    }
  if (rows < static_cast<double>(thresholds::fewest_rows_of_law) || !(square.trace() > 0.0))
    return std::nullopt;
  square.diagonal().array() += 1e-9 * square.trace();
  const Eigen::VectorXd goes_with =
      product.cwiseProduct(numerics::solve_symmetric(square, product)).colwise().sum();
  Eigen::Index best = 0;
  if (!goes_with.allFinite()) return std::nullopt;
  goes_with.minCoeff(&best);
  // By chance as many squares of a row go with the instruments as there are of these; a late command leaves no more.
  const auto by_chance = [&](Eigen::Index k) {
    return thresholds::late_beyond_chance * static_cast<double>(lags) * white(k) / rows;
  };
  if (best == 0 || goes_with(0) < by_chance(0) || goes_with(best) > thresholds::late_leaves * goes_with(0) ||
      goes_with(best) > by_chance(best))
    return std::nullopt;
  const auto& late = all[static_cast<std::size_t>(best)];
  return Added{late.term, late.words, 1.0 - goes_with(best) / goes_with(0)};
}

}  // namespace invar::diagnosis

#include "core/diagnosis/search/suspect.hpp"

#include <Eigen/Core>
#include <array>

#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

/// The gain (log likelihood) of readings that follow the model's outputs late, by 3, 20 and 120 rows.
double gain_of_lateness(const Case& data, const Diagnosis& d, std::size_t output) {
  const auto simulated = simulate(data, d.best.model);
  constexpr std::array spans{3.0, 20.0, 120.0};
  Eigen::MatrixXd late = Eigen::MatrixXd::Zero(d.best.residual.size(), spans.size());
  Eigen::Index at = 0;
  for (const auto& one : simulated)
    for (std::size_t o = 0; o < one.size(); ++o)
      for (std::size_t k = 0; k < spans.size(); ++k) {
        double past = one[o].front();
        for (std::size_t i = 0; i < one[o].size(); ++i) {
          past += (one[o][i] - past) / spans[k];
          if (o == output)
            late(at + static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = one[o][i] - past;
        }
        if (k + 1 == spans.size()) at += static_cast<Eigen::Index>(one[o].size());
      }
  Eigen::MatrixXd columns(late.rows(), d.best.columns.cols() + late.cols());
  columns << whitened(data, d.weighing, d.best.columns).dense(), whitened(data, d.weighing, late);
  const Eigen::VectorXd strength = numerics::least_squares(columns, d.best.residual);
  return 0.5 * d.weighing.temper *
         (d.best.residual.squaredNorm() - (d.best.residual - columns * strength).squaredNorm());
}

}  // namespace

Suspect most_suspect(const Case& data, const Diagnosis& d) {
  const std::string plant{physics::name_of(data.model.plant)};
  Suspect suspect;
  double most = 0.0;
  if (const auto screened = screen(data, d.weighing, d.best, unmodelled_starts(data, d.best), 0);
      !screened.empty()) {
    const auto& term = screened.front().start.term;
    suspect = {site_of(data, term), place_of(data, term), dependence(data, term)};
    most = screened.front().gain;
  }
  for (std::size_t o = 0; o < data.outputs.size() && data.is_time_series; ++o) {
    const double gain = gain_of_lateness(data, d, o);
    if (!(gain > most) && !suspect.site.empty()) continue;
    most = gain;
    // In the user's own equations an output is a place by itself.
    const bool own = data.model.plant == physics::Plant::equations;
    suspect = {plant + (own ? ".output" : ".measurement"), "reading of " + data.outputs[o], {"history"}};
  }
  if (suspect.site.empty()) suspect.site = plant;
  return suspect;
}

}  // namespace invar::diagnosis

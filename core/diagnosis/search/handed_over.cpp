#include "core/diagnosis/search/handed_over.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/thresholds.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

bool is_zero(const physics::Term& term) {
  bool any = false;
  for (std::size_t i = 0; i < term.info->parameter_count(); ++i) {
    if (term.info->parameters[i].role != physics::Role::amplitude) continue;
    any = true;
    if (term.values[i] != 0.0) return false;
  }
  for (const double value : term.curve.values) {
    any = true;
    if (value != 0.0) return false;
  }
  return any;
}

void take_back(const Case& data, Diagnosis& d, std::size_t finding, const std::string& why) {
  const auto place = data.model.terms.size() + finding;
  const bool is_rest = d.has_rest && finding + 1 == d.findings.size();
  d.reject(std::string{d.best.model.terms[place].info->name}, why, 0.0);
  d.best = fit(data, d.weighing, physics::without_term(d.best.model, place), data.model, Effort::follow(6));
  d.findings.erase(d.findings.begin() + static_cast<std::ptrdiff_t>(finding));
  if (is_rest) d.has_rest = false;
  if (d.findings.empty()) d.has_rest = d.is_unnamed = false;
}

}  // namespace

bool is_worse(double one, double than, double noise) {
  return !(one <= thresholds::worse_by_chance * than) &&
         !(one * one - than * than <= thresholds::within_noise * noise * noise);
}

bool is_worse(const std::vector<FitRow>& fit, OfModel one, OfModel than) {
  bool any = false;
  double sum = 0.0;  // of logarithms
  for (const auto& row : fit) {
    if (row.*one == 0.0 && row.*than == 0.0) continue;  // nothing was measured
    const double least = 0.5 * row.noise_floor + 1e-300;
    sum += std::log(std::max(row.*one, least) / std::max(row.*than, least));
    if (!is_worse(row.*one, row.*than, row.noise_floor)) continue;
    any = true;
    if (!(row.*one <= thresholds::plainly_worse * row.*than)) return true;
  }
  return any && !(sum <= 0.0);
}

bool leave_out_nothings(const Case& data, Diagnosis& d) {
  bool any = false;
  const auto beyond_best = [&](const physics::Model& model) {
    return residual(data, d.weighing, model).squaredNorm() - d.best.residual.squaredNorm();
  };
  for (std::size_t i = d.findings.size(); i-- > 0;) {
    const std::size_t place = data.model.terms.size() + i;
    const double lost = beyond_best(physics::without_term(d.best.model, place));
    if (!is_zero(d.best.model.terms[place]) && lost > thresholds::does_nothing * beyond_best(d.retuned.model))
      continue;
    take_back(data, d, i, "with the size that fits best it explains nothing");
    any = true;
  }
  return any;
}

void take_last_back(const Case& data, Diagnosis& d, const std::string& why) {
  take_back(data, d, d.findings.size() - 1, why);
}

}  // namespace invar::diagnosis

// The start of a search: outliers out, segments cut, the user's own numbers refitted.
#include "core/diagnosis/search/search.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/diagnosis/checks/own_units.hpp"
#include "core/diagnosis/dataset/outliers.hpp"
#include "core/diagnosis/estimate/unknown_sizes.hpp"
#include "core/diagnosis/search/one_name.hpp"
#include "core/diagnosis/search/pairs.hpp"
#include "core/diagnosis/segments/steps.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

/// Does a run stay far from the machine for long, by far more than what comes anew from row to row (second differences: a
/// motion at a steady rate is none)?
bool goes_another_way(const Case& data, const Fit& fit) {
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
    if (robust_sigma(left) > thresholds::goes_another_way * robust_sigma(anew)) return true;
  }
  return false;
}

}  // namespace

void Search::begin() {
  progress_(0.02, "simulating the nominal model");
  const auto simulated = simulate(data_, data_.model);
  drop_outliers(data_, simulated);
  d_.weighing =
      weigh(data_, simulated, Colour::white);  // far from the truth a filter would hide what to follow
  d_.retuned = fit(data_, d_.weighing, data_.model, data_.model, Effort::follow(8));
}

void Search::prepare() {
  find_unknown_sizes(data_);
  const Case as_given = data_;
  cut_into_windows(data_);
  Case as_read = data_;
  begin();
  if (goes_another_way(data_, d_.retuned))
    if (const auto near = begun_in_windows(data_)) {
      const auto found = fit(data_, d_.weighing, *near, data_.model, Effort::follow(8));
      if (least_ratio(data_, found, d_.retuned) < thresholds::other_valley) d_.retuned = found;
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
    d_.weighing = weigh(data_, simulate(data_, d_.retuned.model), Colour::white);
    d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, Effort::follow(8));
  }
  std::vector<double> noise;
  for (const auto& filter : d_.weighing.filters) noise.push_back(filter.sigma);
  if (step_finely(data_, d_.retuned.model, noise))
    for (int again = 0; again < 2; ++again) {
      d_.weighing = weigh(data_, simulate(data_, d_.retuned.model), Colour::white);
      d_.retuned = fit(data_, d_.weighing, d_.retuned.model, data_.model, Effort::follow(8));
    }
  check_own_units(data_, d_.retuned);
  noise_.emplace(data_);
  d_.weighing = weigh(data_, simulate(data_, d_.retuned.model));
  // Coloured weights may follow the colour of what is missing; a fit that they make plainly worse is not taken.
  auto coloured = fit(data_, d_.weighing, d_.retuned.model, data_.model, Effort::follow(6), &d_.retuned);
  d_.retuned = least_ratio(data_, d_.retuned, coloured) < 0.9
                   ? fit(data_, d_.weighing, d_.retuned.model, data_.model, Effort::evaluate(), &d_.retuned)
                   : std::move(coloured);
  d_.best = d_.retuned;
  if (goes_another_way(data_, d_.best)) alone_ = names_in_windows(data_, options_.without);
}

}  // namespace invar::diagnosis

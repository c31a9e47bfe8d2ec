// Comparison of fits: the squares that each leaves, and how far each went from what is believed.
#pragma once

#include <vector>

#include "core/diagnosis/estimate/fit.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// The sums of measured - simulated of one output.
struct Squares {
  double sum = 0.0, count = 0.0;
  void operator+=(const Squares& more) { sum += more.sum, count += more.count; }
  [[nodiscard]] double rms() const;
};
/// By output, of the rows that belong to a weighing.
std::vector<Squares> squares_left(const Case& data, const std::vector<physics::Outputs>& simulated,
                                  const Weighing& on);
/// Sum of squares of measured - simulated by output.
std::vector<double> squares_left(const Case& data, const physics::Model& model);
/// By how many of the user's sigmas his numbers moved at most; where a window begins is none of them.
double excursion_of(const Fit& fit);
/// The smallest ratio of residual RMS of any output, a over b.
double least_ratio(const Case& data, const Fit& a, const Fit& b);
/// `near`, followed under the filters of its own residual. Filters that hold what is still missing for noise may lead the
/// numbers away. Where `near` leaves less than the share `leads_away` of an output's RMS, its numbers stay.
Fit fit_near(const Case& data, const Weighing& filters, const Fit& near, Effort effort, double leads_away);

}  // namespace invar::diagnosis

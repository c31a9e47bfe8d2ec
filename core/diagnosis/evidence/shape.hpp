// Has what a name explains the name's own shape? A relative of the right law fits well and leaves a course over the same
// variable, or the trace of a second time constant.
#pragma once

#include "core/diagnosis/evidence/other_cause.hpp"

namespace invar::diagnosis {

struct OtherShape {
  double lead =
      0.0;  // log likelihood in independent rows that a freer shape has over the name's, its price paid
  double share =
      0.0;  // of what the freer shape explains, how much the name leaves; 0 where the lead is chance
};

/// How what comes late bends with each of its times: f(1.5 T) + f(T / 2) - 2 f(T), not whitened; no columns for a term that
/// has no memory.
Eigen::MatrixXd second_times(const Case& data, const Fit& named, std::size_t term);

/// Log likelihood in independent rows by which the recording would show outputs that are off by `shift`. Counted is the part
/// that the fit's other numbers cannot take up, against the residual of the fit.
double lead_over_shift(const Case& data, const Fit& named, const Eigen::MatrixXd& shift);

/// Freer shapes of named term `term` of `named.fit`: a course over its own variable beside it, and, of what comes late, a
/// second time constant. To first order, the other numbers free.
OtherShape other_shape(const Case& data, const Beside& named, std::size_t term);

}  // namespace invar::diagnosis

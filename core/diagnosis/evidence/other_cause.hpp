// The hypothesis "some other cause": a free course over any variable, at any site, in place of a named term or beside it.
#pragma once

#include <optional>

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// measured - simulated by output and recording; NaN where nothing was measured.
using Left = std::vector<std::vector<std::vector<double>>>;

struct Lead {
  double ratio = 1.0;        // the least of the residuals of any output, one over the other
  double gain = 0.0;         // log likelihood, counted in independent rows of the residual that is smaller
  double independent = 0.0;  // so many rows
};
Lead lead_of(const Case& data, const Left& one, const Left& other);

/// Log likelihood of `one` over `other`, counted in independent rows of the residual of `one`, less the price of its further
/// numbers. It says which is right whatever the colour of the noise.
double lead(const Case& data, const Fit& one, const Fit& other);

/// The evidence of `one` over `other`, both under `weighing`; where its filters could not be fitted (too few rows), not
/// more of it than independent rows give.
double advantage(const Case& data, const Weighing& weighing, const Fit& one, const Fit& other);

/// Does most of the evidence under the filters count in independent rows too? Then no noise that wanders is left.
inline bool is_white(double evidence, double counted) { return counted > thresholds::white_share * evidence; }
/// So many times the margin a further claim must gain that hardly moves the size of the residual.
double margins_of_a_further(const Case& data, double evidence, double counted);

/// So many curves are tried, and carry their columns.
inline constexpr std::size_t tried_curves = 3;
/// A model with every row counted alike, and what free courses and courses with memory would gain beside it, best first.
struct Beside {
  Weighing plain;
  Fit fit;
  std::vector<Screened> courses, memories;
};
/// The courses go from where to where the variables go with `spanned`; the fit itself where it is not given.
Beside courses_beside(const Case& data, const Fit& best, const Fit* spanned = nullptr);
/// The same of courses that go in proportion to something else as well, in the user's own equations.
Beside products_beside(const Case& data, const Fit& best);

struct OtherCause {
  Fit fit;
  double lead = 0.0;  // over the named model
};

/// The free course that does clearly better in place of named term `term` of `named.fit` (the other terms stay). None is
/// tried where no course would gain beside the name: what helps in its place helps beside it too.
std::optional<OtherCause> other_cause(const Case& data, const Beside& named, std::size_t term);

}  // namespace invar::diagnosis

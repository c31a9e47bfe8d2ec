// Marks: how well a diagnosis answers for a made machine.
#pragma once

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/physics/simulation.hpp"
#include "tests/support/mismatch/machine.hpp"

namespace invar::test::mismatch {

/// How far the best nominal model stays from the quiet truth, as half the sum of squares in units of the noise: the log
/// likelihood that there is to win. Below `hidden` nobody could claim anything; above `plain` one must.
double to_be_won(const Machine& machine);
/// The same of each missing effect beside the others, as `missing` has them. Infinite where the effect cannot be taken out
/// alone.
std::vector<double> to_be_won_beside(const Machine& machine, unsigned seed, const Trouble& trouble);
inline constexpr double hidden = 12.0, plain = 120.0;

struct Marks {
  double verdict = 0.0;
  double located = 0.0, named = 0.0;  // means over the missing terms
  int false_claims = 0;               // findings that are neither true nor a relative
  double fit = 0.0;                   // share of the achievable on another motion
  double seconds = 0.0;
};

physics::Model model_of(const Machine& machine);
diagnosis::Case case_of(const Machine& machine);
/// `win` is to_be_won, `beside` to_be_won_beside where there are several effects: one below `plain` need not be found.
Marks mark(const Machine& machine, const diagnosis::Case& data, const diagnosis::Diagnosis& d, double win,
           const std::vector<double>& beside = {});
/// The share of what a perfect model would gain on the test run over the believed one.
double fit_on_test(const Machine& machine, const physics::Model& believed, const physics::Model& patched);
/// The same of outputs on `machine.test_inputs` that are no model's.
double fit_on_test(const Machine& machine, const physics::Model& believed, const physics::Outputs& after);
/// 1, or what a relative counts; 0 for a false claim.
double credit(const Machine& machine, const std::string& term);

}  // namespace invar::test::mismatch

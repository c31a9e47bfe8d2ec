// `detectable` is true: twice the smallest effect that a recording is said to show is seen (23 of 23 on five machines), and of
// a third of it little is (5 of 23): the figure errs towards too large.
#include <gmock/gmock.h>

#include <cmath>

#include "core/physics/library.hpp"
#include "tests/support/mismatch/marks.hpp"

namespace invar::test::mismatch {
namespace {

/// The case with a term added to the machine: what it changes in the simulation is added to what was measured.
diagnosis::Case with_effect(const Machine& machine, const diagnosis::Diagnosis& d,
                            const physics::Term& term) {
  auto data = case_of(machine);
  auto truth = d.retuned.model;
  truth.terms.push_back(term);
  for (auto& recording : data.recordings) {
    physics::Outputs without, with;
    recording.simulation->run(d.retuned.model, without);
    recording.simulation->run(truth, with);
    for (std::size_t o = 0; o < with.size(); ++o)
      for (std::size_t i = 0; i < with[o].size(); ++i) recording.measured[o][i] += with[o][i] - without[o][i];
  }
  return data;
}

TEST(Detectable, TwiceTheSmallestEffectIsSeenAndAThirdMostlyNot) {
  int tried = 0, seen_twice = 0, seen_third = 0;
  std::string missed;
  const auto silent = [](double, const std::string&) {};
  for (const auto& [plant, seed] :
       {std::pair{"error_map", 11U}, {"droplet", 11U}, {"thermal", 11U}, {"sensor", 11U}}) {
    const auto machine = make(plant, "none", 1.0, seed);
    auto null = case_of(machine);
    const auto d = diagnosis::diagnose(null, silent);
    if (d.verdict != diagnosis::Verdict::no_mismatch) continue;
    for (const auto& entry : d.detectable) {
      physics::Term term;
      term.info = physics::find_term(null.model.plant, entry.term);
      term.on = entry.on;
      const auto shapes = entry.at ? 2U : 0U;  // a wave's pitch is told, and its phase is free
      if (term.info->parameter_count() > 1 + shapes) continue;  // the others' values are not told
      if (entry.at) term.values[term.info->index_of(entry.at->name)] = entry.at->value;
      ++tried;
      for (const double times : {2.0, 0.3}) {
        term.values[term.info->index_of(entry.parameter)] = times * entry.value;
        auto data = with_effect(machine, d, term);
        const auto found = diagnosis::diagnose(data, silent);
        const bool seen = found.verdict != diagnosis::Verdict::no_mismatch;
        (times > 1.0 ? seen_twice : seen_third) += seen ? 1 : 0;
        std::string names;
        for (const auto& f : found.findings) names += std::string{f.term.info->name} + " ";
        if (seen != (times > 1.0))
          missed += "\n" + std::string{plant} + " " + entry.term + " " + std::to_string(times) + " times " +
                    std::to_string(entry.value) + ": " + diagnosis::name_of(found.verdict) + " " + names;
      }
    }
  }
  EXPECT_GE(tried, 10);
  EXPECT_GE(10 * seen_twice, 9 * tried) << missed;
  EXPECT_LE(10 * seen_third, 4 * tried) << missed;
}

}  // namespace
}  // namespace invar::test::mismatch

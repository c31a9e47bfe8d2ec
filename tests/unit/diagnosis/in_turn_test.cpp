// No trick, plant by plant: each name taken out of the library in turn, and machines with nothing to find.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/options.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "tests/support/mismatch/claims.hpp"
#include "tests/support/mismatch/marks.hpp"

namespace invar::test::mismatch {
namespace {

class InTurn : public ::testing::TestWithParam<const char*> {};

struct Answer {
  diagnosis::Case data;
  diagnosis::Diagnosis d;
};

Answer diagnosed(const Machine& machine, const diagnosis::Options& options = {}) {
  Answer answer{case_of(machine), {}};
  answer.d = diagnosis::diagnose(
      answer.data, [](double, const std::string&) {}, options);
  return answer;
}

Trouble trouble_of(unsigned seed) {
  Trouble trouble;
  trouble.colour = seed % 2 == 0 ? Colour::white : seed % 4 == 1 ? Colour::memory : Colour::wander;
  trouble.faults = seed % 3 == 0;
  if (seed % 5 != 0) trouble.rows = 3000;
  return trouble;
}

TEST_P(InTurn, ANameThatIsTakenOutOfTheLibraryLeavesNoConfidentWrongOne) {
  unsigned seed = 370;
  for (const auto& effect : effects(GetParam())) {
    if (effect == "none" || effect == "parameter" || effect.rfind("unknown", 0) == 0) continue;
    ++seed;
    const auto machine = make(GetParam(), effect, 1.0, seed, trouble_of(seed));
    SCOPED_TRACE(effect + ", seed " + std::to_string(seed));
    diagnosis::Options options;
    for (const auto& missing : machine.missing)
      for (const auto& [name, credit] : missing.names)
        if (credit == 1.0) options.without.insert(name);
    const auto answer = diagnosed(machine, options);
    for (const auto& finding : answer.d.findings) {
      const std::string name{finding.term.info->name};
      EXPECT_FALSE(options.without.contains(name));
      EXPECT_TRUE(name == "unmodelled" || finding.stand_in != nullptr || credit(machine, name) > 0.0 ||
                  finding.probability < confident)
          << diagnosis::summary(answer.data, answer.d);
    }
  }
}

// Of 30 of which none is claimed, the rate is below 1 - 0.05^(1/30) = 0.095 (Clopper and Pearson, 95 %).
TEST_P(InTurn, OfThirtyMachinesWithNothingToFindNoneHasAFinding) {
  constexpr unsigned machines = 30;
  unsigned claimed = 0;
  for (unsigned seed = 381; seed < 381 + machines; ++seed) {
    const auto answer = diagnosed(make(GetParam(), "none", 1.0, seed, trouble_of(seed)));
    if (answer.d.findings.empty()) continue;
    ++claimed;
    ADD_FAILURE() << "seed " << seed << ": " << diagnosis::summary(answer.data, answer.d);
  }
  if (claimed == 0)
    std::cout << GetParam() << ": none of " << machines << " with a claim; the rate is below "
              << 1.0 - std::pow(0.05, 1.0 / machines) << " (95 %)\n";
}

INSTANTIATE_TEST_SUITE_P(Plants, InTurn,
                         ::testing::Values("axis", "thermal", "error_map", "droplet", "sensor", "equations"),
                         [](const auto& plant) { return std::string{plant.param}; });

}  // namespace
}  // namespace invar::test::mismatch

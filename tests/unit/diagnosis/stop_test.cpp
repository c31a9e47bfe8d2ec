// Ctrl-C at any moment: what was claimed until then stays, nothing is claimed on half a fit, and the report says so.
#include <gmock/gmock.h>

#include <atomic>
#include <nlohmann/json.hpp>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/options.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "tests/support/mismatch/marks.hpp"

namespace invar::test::mismatch {
namespace {

using ::testing::Each;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::Le;

struct Run {
  diagnosis::Case data;
  diagnosis::Diagnosis diagnosis;
  std::vector<double> shares;  // of the progress
  long asked = 0;              // how often whether to stop
};

/// Told to stop when it asks for the `patience`-th time; negative: never.
Run run(const Machine& machine, long patience) {
  Run r;
  r.data = case_of(machine);
  std::atomic<long> asked{0};
  diagnosis::Options options;
  options.stopped = [&] { return asked++ >= patience && patience >= 0; };
  r.diagnosis = diagnosis::diagnose(
      r.data, [&](double share, const std::string&) { r.shares.push_back(share); }, options);
  r.asked = asked;
  return r;
}

std::vector<std::string> names(const diagnosis::Diagnosis& d) {
  std::vector<std::string> all;
  for (const auto& finding : d.findings) all.emplace_back(finding.term.info->name);
  return all;
}

TEST(Stopped, AtNoMomentAnythingIsClaimedThatTheWholeSearchWouldNot) {
  const Machine machines[] = {make("thermal", "sensor_lag", 1.0, 3), make("thermal", "none", 1.0, 5),
                              make("equations", "cubic", 1.0, 3)};
  for (const auto& machine : machines) {
    const auto whole = run(machine, -1);
    EXPECT_FALSE(whole.diagnosis.is_partial);
    const auto right = names(whole.diagnosis);
    ASSERT_GT(whole.asked, 100) << "a search that hardly ever asks cannot be stopped";
    for (double share = 0.003; share < 1.0; share *= 5.0) {
      const auto stopped = run(machine, static_cast<long>(share * static_cast<double>(whole.asked)));
      SCOPED_TRACE(machine.effect + ", stopped after " + std::to_string(share) + " of the questions");
      EXPECT_TRUE(stopped.diagnosis.is_partial);
      for (const auto& name : names(stopped.diagnosis)) EXPECT_THAT(right, ::testing::Contains(name));
      // The steps under way end by themselves: hardly a question later the search has ended.
      EXPECT_LT(stopped.asked, static_cast<long>(share * static_cast<double>(whole.asked)) + 60);
      const auto report = nlohmann::json::parse(diagnosis::report_json(stopped.data, stopped.diagnosis));
      EXPECT_TRUE(report.at("partial").get<bool>());
      EXPECT_FALSE(report.at("fit").at("heldout").empty());
      const auto said = diagnosis::summary(stopped.data, stopped.diagnosis);
      EXPECT_THAT(said, HasSubstr("Stopped before all was tried"));
      EXPECT_THAT(said, ::testing::Not(HasSubstr("No mismatch")));
    }
  }
}

TEST(Progress, OnlyGrowsAndEndsAtOne) {
  for (const long patience : {-1L, 50L}) {
    const auto shares = run(make("thermal", "sensor_lag", 1.0, 3), patience).shares;
    EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
    EXPECT_THAT(shares, Each(::testing::AllOf(Ge(0.0), Le(1.0))));
    ASSERT_FALSE(shares.empty());
    EXPECT_EQ(shares.back(), 1.0);
  }
}

}  // namespace
}  // namespace invar::test::mismatch

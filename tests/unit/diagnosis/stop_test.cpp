// Ctrl-C at any moment: what was claimed until then stays, nothing is claimed on half a fit, and the report says so.
#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/diagnosis/search/options.hpp"
#include "tests/support/mismatch/crowd.hpp"
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
  long simulated = 0;          // how often a recording was
};

/// Calls before each run.
class Watched final : public physics::Simulation {
 public:
  Watched(std::shared_ptr<const physics::Simulation> inner, std::function<void()> before)
      : inner_{std::move(inner)}, before_{std::move(before)} {}
  void run(const physics::Model& model, physics::Outputs& outputs) const override {
    before_();
    inner_->run(model, outputs);
  }
  void run_all(const std::vector<const physics::Model*>& models,
               std::vector<physics::Outputs>& outputs) const override {
    before_();
    inner_->run_all(models, outputs);
  }

 private:
  std::shared_ptr<const physics::Simulation> inner_;
  std::function<void()> before_;
};

/// Told to stop in the `patience`-th simulation; negative: never.
Run run(const Machine& machine, long patience) {
  Run r;
  r.data = case_of(machine);
  std::atomic<long> simulated{0};
  std::stop_source stop;
  for (auto& recording : r.data.recordings)
    recording.simulation = std::make_shared<Watched>(recording.simulation, [&] {
      if (simulated++ == patience) stop.request_stop();
    });
  diagnosis::Options options;
  options.stop = stop.get_token();
  r.diagnosis = diagnosis::diagnose(
      r.data, [&](double share, const std::string&) { r.shares.push_back(share); }, options);
  r.simulated = simulated;
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
    ASSERT_GT(whole.simulated, 100) << "too few simulations are seen to stop in one of them";
    for (double share = 0.003; share < 1.0; share *= 5.0) {
      const auto stopped = run(machine, static_cast<long>(share * static_cast<double>(whole.simulated)));
      SCOPED_TRACE(machine.effect + ", stopped after " + std::to_string(share) + " of the simulations");
      EXPECT_TRUE(stopped.diagnosis.is_partial);
      for (const auto& name : names(stopped.diagnosis)) EXPECT_THAT(right, ::testing::Contains(name));
      // What is known is still held out and weighed.
      EXPECT_LT(static_cast<double>(stopped.simulated),
                (share + 0.25) * static_cast<double>(whole.simulated));
      const auto report = nlohmann::json::parse(diagnosis::report_json(stopped.data, stopped.diagnosis));
      EXPECT_TRUE(report.at("partial").get<bool>());
      EXPECT_FALSE(report.at("fit").at("heldout").empty());
      const auto said = diagnosis::summary(stopped.data, stopped.diagnosis);
      EXPECT_THAT(said, HasSubstr("Stopped before all was tried"));
      EXPECT_THAT(said, ::testing::Not(HasSubstr("No mismatch")));
    }
  }
}

TEST(Crowd, AMachineThatSaysNothingOfARowDoesNotRunAwayThere) {
  const double nothing = std::nan("");
  const auto machine = [](std::vector<double> values) {
    Machine m;
    m.quiet.emplace_back().add("y", "m", std::move(values));
    return m;
  };
  const auto bare = machine({nothing, 0.0, 1.0, nothing});
  EXPECT_FALSE(runs_away(bare, bare));  // a crowd of no size at all
  EXPECT_TRUE(runs_away(machine({0.0, 0.0, nothing, 0.0}), bare));
  EXPECT_TRUE(runs_away(machine({0.0, 30.0, 1.0, 0.0}), bare));
  EXPECT_FALSE(runs_away(machine({nothing}), machine({nothing})));
}

TEST(Stopped, NamesTheFurtherWaysThatWereNotTried) {
  const auto stopped = run(make("thermal", "sensor_lag", 1.0, 3), 50);
  EXPECT_THAT(stopped.diagnosis.not_tried, ::testing::Contains(HasSubstr("in other ways")));
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

// Terms that the user names, on the recording of examples/diagnose: an integrator of its own, 1.5 N of dry friction on 2 kg.
#include <gmock/gmock.h>

#include <filesystem>

#include "core/base/fault.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/assumed.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/model/model_file.hpp"

namespace invar::diagnosis {
namespace {

Case example() {
  const auto folder = std::filesystem::path{INVAR_SOURCE_DIR} / "examples" / "diagnose";
  return load_case(model::load(folder / "model.yaml"), {folder / "recording.csv"});
}

TEST(Assumed, TermsStandBesideTheFindingWithTheirOwnNumbers) {
  auto data = example();
  auto d = diagnose(data, [](double, const std::string&) {});
  d.assumed = fit_assumed(data, d, {wanted_of("dry_friction"), wanted_of("lag:F")});
  ASSERT_EQ(d.assumed.size(), 2U);
  const auto& friction = d.assumed[0];
  EXPECT_EQ(friction.finding.term.on, "v");
  EXPECT_GT(friction.finding.sigmas[0], 0.0);
  EXPECT_NEAR(friction.finding.term.values[0], 1.5 / 2.0, 4.0 * friction.finding.sigmas[0]);
  EXPECT_LT(friction.heldout[0].after, 25e-6);  // m; the noise is 20 um
  // What is not there is fitted and told, and explains next to nothing.
  const auto& lag = d.assumed[1];
  EXPECT_EQ(lag.finding.term.on, "F");
  EXPECT_GT(lag.heldout[0].after, 100.0 * friction.heldout[0].after);
  EXPECT_THAT(summary(data, d), ::testing::HasSubstr("assumed: lag, input F: time constant"));
  EXPECT_THAT(report_json(data, d), ::testing::HasSubstr("\"assumed\""));
}

TEST(Assumed, AnUnknownNameOrPlaceIsToldWithTheOnesThereAre) {
  const auto data = example();
  const auto told = [&](const std::string& text) -> std::string {
    try {
      check_wanted(data, {wanted_of(text)}, "--assume");
    } catch (const InputError& fault) {
      return fault.what();
    }
    return "";
  };
  EXPECT_EQ(told("dry_friction"), "");
  EXPECT_EQ(told("dry_friction:v"), "");
  EXPECT_THAT(told("coulomb"),
              ::testing::HasSubstr("`coulomb` is no term of plant equations; name one of constant"));
  EXPECT_EQ(told("lag:x7"),
            "--assume: `lag` does not act at `x7`; name one of its places: F, position, v, x");
}

}  // namespace
}  // namespace invar::diagnosis

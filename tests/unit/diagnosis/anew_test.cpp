// Gaps and further recordings of models in the user's own equations, against machines made here by closed forms.
#include "core/diagnosis/segments/anew.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using test::model_of;

struct Recorded {
  std::vector<double> time, drive, way;
  [[nodiscard]] recording::Table table() const {
    recording::Table table;
    table.add("t", "s", time);
    table.add("drive", "", drive);
    table.add("y", "", way);
    return table;
  }
  /// Without these rows.
  [[nodiscard]] Recorded without(std::size_t from, std::size_t to) const {
    Recorded r = *this;
    for (auto* values : {&r.time, &r.drive, &r.way})
      values->erase(values->begin() + static_cast<std::ptrdiff_t>(from),
                    values->begin() + static_cast<std::ptrdiff_t>(to));
    return r;
  }
};

/// x' = k u + push - x / slow, u a level that changes every `hold` rows: in closed form from row to row.
Recorded store(double slow, double push, std::size_t rows, double begin = 0.0, unsigned seed = 5) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  constexpr double k = 2.0, step = 0.05, noise = 0.01;
  constexpr std::size_t hold = 30;
  Recorded r;
  double x = begin, u = 0.0;
  for (std::size_t i = 0; i < rows; ++i) {
    if (i % hold == 10)
      u = std::uniform_real_distribution<double>{-1.0, 1.0}(random) + (u > 0.0 ? -1.0 : 1.0);
    r.time.push_back(step * static_cast<double>(i));
    r.drive.push_back(u);
    r.way.push_back(x + noise * normal(random));
    const double rest = slow * (k * u + push);
    x = rest + (x - rest) * std::exp(-step / slow);
  }
  return r;
}

physics::Model model_of_store(double slow, const char* initial = "{value: 0, unit: m, sigma: 0}") {
  return model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
      "states: {x: {derivative: 'k*u - a*x', initial: " +
      std::string{initial} +
      "}}\noutputs: {way: {column: y, expression: x}}\n"
      "parameters: {k: {value: 2.0, unit: m/s, sigma: 0.05}, a: {value: " +
      std::to_string(1.0 / slow) + ", unit: 1/s, sigma: " + std::to_string(0.03 / slow) + "}}\n");
}

Diagnosis diagnosed(Case& data) {
  return diagnose(data, [](double, const std::string&) {});
}

/// What a machine that remembers for long was fed while nobody looked: the level changed at row 400, recorded are 380 and 430.
TEST(BehindAGap, WhatRemembersBeginsAnew) {
  auto data = make_case(model_of_store(6.0), {store(6.0, 0.0, 1200).without(395, 430).table()});
  const auto d = diagnosed(data);
  EXPECT_EQ(data.windows.anew, 1U);
  ASSERT_EQ(data.recordings[0].inputs.restarts.size(), 1U);
  EXPECT_EQ(data.recordings[0].inputs.restarts[0], 395U);
  EXPECT_EQ(name_of(d.verdict), "no_mismatch") << (d.findings.empty() ? "" : d.findings[0].term.info->name);
  EXPECT_THAT(summary(data, d), ::testing::HasSubstr("states of their own: 1 stretch"));
}

TEST(BehindAGap, WhatForgetsLosesAFewRows) {
  auto data = make_case(model_of_store(0.3), {store(0.3, 0.0, 1200).without(395, 430).table()});
  const auto d = diagnosed(data);
  EXPECT_EQ(data.windows.anew, 0U);
  EXPECT_GT(data.windows.forgetting, 10U);  // two time constants
  EXPECT_LT(data.windows.forgetting, 60U);
  EXPECT_EQ(name_of(d.verdict), "no_mismatch") << (d.findings.empty() ? "" : d.findings[0].term.info->name);
}

/// Empty cells of an input are a gap too.
TEST(BehindAGap, AnInputThatWasNotReadIsOne) {
  auto recorded = store(6.0, 0.0, 1200);
  for (std::size_t i = 395; i < 430; ++i) recorded.drive[i] = std::nan("");
  auto data = make_case(model_of_store(6.0), {recorded.table()});
  EXPECT_EQ(name_of(diagnosed(data).verdict), "no_mismatch");
  EXPECT_EQ(data.windows.anew, 1U);
  EXPECT_EQ(data.windows.forgetting, 35U);
}

TEST(BehindAGap, AnEffectIsNamedAllTheSame) {
  auto data =
      make_case(model_of_store(6.0), {store(6.0, 0.25, 1200).without(395, 430).without(700, 720).table()});
  const auto d = diagnosed(data);
  EXPECT_GT(data.windows.anew, 0U);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "constant");
  EXPECT_NEAR(d.findings[0].term.values[0], 0.25, 0.02);
}

/// Where nothing happens beside a gap, and where rows come as they come, a run goes on as it always did.
TEST(BehindAGap, OneThatHidesNothingIsBridged) {
  auto held = make_case(model_of_store(6.0), {store(6.0, 0.0, 1200).without(381, 389).table()});
  EXPECT_THAT(begun_anew(held, 50), ::testing::ElementsAre(::testing::IsEmpty()));
  auto sparse = store(6.0, 0.0, 1200);
  std::mt19937 random{3};
  for (std::size_t i = 1190; i > 10; --i)
    if (random() % 2 == 0 && sparse.drive[i] == sparse.drive[i - 1] && sparse.drive[i] == sparse.drive[i + 1])
      sparse = sparse.without(i, i + 1);
  auto uneven = make_case(model_of_store(6.0), {sparse.table()});
  EXPECT_THAT(begun_anew(uneven, 50), ::testing::ElementsAre(::testing::IsEmpty()));
  EXPECT_EQ(uneven.windows.forgetting, 0U);
}

/// The second recording begins elsewhere than the first: its state is its own.
TEST(AFurtherRecording, BeginsWhereItBegins) {
  for (const char* initial : {"{value: 0, unit: m, sigma: 0}", "{value: 0, unit: m, sigma: 0.5}"}) {
    auto data = make_case(model_of_store(6.0, initial),
                          {store(6.0, 0.0, 700).table(), store(6.0, 0.0, 700, 5.0, 8).table()});
    const auto d = diagnosed(data);
    EXPECT_EQ(name_of(d.verdict), "no_mismatch") << (d.findings.empty() ? "" : d.findings[0].term.info->name);
    EXPECT_THAT(data.recordings[1].inputs.restarts, ::testing::ElementsAre(0U));
    EXPECT_NEAR(d.best.model.value("x.start0"), 5.0, 0.05);
  }
  auto same =
      make_case(model_of_store(6.0), {store(6.0, 0.0, 700).table(), store(6.0, 0.0, 700, 0.0, 8).table()});
  EXPECT_EQ(begun_anew(same, 50)[1].size(), 0U);
}

}  // namespace
}  // namespace invar::diagnosis

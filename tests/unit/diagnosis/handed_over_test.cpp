// What is handed over is no worse than what was given, does something, and is shown in bounds and by its name.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <regex>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/handed_over.hpp"
#include "core/diagnosis/search/not_tried.hpp"
#include "core/diagnosis/search/other_run.hpp"
#include "core/diagnosis/search/unsure.hpp"
#include "core/diagnosis/search/verdict.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/library.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tools/diagnose/report_page.hpp"

namespace invar::diagnosis {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double step = 0.01, noise = 0.02;

physics::Model motor(const std::string& more = "") {
  return test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: volt}\n"
      "states: {w: {derivative: 'k*u - a*w', initial: {value: 0, unit: rad/s, sigma: 0}}}\n"
      "outputs: {speed: {column: speed, expression: w}}\n"
      "parameters: {k: {value: 12, unit: 1, sigma: 4}, a: {value: 3, unit: 1/s, sigma: 2}}\n"
      "noise: {speed: 0.02}\n" +
      more);
}

/// w' = gain u - 3 w, by small steps.
recording::Table run_of_motor(double gain, unsigned seed, std::size_t rows = 1200) {
  std::mt19937 random{seed};
  std::normal_distribution<double> unit;
  std::uniform_real_distribution<double> level{-1.0, 1.0};
  std::vector<double> time, volt, speed;
  double u = 0.0, w = 0.0;
  for (std::size_t i = 0; i < rows; ++i) {
    if (i % 80 == 0) u = level(random);
    time.push_back(step * static_cast<double>(i));
    volt.push_back(u);
    speed.push_back(w + noise * unit(random));
    for (int part = 0; part < 50; ++part) w += step / 50 * (gain * u - 3.0 * w);
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("volt", "V", volt);
  table.add("speed", "rad/s", speed);
  return table;
}

Diagnosis fitted(const Case& data, const physics::Model& best) {
  Diagnosis d;
  d.weighing = weigh(data, simulate(data, data.model), Colour::white);
  d.retuned = fit(data, d.weighing, data.model, data.model, Effort::follow(10));
  d.weighing = weigh(data, simulate(data, d.retuned.model), Colour::white);
  d.retuned = fit(data, d.weighing, d.retuned.model, data.model, Effort::follow(5));
  d.best = best.terms.size() > data.model.terms.size()
               ? fit(data, d.weighing, best, data.model, Effort::follow(8))
               : d.retuned;
  for (std::size_t t = data.model.terms.size(); t < d.best.model.terms.size(); ++t)
    d.findings.emplace_back().term = d.best.model.terms[t];
  return d;
}

/// The motor's model with one more term at its state.
physics::Model with(physics::Model model, const char* name, double value) {
  physics::Term term;
  term.info = physics::find_term(physics::Plant::equations, name);
  term.on = term.with = "w";
  term.values[0] = value;
  term.given.fill(true);
  model.terms.push_back(term);
  return model;
}

TEST(HandedOver, WorseIsMoreThanChanceAndTheNoiseAllow) {
  EXPECT_FALSE(is_worse(1.09, 1.0, 0.0));
  EXPECT_TRUE(is_worse(1.2, 1.0, 0.1));
  EXPECT_FALSE(is_worse(0.4, 0.1, 1.0));
  EXPECT_TRUE(is_worse(std::nan(""), 1.0, 1.0));
  const auto row = [](double than, double one) { return FitRow{"y", "m", 0.0, than, one, 0.01}; };
  EXPECT_TRUE(is_worse({row(1.0, 1.2), row(1.0, 0.95)}, &FitRow::after, &FitRow::retuned));
  EXPECT_FALSE(is_worse({row(1.0, 1.2), row(1.0, 0.5)}, &FitRow::after, &FitRow::retuned));
  EXPECT_TRUE(is_worse({row(1.0, 2.0), row(1.0, 0.01)}, &FitRow::after, &FitRow::retuned));
}

TEST(HandedOver, NumbersThatLeadAwayOnRowsThatNoFitSawAreNotTaken) {
  // What is fitted to goes another way than what it is told of.
  const auto misled = make_case(motor(), {run_of_motor(6.0, 1)}),
             recorded = make_case(motor(), {run_of_motor(12.0, 1)});
  auto d = fitted(misled, misled.model);
  ASSERT_NEAR(d.retuned.model.value("k"), 6.0, 0.3);
  hold_out(misled, recorded, d);
  EXPECT_DOUBLE_EQ(d.retuned.model.value("k"), 12.0);
  EXPECT_DOUBLE_EQ(d.best.model.value("k"), 12.0);
  ASSERT_EQ(d.heldout.size(), 1U);
  EXPECT_DOUBLE_EQ(d.heldout[0].retuned, d.heldout[0].before);
  EXPECT_LT(d.heldout[0].after, 1.2 * noise);
  // Where the two agree they are.
  auto right = fitted(recorded, recorded.model);
  hold_out(recorded, recorded, right);
  EXPECT_NE(right.retuned.model.value("k"), 12.0);
}

TEST(HandedOver, ATermOfNothingIsNotClaimed) {
  const auto data = make_case(motor(), {run_of_motor(12.0, 2)});
  auto d = fitted(data, with(data.model, "constant", 0.1));
  d.best.model.terms.back().values[0] = 0.0;
  d.best = fit(data, d.weighing, d.best.model, data.model, Effort::evaluate());
  EXPECT_TRUE(leave_out_nothings(data, d));
  EXPECT_TRUE(d.findings.empty());
  EXPECT_TRUE(d.best.model.terms.empty());
  ASSERT_EQ(d.rejected.size(), 1U);
  EXPECT_EQ(d.rejected[0].term, "constant");
}

TEST(HandedOver, ATermThatExplainsSomethingStays) {
  auto table = run_of_motor(12.0, 3);
  for (auto& column : table.columns)
    if (column.name == "speed")
      for (double& v : column.values) v += 0.5;
  const auto data = make_case(motor(), {table});
  auto d = fitted(data, with(data.model, "constant", 0.1));
  EXPECT_FALSE(leave_out_nothings(data, d));
  EXPECT_EQ(d.findings.size(), 1U);
}

/// A diagnosis whose finding is a curve over `over`, as fitted to one run.
Diagnosis with_curve(const Case& data, const std::string& over, std::vector<double> knots, double value) {
  auto d = fitted(data, data.model);
  hold_out(data, data, d);
  physics::Term term;
  term.info = physics::unmodelled(physics::Plant::equations, "state");
  term.on = "w";
  term.curve.over = over;
  term.curve.values.assign(knots.size(), value);
  term.curve.knots = std::move(knots);
  d.best.model.terms.push_back(term);
  d.findings.emplace_back().term = term;
  d.findings.back().sigmas.clear();
  d.verdict = Verdict::unknown_physics;
  d.is_unnamed = true;
  return d;
}

OtherRun other(const recording::Table& table, const physics::Model& model) {
  const testing::TemporaryFolder folder;
  table.write(folder / "other.csv");
  return read_other_run(model, {folder / "other.csv", "", false});
}

TEST(OtherRecording, ACurveOverTimeOrPastItsKnotsIsLeftOutThereAndOfTheModelThatIsWorseWithIt) {
  const auto data = make_case(motor(), {run_of_motor(12.0, 4)});
  for (const std::string over : {"t", "u", "volt"}) {
    // Far past what the other run does, but for the last one, which goes as far.
    const bool is_known = over == "volt";
    auto d = with_curve(data, is_known ? "u" : over,
                        is_known ? std::vector{-2.0, 0.0, 2.0} : std::vector{-9.0, -8.0, -7.0}, 3.0);
    auto run = other(run_of_motor(12.0, 5), data.model);
    compare(data, d, run);
    d.other_runs.push_back(run);
    ASSERT_EQ(run.fit.size(), 1U);
    EXPECT_EQ(run.left_out.empty(), is_known) << over;
    EXPECT_EQ(run.is_worse, is_known) << over;
    EXPECT_EQ(of_one_recording(d).size(), is_known ? 0U : 1U) << over;
    EXPECT_EQ(best_without(data, d, of_one_recording(d)).terms.size(), is_known ? 1U : 0U);
    const auto report = nlohmann::json::parse(report_json(data, d));
    EXPECT_EQ(report.at("worse_on").size(), is_known ? 1U : 0U);
    if (is_known) {
      EXPECT_EQ(report.at("worse_on")[0], "other.csv");
      EXPECT_THAT(summary(data, d), HasSubstr("Worse on other.csv, do not take it over: speed "));
      EXPECT_THAT(page_text(data, d, ""), HasSubstr("<div class=\"callout bad\">Worse on other.csv"));
    } else {
      EXPECT_THAT(summary(data, d), HasSubstr("left out in other.csv: the curve over " + over));
      EXPECT_THAT(summary(data, d), Not(HasSubstr("Worse on")));
    }
  }
}

/// A door that was open in one recording: the numbers fitted beside it stay, those of a fit to these rows without it are astray.
TEST(OtherRecording, WithoutWhatHappenedOnceTheNumbersStayThoseFittedBesideIt) {
  const auto data = make_case(motor(), {run_of_motor(12.0, 4)});
  auto d = with_curve(data, "t", {0.0, 6.0, 12.0}, 3.0);
  for (auto& p : d.retuned.model.parameters)
    if (p.name == "k") p.value = 20.0;
  for (auto& p : d.best.model.parameters)
    if (p.name == "k") p.value = 12.1;
  const auto model = best_without(data, d, {0});
  EXPECT_TRUE(model.terms.empty());
  EXPECT_DOUBLE_EQ(model.value("k"), 12.1);
}

TEST(Doubt, APlaceWithoutANameIsAsSureAsWhatItsCurveTakesAway) {
  Diagnosis d;
  auto& finding = d.findings.emplace_back();
  finding.term.info = physics::unmodelled(physics::Plant::equations, "state");
  finding.term.curve.knots = {0.0, 1.0}, finding.term.curve.values = {0.0, 1.0};
  const auto sure = [&](double after) {
    finding.probability = 0.9;
    d.heldout = {{"speed", "rad/s", 1.2, 1.0, after, 0.02}};
    doubt_places(d);
    return finding.probability;
  };
  EXPECT_NEAR(sure(0.95), thresholds::place_alone, 0.05);
  EXPECT_LT(sure(0.8), 0.6);
  EXPECT_GT(sure(0.1), 0.85);
  EXPECT_DOUBLE_EQ(sure(0.025), 0.9);  // nothing to speak of is left
}

TEST(Doubt, ASearchThatEndedEarlyBesideALargeRestDoesNotOfferThatNothingIsMissing) {
  const auto data = make_case(motor(), {run_of_motor(12.0, 4)});
  for (const double rest : {0.021, 1.3}) {
    auto d = fitted(data, data.model);
    d.heldout = d.train = {{"speed", "rad/s", rest, rest, rest, noise}};
    d.unexplained = rest / noise;
    auto begun = d;
    say_not_tried(begun, {own_numbers});
    EXPECT_EQ(begun.verdict, Verdict::ambiguous);
    say_not_tried(d, {"pairs"});
    EXPECT_EQ(d.verdict, rest > 1.0 ? Verdict::unknown_physics : Verdict::ambiguous);
    const auto report = nlohmann::json::parse(report_json(data, d));
    EXPECT_EQ(report.at("ambiguity").empty(), rest > 1.0);
    EXPECT_THAT(summary(data, d), HasSubstr(rest > 1.0 ? "something is missing" : "nothing can be said"));
  }
}

TEST(Doubt, ANoiseStatedFarAboveAllThatIsLeftIsTold) {
  auto data = make_case(motor(), {run_of_motor(12.0, 4)});
  auto d = fitted(data, data.model);
  d.heldout = d.train = {{"speed", "rad/s", 0.02, 0.02, 0.02, 20.0}};
  for (const double stated : {0.02, 20.0}) {
    data.given_noise[0] = stated;
    const auto text = summary(data, d);
    if (stated > 1.0)
      EXPECT_THAT(text, HasSubstr("the noise of `speed` is stated as 20 rad/s, yet no more than"));
    else
      EXPECT_THAT(text, Not(HasSubstr("is stated as")));
  }
}

/// A motor with two volts too many in the recording of the fit, and none in the other.
TEST(OtherRecording, WhereOnlyTheRetunedModelIsWorseTheLineSaysSo) {
  const auto data = make_case(motor(), {run_of_motor(12.0, 4)});
  auto d = with_curve(data, "u", {-2.0, 0.0, 2.0}, 0.0);
  d.verdict = Verdict::explained;
  for (auto& p : d.retuned.model.parameters)
    if (p.name == "k") p.value *= 1.5;
  check_on(data, d, other(run_of_motor(12.0, 5), data.model));
  EXPECT_TRUE(d.other_runs.front().is_worse);
  EXPECT_FALSE(d.other_runs.front().is_worse_patched);
  EXPECT_THAT(summary(data, d), HasSubstr("Worse on other.csv where it is only retuned"));
}

/// An output that errs by more than twice the noise on rows that no fit saw is not explained.
TEST(OtherRecording, WhatErrsFarAboveTheNoiseThereIsNotExplained) {
  const auto data = make_case(motor(), {run_of_motor(12.0, 4)});
  for (const double push : {0.0, 3.0}) {
    auto d = with_curve(data, "u", {-2.0, 0.0, 2.0}, push);
    d.verdict = Verdict::explained;
    check_on(data, d, other(run_of_motor(12.0, 5), data.model));
    EXPECT_EQ(d.verdict, push > 0.0 ? Verdict::partly_explained : Verdict::explained);
  }
}

TEST(OtherRecording, AModelThatIntegratesIsComparedOverWindowsAsIsTheModelGiven) {
  const auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: volt}\n"
      "states: {x: {derivative: v, initial: {value: 0, unit: m, sigma: 0.1}},\n"
      "         v: {derivative: 'a*u', initial: {value: 0, unit: m/s, sigma: 0.1}}}\n"
      "outputs: {way: {column: way, expression: x}}\n"
      "parameters: {a: {value: 7, unit: 1, sigma: 1}}\nnoise: {way: 0.001}\n");
  const auto ball = [](unsigned seed, double push) {
    std::mt19937 random{seed};
    std::normal_distribution<double> unit;
    std::uniform_real_distribution<double> level{-1.0, 1.0};
    std::vector<double> time, volt, way;
    double u = 0.0, x = 0.0, v = 0.0;
    for (std::size_t i = 0; i < 1000; ++i) {
      if (i % 40 == 0) u = level(random) - 0.5 * x - 0.5 * v;
      time.push_back(step * static_cast<double>(i));
      volt.push_back(u);
      way.push_back(x + 0.001 * unit(random));
      for (int part = 0; part < 20; ++part) x += step / 20 * v, v += step / 20 * (7.0 * u + push);
    }
    recording::Table table;
    table.add("t", "s", time);
    table.add("volt", "1", volt);
    table.add("way", "m", way);
    return table;
  };
  auto data = make_case(model, {ball(6, 0.0)});
  cut_into_windows(data);
  ASSERT_GT(data.windows.count, 0U);
  auto d = fitted(data, data.model);
  hold_out(data, data, d);
  // A small steady push carries one free run of 10 s by half a metre; a window of its own hardly feels it.
  auto run = other(ball(7, 0.01), model);
  compare(data, d, run);
  EXPECT_THAT(run.how_windowed, HasSubstr("windows of"));
  ASSERT_EQ(run.fit.size(), 1U);
  EXPECT_LT(run.fit[0].before, 0.01);
  EXPECT_LT(run.fit[0].retuned, 0.01);
  EXPECT_FALSE(run.is_worse);
}

TEST(Page, DrawsNoRunThatWentAwayAndSaysSo) {
  // The user's motor runs away by itself; a term holds it.
  auto unstable = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: volt}\n"
      "states: {w: {derivative: 'k*u + a*w', initial: {value: 0, unit: rad/s, sigma: 0}}}\n"
      "outputs: {speed: {column: speed, expression: w}}\n"
      "parameters: {k: {value: 12, unit: 1, sigma: 0}, a: {value: 12, unit: 1/s, sigma: 0}}\nnoise: {speed: "
      "0.02}\n");
  const auto data = make_case(unstable, {run_of_motor(12.0, 8)});
  Diagnosis d;
  d.best.model = with(data.model, "linear", -15.0);
  if (std::abs(simulate(data, d.best.model)[0][0].back()) > 1e3)
    d.best.model = with(data.model, "linear", 15.0);
  d.weighing = weigh(data, simulate(data, d.best.model), Colour::white);
  d.retuned = fit(data, d.weighing, data.model, data.model, Effort::evaluate());
  d.best = fit(data, d.weighing, d.best.model, data.model, Effort::evaluate());
  auto& finding = d.findings.emplace_back();
  finding.term = d.best.model.terms[0];
  finding.sigmas.assign(finding.term.info->parameter_count(), 0.1);
  finding.share = 1.0;
  d.heldout = d.train = {{"speed", "rad/s", 1e60, 1e60, 0.02, 0.02}};
  d.verdict = Verdict::explained;
  const auto page = page_text(data, d, "");
  EXPECT_THAT(page, HasSubstr("Without it alone the model runs away"));
  EXPECT_THAT(page, HasSubstr("runs away"));
  EXPECT_FALSE(std::regex_search(page, std::regex{"[0-9]e\\+?[2-9][0-9]"}))
      << "a number that no machine reaches";
  EXPECT_THAT(summary(data, d), HasSubstr("runs away"));
}

TEST(Page, ATermThatFitsBestIsSaidByItsNameAndIsNoTable) {
  const auto data = make_case(motor(), {run_of_motor(12.0, 9)});
  auto d = fitted(data, with(data.model, "quadratic", 0.1));
  d.heldout = d.train = {{"speed", "rad/s", 1.0, 0.9, 0.8, 0.02}};
  d.unexplained = 40.0;
  d.verdict = Verdict::unknown_physics;
  auto& finding = d.findings[0];
  finding.stand_in = finding.term.info;
  finding.term.info = physics::unmodelled(physics::Plant::equations, finding.stand_in->site);
  for (const auto& text : {summary(data, d), page_text(data, d, ""), report_json(data, d)}) {
    EXPECT_THAT(text, HasSubstr("quadratic fits best, but leaves 40 times the noise"));
    EXPECT_THAT(text, Not(HasSubstr("as a table")));
  }
}

}  // namespace
}  // namespace invar::diagnosis

// What a fit that does well must show of its term before the term's name is said.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "core/diagnosis/candidates/equation_candidates.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/segments/steps.hpp"
#include "core/physics/library.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

/// A vessel x' = u - 0.2 x and behind it a second one that takes 0.1 of the difference a second and fills with this time
/// constant [s]. Exact for steps this small.
Case vessel(double time_constant) {
  std::mt19937 random{3};
  std::normal_distribution<double> noise{0.0, 0.002};
  std::vector<double> time, input, output;
  double x = 5.0, z = 5.0, u = 1.0;
  for (int i = 0; i < 600; ++i) {
    if (i % 60 == 0) u = i % 120 == 0 ? 1.5 : 0.6;
    time.push_back(0.5 * i), input.push_back(u), output.push_back(x + noise(random));
    for (int part = 0; part < 500; ++part) {
      const double into = 0.1 * (z - x);
      x += 1e-3 * (u - 0.2 * x + into);
      z += 1e-3 * (x - z) / time_constant;
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("u", "", input);
  table.add("x", "", output);
  return make_case(test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
                                  "states: {x: {derivative: 'u - k*x', initial: {value: 5, sigma: 0.01}}}\n"
                                  "outputs: {x: {column: x, expression: x}}\n"
                                  "parameters: {k: {value: 0.2, sigma: 0.01}}\n"),
                   {table});
}

Fit with_store(const Case& data, double time_constant) {
  auto model = data.model;
  physics::Term store;
  store.info = physics::find_term(physics::Plant::equations, "hidden_state");
  store.on = std::string{"x"};
  store.values = {0.09, time_constant};
  store.given = {true, true};
  model.terms.push_back(store);
  const auto plain = weigh(data, simulate(data, model), Colour::white);
  return fit(data, plain, model, data.model, Effort::follow(30));
}

TEST(Stands, AStoreThatNeverFillsIsNone) {
  const auto data = vessel(1e6);  // the recording lasts 300 s: 0.5 a second, less 0.1 x
  const auto found = with_store(data, 1e6);
  EXPECT_NEAR(found.model.terms[0].values[0], 0.1, 0.01);
  EXPECT_FALSE(stands(data, found, 0));
}

TEST(Stands, AStoreThatFillsIsOne) {
  const auto data = vessel(40.0);
  const auto found = with_store(data, 100.0);
  EXPECT_NEAR(found.model.terms[0].values[1], 40.0, 2.0);
  EXPECT_TRUE(stands(data, found, 0));
}

/// A wave of 4 s that pushes a vessel which slowly fills, over so many rows of 0.1 s, and a fit of it.
std::pair<Case, Fit> under_a_wave(int rows) {
  constexpr double period = 4.0, w = 2.0 * std::numbers::pi / period;
  std::mt19937 random{9};
  std::normal_distribution<double> noise{0.0, 0.002};
  std::vector<double> time, input, output;
  double x = 0.0;
  for (int i = 0; i <= rows; ++i) {
    time.push_back(0.1 * i), input.push_back(0.02 * i), output.push_back(x + noise(random));
    for (int part = 0; part < 100; ++part)
      x += 1e-3 * (0.02 * i - 0.5 * x + 0.3 * std::sin(w * (0.1 * i + 1e-3 * part)));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("u", "", input);
  table.add("x", "", output);
  auto data =
      make_case(test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
                               "states: {x: {derivative: 'u - k*x', initial: {value: 0, sigma: 0.01}}}\n"
                               "outputs: {x: {column: x, expression: x}}\n"
                               "parameters: {k: {value: 0.5, sigma: 0.01}}\n"),
                {table});
  auto model = data.model;
  physics::Term wave;
  wave.info = physics::find_term(physics::Plant::equations, "periodic");
  wave.on = std::string{"x"};
  wave.with = std::string{"t"};
  wave.values = {0.25, period, 0.1};
  wave.given = {true, true, true};
  model.terms.push_back(wave);
  auto found =
      fit(data, weigh(data, simulate(data, model), Colour::white), model, data.model, Effort::follow(20));
  return {std::move(data), std::move(found)};
}

/// Ten turns and a half: in so little of one as the half any course is a part of it.
TEST(Stands, WhatAMachineDoesInAPartOfAWaveIsNotThatWave) {
  const auto [data, found] = under_a_wave(420);
  EXPECT_NEAR(found.model.terms[0].values[0], 0.3, 0.01);
  EXPECT_TRUE(stands(data, found, 0));
}

TEST(Stands, WhatRepeatsInTimeWasSeenTwice) {
  const auto [seen, twice] = under_a_wave(88);
  EXPECT_TRUE(stands(seen, twice, 0));
  const auto [hardly, once] = under_a_wave(66);
  EXPECT_FALSE(stands(hardly, once, 0));
}

TEST(Stands, NothingIsTriedAtAnInputThatTheModelDoesNotLookAt) {
  recording::Table table;
  std::vector<double> time, u, air, x;
  for (int i = 0; i < 100; ++i)
    time.push_back(i), u.push_back(i % 7), air.push_back(20.0 + i % 5), x.push_back(0.1 * i);
  table.add("t", "s", time);
  table.add("u", "", u);
  table.add("air", "", air);
  table.add("x", "", x);
  const auto data = make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u, u2: air}\n"
                     "states: {x: {derivative: 'u - 0.1*x', initial: {value: 5, sigma: 0.01}}}\n"
                     "outputs: {x: {column: x, expression: x}}\nparameters: {}\n"),
      {table});
  bool at_used = false, to_unused = false;
  for (const auto& start : equation_starts(data, data.model)) {
    EXPECT_NE(start.term.on, "u2") << start.term.info->name;
    at_used = at_used || start.term.on == "u";
    to_unused = to_unused || start.term.with == "u2";  // what it may do beside is another matter
  }
  EXPECT_TRUE(at_used);
  EXPECT_TRUE(to_unused);
}

/// x' = 3 (u - x), u held: off the exponential by so much at most.
double off_the_closed_form(const Case& data, const std::vector<double>& u) {
  const auto x = simulate(data, data.model)[0][0];
  const auto& time = data.recordings[0].inputs.time;
  double exact = 0.0, most = 0.0;
  for (std::size_t i = 1; i < time.size(); ++i) {
    exact = u[i - 1] + (exact - u[i - 1]) * std::exp(-3.0 * (time[i] - time[i - 1]));
    most = std::max(most, std::abs(x[i] - exact));
  }
  return most;
}

TEST(Steps, AreAsFineAsTheNoiseAsks) {
  for (const double sigma : {1e-4, 1e-2}) {
    std::mt19937 random{5};
    std::normal_distribution<double> noise{0.0, sigma};
    std::vector<double> time, u, x;
    double at = 0.0;
    for (int i = 0; i < 400; ++i) {
      if (i > 0) at = u.back() + (at - u.back()) * std::exp(-3.0 * 0.16);
      time.push_back(0.16 * i), u.push_back(i % 9 < 4 ? 1.0 : -1.0), x.push_back(at + noise(random));
    }
    recording::Table table;
    table.add("t", "s", time);
    table.add("u", "", u);
    table.add("x", "", x);
    auto data =
        make_case(test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
                                 "states: {x: {derivative: '3*(u - x)', initial: {value: 0, sigma: 0}}}\n"
                                 "outputs: {x: {column: x, expression: x}}\nparameters: {}\n"),
                  {table});
    const double before = off_the_closed_form(data, u);
    const bool finer = step_finely(data, data.model, {sigma});
    EXPECT_EQ(finer, sigma < 1e-3);
    if (finer) {
      EXPECT_GT(before, 2.0 * sigma);
      EXPECT_LT(off_the_closed_form(data, u), 0.3 * sigma);
    } else {
      EXPECT_EQ(off_the_closed_form(data, u), before);  // finer steps would cost, and show nothing
    }
  }
}

}  // namespace
}  // namespace invar::diagnosis

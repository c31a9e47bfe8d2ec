// Blocked cross-validation against a motor written out here, under noise that wanders as slowly as the motor moves.
#include "core/diagnosis/evidence/foretold.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/physics/library.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

/// w' = 12 u - 3 w - drag w |w| in small steps of Euler's rule; the reading wanders with a memory of 100 rows.
Case motor(double drag, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> level{-6.0, 6.0};
  std::vector<double> time, volt, speed;
  double u = 0.0, w = 0.0, wander = 0.0;
  for (int i = 0; i < 1600; ++i) {
    if (i % 40 == 0) u = level(random);
    wander = 0.99 * wander + 0.05 * normal(random);
    time.push_back(0.01 * i), volt.push_back(u), speed.push_back(w + wander + 0.02 * normal(random));
    for (int part = 0; part < 50; ++part) w += 2e-4 * (12.0 * u - 3.0 * w - drag * w * std::abs(w));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("volt", "V", volt);
  table.add("speed", "rad/s", speed);
  return make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: volt}\n"
                     "states: {w: {derivative: 'k*u - a*w', initial: {value: 0, unit: rad/s, sigma: 0}}}\n"
                     "outputs: {speed: {column: speed, expression: w}}\n"
                     "parameters: {k: {value: 12, unit: 1, sigma: 1}, a: {value: 3, unit: 1/s, sigma: 1}}\n"),
      {table});
}

Foretold quadratic_in(const Case& data) {
  const auto plain = weigh(data, simulate(data, data.model), Colour::white);
  const auto without = fit(data, plain, data.model, data.model, Effort::follow(10));
  auto model = without.model;
  auto& term = model.terms.emplace_back();
  term.info = physics::find_term(physics::Plant::equations, "quadratic");
  term.on = "w";
  term.values[0] = -0.01;
  term.given[0] = true;
  return foretold(data, fit(data, plain, model, data.model, Effort::follow(12)), without);
}

TEST(Foretold, DragIsPlainThoughTheReadingWanders) {
  const auto found = quadratic_in(motor(0.5, 41));
  EXPECT_EQ(found.quarters, 4U);
  EXPECT_GE(found.better, 3U);
  EXPECT_GT(found.share, 0.3);
  EXPECT_TRUE(found.is_plain());
}

TEST(Foretold, AWanderAloneForetellsNothing) {
  for (unsigned seed = 50; seed < 60; ++seed) {
    const auto found = quadratic_in(motor(0.0, seed));
    EXPECT_FALSE(found.is_plain()) << seed;
    EXPECT_LT(found.share, 0.2) << seed;
  }
}

}  // namespace
}  // namespace invar::diagnosis

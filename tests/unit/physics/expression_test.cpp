// Formulas against the compiler's own arithmetic, and several models stepped together against each by itself.
#include "core/physics/expression.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "core/base/fault.hpp"
#include "core/physics/library.hpp"
#include "core/physics/simulation.hpp"

namespace invar::physics {
namespace {

/// The value for x and y (which change) and a (which stays), in the second of four columns.
double value_of(const std::string& formula, double x, double y, double a) {
  Expressions formulas{{"x", "y"}, {"a"}};
  const auto slot = formulas.add(Expressions::rates, formula, "here");
  std::vector<double> slots(4 * formulas.slots());
  for (std::size_t s = 0; s < formulas.slots(); ++s)
    for (std::size_t l = 0; l < 4; ++l) slots[4 * s + l] = formulas.start()[s];
  for (std::size_t l = 0; l < 4; ++l) {
    const double off = l == 1 ? 0.0 : 0.3 * static_cast<double>(l + 1);
    slots[l] = x + off, slots[4 + l] = y - off, slots[8 + l] = a + off;
  }
  formulas.run<4>(Expressions::fixed, slots.data());
  formulas.run<4>(Expressions::rates, slots.data());
  return slots[4 * slot + 1];
}

TEST(Expressions, AreWhatTheCompilerMakesOfThem) {
  const double x = 1.7, y = -0.4, a = 2.5;
  EXPECT_DOUBLE_EQ(value_of("x + y*a - x/a", x, y, a), x + y * a - x / a);
  EXPECT_DOUBLE_EQ(value_of("-x^2", x, y, a), -x * x);
  EXPECT_DOUBLE_EQ(value_of("2^3^2", x, y, a), 512.0);
  EXPECT_DOUBLE_EQ(value_of("x^-1 - -y", x, y, a), 1.0 / x + y);
  EXPECT_DOUBLE_EQ(value_of("a^1.5*x^3", x, y, a), std::pow(a, 1.5) * x * x * x);
  EXPECT_DOUBLE_EQ(value_of("10 - 4 - 3", x, y, a), 3.0);
  EXPECT_DOUBLE_EQ(value_of("12 / 4 / 3", x, y, a), 1.0);
  EXPECT_DOUBLE_EQ(value_of("sin(x)*cos(y) + tan(x*y)", x, y, a),
                   std::sin(x) * std::cos(y) + std::tan(x * y));
  EXPECT_DOUBLE_EQ(value_of("exp(-1e4/(300 + x))*1.5e10", x, y, a), std::exp(-1e4 / (300 + x)) * 1.5e10);
  EXPECT_DOUBLE_EQ(value_of("log(x) + sqrt(a) + abs(y) + tanh(y)", x, y, a),
                   std::log(x) + std::sqrt(a) + std::abs(y) + std::tanh(y));
  EXPECT_DOUBLE_EQ(value_of("sqrt(y) + sign(y) + sign(0*x)", x, y, a), -1.0);
  EXPECT_DOUBLE_EQ(value_of("min(x, y, a) + max(x, a)", x, y, a), y + a);
  EXPECT_DOUBLE_EQ(value_of("if(x > y && a <= 2.5, 3, 4)", x, y, a), 3.0);
  EXPECT_DOUBLE_EQ(value_of(" ( x +\t.5 ) * pi ", x, y, a), (x + 0.5) * std::numbers::pi);
}

TEST(Expressions, SayWhatIsWrong) {
  const auto fault_of = [](const std::string& formula) {
    try {
      Expressions formulas{{"x"}, {}};
      (void)formulas.add(Expressions::rates, formula, "states.x");
    } catch (const InputError& error) {
      return std::string{error.what()};
    }
    return std::string{"none"};
  };
  EXPECT_THAT(fault_of("2*z"),
              ::testing::AllOf(::testing::HasSubstr("states.x"), ::testing::HasSubstr("\"z\"")));
  for (const char* wrong :
       {"", "2*", "(x", "x)", "x y", "si(x)", "sin x", "1..2", "x = 3", "min(x,", "x ? 2 : 3", "x, 2", "$"})
    EXPECT_THAT(fault_of(wrong), ::testing::HasSubstr("states.x")) << wrong;
  EXPECT_THAT(fault_of(std::string(5000, '(')), ::testing::HasSubstr("states.x"));
}

TEST(RunAll, IsEachModelByItself) {
  Model model;
  model.plant = Plant::equations;
  model.equations.states = {{"x", "v"}, {"v", "k*u - d*v - c*sin(x)"}};
  model.equations.inputs = {{"u", "u"}};
  model.equations.outputs = {{"way", "x", {}}};
  model.signals = {{"u", "u", "", false}, {"way", "way", "", true}};
  for (const auto& [name, value] :
       {std::pair{"x.initial", 0.3}, {"v.initial", 0.0}, {"k", 4.0}, {"d", 0.5}, {"c", 9.0}})
    model.parameters.push_back({name, "", value, std::nullopt, {}});
  Record inputs;
  for (int i = 0; i < 300; ++i) {
    inputs.time.push_back(0.05 * i);
    inputs.signals["u"].push_back(i / 40 % 2 == 0 ? 1.0 : -0.7);
  }
  const auto simulation = prepare(model, inputs);
  for (const char* added : {"", "hidden_state", "delay", "dry_friction", "upper_limit"}) {
    std::vector<Model> models;
    for (int k = 0; k < 11; ++k) {
      models.push_back(model);
      models.back().parameters[3].value = 0.5 + 0.01 * k;
      if (*added == '\0') continue;
      Term term;
      term.info = find_term(Plant::equations, added);
      term.on = "v";
      term.values = {0.2 + 0.01 * k, 1.0};
      models.back().terms.push_back(term);
    }
    std::vector<const Model*> all;
    for (const auto& one : models) all.push_back(&one);
    std::vector<Outputs> together;
    simulation->run_all(all, together);
    ASSERT_EQ(together.size(), models.size());
    for (std::size_t k = 0; k < models.size(); ++k) {
      Outputs alone;
      simulation->run(models[k], alone);
      for (std::size_t i = 0; i < alone[0].size(); ++i)  // steps may be shorter together
        ASSERT_NEAR(together[k][0][i], alone[0][i], 2e-5) << added << ' ' << k << ' ' << i;
    }
  }
}

/// The sign of a speed that is zero jumps: it is no fast rate that asks for sixty steps a row.
TEST(SimulateEquations, FrictionThatAUserWroteBrakesAsTheClosedFormSays) {
  Model model;
  model.plant = Plant::equations;
  model.equations.states = {{"x", "v"}, {"v", "-f*sign(v)"}};
  model.equations.outputs = {{"way", "x", {}}};
  model.signals = {{"way", "way", "", true}};
  for (const auto& [name, value] : {std::pair{"x.initial", 0.0}, {"v.initial", 3.0}, {"f", 1.5}})
    model.parameters.push_back({name, "", value, std::nullopt, {}});
  Record inputs;
  for (int i = 0; i < 400; ++i) inputs.time.push_back(0.01 * i);
  Outputs out;
  prepare(model, inputs)->run(model, out);
  for (std::size_t i = 0; i < 200; ++i) {
    const double t = 0.01 * static_cast<double>(i);
    EXPECT_NEAR(out[0][i], 3.0 * t - 0.75 * t * t, 1e-9) << t;
  }
  EXPECT_NEAR(out[0].back(), 3.0, 0.02);
}

}  // namespace
}  // namespace invar::physics

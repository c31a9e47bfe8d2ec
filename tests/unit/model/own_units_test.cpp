// Units of models in the user's own expressions: a column is taken as his numbers are written.
#include <gmock/gmock.h>

#include <numbers>

#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "tests/support/model_of.hpp"

namespace invar::model {
namespace {

physics::Model read_own(const std::string& state_unit, const std::string& parameter_unit) {
  const auto yaml = config::Yaml::parse(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: in}\n"
      "states: {x: {derivative: 'k*u - x', initial: {value: 438, unit: " +
          state_unit +
          ", sigma: 2}}}\n"
          "outputs: {y: {column: out, expression: x}}\n"
          "parameters: {k: {value: 3, unit: " +
          parameter_unit + "}}\n",
      "model.yaml");
  auto model = read(yaml);
  yaml.finish();
  return model;
}

double first(const std::string& column_unit, const physics::Model& model) {
  recording::Table table;
  table.add("t", "min", {0.0, 1.0});
  table.add("in", "V", {1.0, 1.0});
  table.add("out", column_unit, {40.0, 41.0});
  const auto file = to_record(table, model, true);
  EXPECT_EQ(file.record.time[1], 60.0);  // time is in seconds, always
  return file.record.signals.at("y").front();
}

TEST(OwnUnits, AnAbsoluteTemperatureStaysAbsolute) {
  EXPECT_EQ(first("K", read_own("K", "K/V")), 40.0);
  EXPECT_EQ(first("K", read_own("\"1\"", "\"1\"")), 40.0);
  EXPECT_EQ(first("degC", read_own("degC", "\"1\"")), 40.0);
}

TEST(OwnUnits, ATemperatureCountsFromTheZeroOfTheStates) {
  EXPECT_DOUBLE_EQ(first("K", read_own("degC", "\"1\"")), 40.0 - 273.15);
  EXPECT_DOUBLE_EQ(first("degC", read_own("K", "\"1\"")), 40.0 + 273.15);
  EXPECT_DOUBLE_EQ(first("degF", read_own("K", "\"1\"")), (40.0 - 32.0) / 1.8 + 273.15);
}

TEST(OwnUnits, AColumnStandsInTheUnitOfTheModelsNumbersOrElseInSi) {
  EXPECT_EQ(first("cm", read_own("cm", "\"1\"")), 40.0);
  EXPECT_EQ(first("cm", read_own("\"1\"", "cm/V")), 40.0);
  EXPECT_EQ(first("cm", read_own("cm", "cm3/V")), 40.0);
  EXPECT_DOUBLE_EQ(first("cm", read_own("m", "m/V")), 0.4);
  EXPECT_EQ(first("mm", read_own("mm", "\"1\"")), 40.0);
}

TEST(OwnUnits, AColumnInPartsOfWhichTheModelsNumbersAreStandsAsTheyDo) {
  const auto input = [](const std::string& column_unit, const std::string& state_unit) {
    recording::Table table;
    table.add("t", "s", {0.0, 1.0});
    table.add("in", column_unit, {5.0, 5.0});
    table.add("out", "", {40.0, 41.0});
    return to_record(table, read_own(state_unit, "\"1\""), true).record.signals.at("u").front();
  };
  EXPECT_EQ(input("mg/s", "mg/l"), 5.0);  // a dose beside a concentration: both in mg
  EXPECT_EQ(input("mm/s", "1/mm"), 5.0);
  EXPECT_DOUBLE_EQ(input("mg/s", "kg/l"), 5e-6);
  EXPECT_DOUBLE_EQ(input("mg/s", "V"), 5e-6);
  EXPECT_DOUBLE_EQ(input("mm/min", "1/mm"), 5e-3 / 60.0);  // of one part nothing says how he counts
}

TEST(OwnUnits, ANameOfTheUsersOwnIsALabel) {
  EXPECT_EQ(first("counts", read_own("counts", "counts/V")), 40.0);
  EXPECT_EQ(read_own("counts", "counts/V").find("k")->unit, "counts/V");
}

std::string refusal(const std::string& column_unit, const std::string& state_unit) {
  try {
    (void)first(column_unit, read_own(state_unit, "\"1\""));
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

TEST(OwnUnits, AColumnOfAnotherQuantityThanItsStateIsRefused) {
  using ::testing::HasSubstr;
  EXPECT_THAT(refusal("K", "cm"), HasSubstr("column `out`: is in `K`, the model's `x` in `cm`"));
  EXPECT_THAT(refusal("furlong", "cm"), HasSubstr("column `out`: is in `furlong`, the model's `x` in `cm`"));
  EXPECT_THAT(refusal("V", "m/s"), HasSubstr("is in `V`"));
  // What says nothing, says the same, or is a name of the user's own stands.
  for (const auto& [column, state] : {std::pair{"cm", "cm"},
                                      {"mm", "m"},
                                      {"furlong", "furlong"},
                                      {"furlong", "\"1\""},
                                      {"V", "volts"},
                                      {"1", "V"},
                                      {"", "V"},
                                      {"deg", "rad"},
                                      {"K", "degC"}})
    EXPECT_EQ(refusal(column, state), "none") << column << " for " << state;
}

TEST(OwnUnits, TurnsAMinuteAreRadiansASecondWhereTheModelSpeaksOfAngles) {
  constexpr double per_rpm = 2.0 * std::numbers::pi / 60.0;
  EXPECT_DOUBLE_EQ(first("rpm", read_own("rad/s", "\"1\"")), 40.0 * per_rpm);
  EXPECT_DOUBLE_EQ(first("rpm", read_own("deg/s", "\"1\"")), 40.0 * 6.0);
  EXPECT_DOUBLE_EQ(first("rpm", read_own("\"1\"", "rad/(V s)")), 40.0 * per_rpm);
  EXPECT_DOUBLE_EQ(first("rpm", read_own("Hz", "rad")), 40.0 / 60.0);
  EXPECT_DOUBLE_EQ(first("rpm", read_own("\"1\"", "\"1\"")), 40.0 / 60.0);
  EXPECT_DOUBLE_EQ(first("rpm", read_own("rpm", "rad")), 40.0);
}

TEST(OwnUnits, WhatIsSimulatedSaysTheUnitOfTheStateThatItIs) {
  recording::Table table;
  table.add("t", "s", {0.0, 1.0});
  table.add("in", "V", {1.0, 1.0});
  const auto header = [&](const std::string& unit) {
    const auto model = read_own(unit, "\"1\"");
    return to_table(model, to_record(table, model, false), {{438.0, 438.0}}).columns.back().unit;
  };
  EXPECT_EQ(header("rad/s"), "rad/s");
  EXPECT_EQ(header("furlong"), "");  // a name of the user's own
  EXPECT_EQ(header("\"1\""), "");
  table.add("out", "deg/s", {40.0, std::nan("")});
  EXPECT_EQ(header("rad/s"), "deg/s");  // as the inputs have it
}

std::string fault_of_model(const std::string& text) {
  try {
    (void)test::model_of(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

std::string fault_of(const std::string& derivative, const std::string& parameters,
                     const std::string& rest = "") {
  return fault_of_model(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: in}\n"
      "states: {x: {derivative: '" +
      derivative +
      "', initial: {value: 1, unit: V}}}\noutputs: {y: {column: out, expression: x}}\nparameters: {" +
      parameters + "}\n" + rest);
}

std::string fault_of_mass(const std::string& place, const std::string& speed) {
  return fault_of_model(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: in}\nstates:\n"
      "  x: {derivative: v, initial: {value: 1, unit: " +
      place + "}}\n  v: {derivative: u - x, initial: {value: 1, unit: " + speed +
      "}}\noutputs: {y: {column: out, expression: x}}\n");
}

TEST(OwnUnits, AStateAndTheStateThatIsItsRateAreInOneUnit) {
  EXPECT_THAT(fault_of_mass("mm", "m/s"),
              ::testing::StartsWith(
                  "model.yaml:6: states.x.derivative: `states.x.derivative: v`: `v` [m/s] counts in "
                  "1000 of the unit of a rate of `x` [mm] in a second; give all in SI"));
  for (const auto& [place, speed] : {std::pair{"mm", "mm/s"},
                                     {"m", "m/s"},
                                     {"rad", "1/s"},
                                     {"rad", "rad/s"},
                                     {"counts", "m/s"},
                                     {"\"1\"", "m/s"},
                                     {"mm", "\"1\""}})
    EXPECT_EQ(fault_of_mass(place, speed), "none") << place << ", " << speed;
}

TEST(OwnUnits, NumbersOfAFormulaThatCountInUnitsOfTwoSizesAreRefused) {
  using ::testing::HasSubstr;
  const auto pendulum = [](const std::string& weight, const std::string& friction) {
    return fault_of_model(
        "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {M: torque}\nstates:\n"
        "  q: {derivative: w, initial: {value: 0.3, unit: rad}}\n"
        "  w: {derivative: '(M - g*sin(q) - b*w)/J', initial: {value: 0, unit: rad/s}}\n"
        "outputs: {y: {column: angle, expression: q}}\nparameters:\n"
        "  J: {value: 0.02, unit: kg m2}\n  g: {value: 980, unit: " +
        weight + "}\n  b: {value: 0.01, unit: " + friction + "}\n");
  };
  EXPECT_EQ(pendulum("N m", "N m s"), "none");
  EXPECT_EQ(pendulum("N m", "N m s/rad"), "none");
  EXPECT_EQ(pendulum("\"1\"", "N m s"), "none");
  EXPECT_EQ(pendulum("N m", "V"),
            "none");  // said with the diagnosis: a label may be wrong, and the number right
  EXPECT_THAT(pendulum("mN m", "N m s"), HasSubstr("model.yaml:7: states.w.derivative: "));
  EXPECT_THAT(
      pendulum("mN m", "N m s"),
      HasSubstr("the combination of `g` [mN m], `q` [rad] counts in 0.001 of the unit of the combination of "
                "`b` [N m s], `w` [rad/s]"));
}

TEST(OwnUnits, AColumnAndTheNumbersBesideItCountInOneUnit) {
  using ::testing::HasSubstr;
  const auto tank = [](const std::string& level, const std::string& of_inflow) {
    return test::model_of(
        "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {q: {column: inflow" + of_inflow +
        "}}\nstates: {h: {derivative: 'q/A - k*sqrt(h)', initial: {value: 18, unit: " + level +
        "}}}\noutputs: {y: {column: level, expression: h}}\nparameters: {A: {value: 300, unit: cm2}, k: "
        "{value: 1}}\n");
  };
  recording::Table table;
  table.add("t", "s", {0.0, 1.0});
  table.add("inflow", "L/min", {5.0, 5.0});
  table.add("level", "cm", {18.0, 18.1});
  EXPECT_THAT([&] { (void)to_record(table, tank("cm", ""), true); },
              testing::ThrowsMessage<InputError>(
                  HasSubstr("`q` [L/min, taken in SI] counts in 1e+06 of the unit of")));
  EXPECT_THAT(to_record(table, tank("cm", ", unit: cm3/s"), true).doubts, testing::IsEmpty());
  table.columns.pop_back();
  const auto file = to_record(table, tank("K", ", unit: cm3/s"), false);
  ASSERT_EQ(file.doubts.size(), 1U);
  EXPECT_THAT(file.doubts.front(),
              HasSubstr("`A` [cm2], `q` [cm3/s] measures something else than a rate of `h` [K]"));
}

TEST(OwnExpressions, ANameStandsForOneThing) {
  using ::testing::HasSubstr;
  EXPECT_EQ(fault_of("k*(u - x) + max(0, x >= 2)", "k: {value: 1}"), "none");
  EXPECT_THAT(fault_of("u - x", "x: {value: 1}"), HasSubstr("`x` is a state already"));
  EXPECT_THAT(fault_of("u - x", "u: {value: 1}"), HasSubstr("`u` is an input already"));
  EXPECT_THAT(fault_of("u - x", "pi: {value: 1}"), HasSubstr("`pi` means something else"));
  EXPECT_THAT(fault_of("u - x", "sin: {value: 1}"), HasSubstr("`sin` means something else"));
  EXPECT_THAT(fault_of("u - x", "a-b: {value: 1}"), HasSubstr("`a-b` is no name"));
}

TEST(OwnExpressions, AFormulaThatCannotBeReadIsSaidAtItsLineWithWhatThereIs) {
  using ::testing::AllOf;
  using ::testing::HasSubstr;
  using ::testing::StartsWith;
  EXPECT_THAT(fault_of("(u - x", ""),
              AllOf(StartsWith("model.yaml:5: states.x.derivative: "), HasSubstr("arenthesis")));
  EXPECT_THAT(fault_of("u - sqrt(xx)", ""),
              AllOf(StartsWith("model.yaml:5: states.x.derivative: "), HasSubstr("\"xx\"")));
  EXPECT_THAT(
      fault_of("cosinus(x)", ""),
      HasSubstr("sin cos tan asin acos atan sinh cosh tanh exp log ln log2 log10 sqrt abs sign min max"));
  EXPECT_THAT(fault_of("u - x", "", "controller: {output: u, expression: 2*y}\n"),
              StartsWith("model.yaml:8: controller.expression: "));
  // A name that is none is said, and not once more at each formula.
  EXPECT_THAT(fault_of("u - x", "a-b: {value: 1}"), Not(HasSubstr("derivative")));
}

TEST(OwnExpressions, AnExpressionGivesOneValueAndALoopDoesNotFollowItself) {
  using ::testing::HasSubstr;
  EXPECT_THAT(fault_of("x = 5", ""), HasSubstr("`=` has no place"));
  EXPECT_THAT(fault_of("u, x", ""), HasSubstr("`,` has no place"));
  EXPECT_THAT(fault_of("u - x", "", "controller: {output: u, expression: 2*u}\n"),
              HasSubstr("follows from itself"));
  EXPECT_THAT(fault_of("u - x", "", "controller: {output: w, expression: 2*x}\n"),
              HasSubstr("no input of this model"));
  EXPECT_THAT(fault_of("u - x", "", "controller: {output: x, expression: 2*u}\n"),
              HasSubstr("`x` is a state already"));
  EXPECT_THAT(fault_of("u - x", "k: {value: 1}", "controller: {output: k, expression: 2*u}\n"),
              HasSubstr("`k` is a parameter already"));
  EXPECT_THAT(fault_of("y - x", "", "controller: {output: y, expression: 2*u}\n"),
              HasSubstr("`y` is an input already"));  // of an output that bears its name
  EXPECT_EQ(fault_of("w - x", "", "controller: {output: w, expression: 2*u - x}\n"), "none");
  EXPECT_EQ(fault_of("u - x", "", "controller: {output: u, expression: 2 - x}\n"), "none");
}

}  // namespace
}  // namespace invar::model

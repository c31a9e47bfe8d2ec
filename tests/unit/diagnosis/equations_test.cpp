// The diagnosis on models that a user wrote down: other machines than any recording at hand, one effect hidden in each.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/model/model_file.hpp"
#include "core/physics/library.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::diagnosis {
namespace {

physics::Term term(const char* name, const char* on, std::initializer_list<double> values,
                   const char* with = "") {
  physics::Term t;
  t.info = physics::find_term(physics::Plant::equations, name);
  t.on = on;
  t.with = with;
  std::copy(values.begin(), values.end(), t.values.begin());
  t.given.fill(true);
  return t;
}

/// A machine, what drives it, and how well its output is read.
struct Machine {
  const char* yaml;
  double step, noise;
  std::size_t rows;
  double (*drive)(std::size_t row, std::mt19937& random);
};

/// Holds each random level for a while.
template <int hold, int low_percent, int high_percent>
double levels(std::size_t row, std::mt19937& random) {
  static double level = 0.0;
  if (row % hold == 0) level = 0.01 * std::uniform_int_distribution<int>{low_percent, high_percent}(random);
  return level;
}

constexpr Machine oscillator{
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
    "states:\n  x: {derivative: v, initial: {value: 0, unit: m, sigma: 0}}\n"
    "  v: {derivative: '4*u - d*v - k*x', initial: {value: 0, unit: m/s, sigma: 0}}\n"
    "outputs: {way: {column: y, expression: x}}\n"
    "parameters: {d: {value: 0.5, unit: 1/s}, k: {value: 9, unit: 1/s2}}\n",
    0.05, 0.004, 900, levels<23, -100, 100>};

constexpr Machine tanks{
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {q: drive}\n"
    "states:\n  a: {derivative: '0.9*q - r*sqrt(a)', initial: {value: 1, unit: m, sigma: 0.1}}\n"
    "  b: {derivative: 'r*sqrt(a) - s*sqrt(b)', initial: {value: 1, unit: m, sigma: 0.1}}\n"
    "outputs: {lower: {column: y, expression: b}}\n"
    "parameters: {r: {value: 0.6, unit: 1}, s: {value: 0.55, unit: 1}}\n",
    0.5, 0.01, 900, levels<31, 60, 150>};

constexpr Machine motor{
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
    "states: {w: {derivative: '20*u - b*w', initial: {value: 0, unit: rad/s, sigma: 0}}}\n"
    "outputs: {speed: {column: y, expression: w}}\n"
    "parameters: {b: {value: 1.5, unit: 1/s, sigma: 0.3}}\n",
    0.02, 0.05, 900, levels<29, -100, 100>};

constexpr Machine turntable{
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
    "states:\n  th: {derivative: w, initial: {value: 0, unit: rad, sigma: 0.01}}\n"
    "  w: {derivative: '20*u - b*w', initial: {value: 0, unit: rad/s, sigma: 0.01}}\n"
    "outputs: {angle: {column: y, expression: th}}\n"
    "parameters: {b: {value: 1.5, unit: 1/s, sigma: 0.2}}\n",
    0.02, 1e-4, 2000, levels<57, -10, 16>};

constexpr Machine valve{
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
    "states: {x: {derivative: '(u - x)/tau', initial: {value: 0.5, unit: 1, sigma: 0.05}}}\n"
    "outputs: {opening: {column: y, expression: x}}\n"
    "parameters: {tau: {value: 3, unit: s, sigma: 0.2}}\n",
    0.5, 0.005, 600, levels<29, 20, 90>};

constexpr Machine spring{
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
    "states:\n  x: {derivative: v, initial: {value: 0, unit: m, sigma: 0}}\n"
    "  v: {derivative: '(12*u - k*x - c*v)/m', initial: {value: 0, unit: m/s, sigma: 0}}\n"
    "outputs: {way: {column: y, expression: x}}\n"
    "parameters:\n  m: {value: 1.6, unit: kg, sigma: 0.03}\n  k: {value: 240, unit: N/m, sigma: 7}\n"
    "  c: {value: 3.2, unit: N s/m, sigma: 0.26}\nnoise: {way: 0.002}\n",
    0.005, 0.002, 1000, levels<61, -100, 100>};

constexpr Machine spool{
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
    "states:\n  x: {derivative: '(u - x)/tau', initial: {value: 0, unit: 1, sigma: 0}}\n"
    "  v: {derivative: '40*x - b*v', initial: {value: 0, unit: m/s, sigma: 0}}\n"
    "outputs: {speed: {column: y, expression: v}}\n"
    "parameters: {tau: {value: 0.1, unit: s, sigma: 0.01}, b: {value: 1.5, unit: 1/s, sigma: 0.2}}\n",
    0.02, 0.03, 1500, levels<17, -100, 100>};

class Equations : public ::testing::Test {
 protected:
  /// `rate`: of the last state, where the machine obeys another law than any term.
  Diagnosis diagnose(const Machine& machine, const std::vector<physics::Term>& hidden, unsigned seed,
                     const char* rate = nullptr) {
    const auto model = test::model_of(machine.yaml);
    auto truth = model;
    truth.terms = hidden;
    if (rate != nullptr) truth.equations.states.back().derivative = rate;
    std::mt19937 random{seed};
    physics::Record inputs;
    auto& drive = inputs.signals[model.equations.inputs.front().signal];
    for (std::size_t i = 0; i < machine.rows; ++i) {
      inputs.time.push_back(machine.step * static_cast<double>(i));
      drive.push_back(machine.drive(i, random));
    }
    physics::Outputs out;
    physics::prepare(truth, inputs)->run(truth, out);
    std::normal_distribution<double> noise{0.0, machine.noise};
    for (double& y : out[0]) y += noise(random);
    recording::Table table;
    table.add("t", "s", inputs.time);
    table.add("drive", "", drive);
    table.add("y", "", out[0]);
    table.write(folder / "recording.csv");
    data = load_case(model, {folder / "recording.csv"});
    std::cout << "seed " << seed << '\n';
    return diagnosis::diagnose(data, [](double, const std::string&) {});
  }

  static void expect(const Diagnosis& d, const char* name, const char* on, double value, double tolerance) {
    ASSERT_EQ(d.findings.size(), 1U);
    EXPECT_EQ(d.findings[0].term.info->name, name);
    EXPECT_EQ(d.findings[0].term.on, on);
    EXPECT_NEAR(d.findings[0].term.values[0], value, tolerance);
    EXPECT_LT(d.heldout[0].after, 0.7 * d.heldout[0].retuned);
  }

  invar::testing::TemporaryFolder folder;
  Case data;
};

TEST_F(Equations, NamesASpringThatHardens) {
  expect(diagnose(oscillator, {term("cubic", "v", {-30.0}, "x")}, 1), "cubic", "v", -30.0, 3.0);
}

TEST_F(Equations, NamesDryFriction) {
  expect(diagnose(motor, {term("dry_friction", "w", {4.0})}, 3), "dry_friction", "w", 4.0, 0.3);
}

/// The spool goes where it is told, and what flows has a gap.
TEST_F(Equations, NamesTheGapThroughWhichOthersFeelAState) {
  const auto d = diagnose(spool, {term("dead_zone", "x", {0.1}, "others")}, 8);
  expect(d, "dead_zone", "x", 0.1, 0.01);
  EXPECT_EQ(d.findings[0].term.with, "others");
}

TEST_F(Equations, NamesFrictionOfWhatNeverTurnsItsSign) {
  const auto d = diagnose(valve, {term("dry_friction", "x", {0.006}, "x")}, 6);
  expect(d, "dry_friction", "x", 0.006, 0.001);
  EXPECT_EQ(d.findings[0].term.with, "x");
}

TEST_F(Equations, NamesTeethOfWhichManyPass) {
  const auto d = diagnose(turntable, {term("periodic", "w", {0.15, 0.2618, 0.7}, "th")}, 5);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "periodic");
  EXPECT_EQ(d.findings[0].term.with, "th");
  EXPECT_NEAR(d.findings[0].term.values[0], 0.15, 0.015);
  EXPECT_NEAR(d.findings[0].term.values[1], 0.2618, 2e-4);
  const auto report = nlohmann::json::parse(report_json(data, d));
  EXPECT_NEAR(report["findings"][0]["parameters"]["pitch"]["value"], 0.2618, 2e-4);
}

TEST_F(Equations, AWaveInTimeHasAFrequency) {
  const auto d = diagnose(motor, {term("periodic", "w", {3.0, 0.9, 0.7}, "t")}, 8);
  const auto report = nlohmann::json::parse(report_json(data, d));
  ASSERT_EQ(report["findings"].size(), 1U);
  EXPECT_NEAR(report["findings"][0]["parameters"]["frequency"]["value"], 1.0 / 0.9, 0.005);
  EXPECT_EQ(report["findings"][0]["parameters"]["frequency"]["unit"], "Hz");
}

TEST_F(Equations, NamesALateInput) {
  expect(diagnose(motor, {term("delay", "u", {0.07})}, 4), "delay", "u", 0.07, 0.01);
}

/// Before or behind a model in one piece: no motion tells where, but that it is there is explained.
TEST_F(Equations, AStoreWhosePlaceInTheChainIsOpenIsExplained) {
  auto from_rest = motor;  // else what the lag begins at tells where it is
  from_rest.drive = [](std::size_t row, std::mt19937& random) {
    return row < 29 ? 0.0 : levels<29, -100, 100>(row, random);
  };
  const auto d = diagnose(from_rest, {term("lag", "u", {0.08})}, 7);
  expect(d, "lag", d.findings.empty() ? "" : d.findings[0].term.on.c_str(), 0.08, 0.02);
  ASSERT_FALSE(d.findings[0].alternatives.empty());
  EXPECT_EQ(d.findings[0].alternatives[0].term.info->name, "lag");
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_THAT(summary(data, d), ::testing::HasSubstr("or the same at the"));
}

/// What an input is held to is felt at the state behind it too: the name is sure, the place alone is open.
TEST_F(Equations, ALimitOnTheWayToAStateIsExplainedWithBothPlaces) {
  constexpr Machine car{
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
      "states:\n  f: {derivative: '(3800*u - f)/0.6', initial: {value: 1100, unit: N, sigma: 0}}\n"
      "  v: {derivative: '(f - c*v - 0.53*v*abs(v))/1560', initial: {value: 24, unit: m/s, sigma: 0}}\n"
      "outputs: {speed: {column: y, expression: v}}\nparameters: {c: {value: 33, unit: N s/m, sigma: 3}}\n",
      0.2, 0.06, 1500, levels<61, 10, 65>};
  const auto d = diagnose(car, {term("upper_limit", "u", {0.57})}, 2);
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "upper_limit");
  EXPECT_EQ(d.verdict, Verdict::explained);
}

/// A steady rate and a limit at zero do the same; one name is enough.
TEST_F(Equations, FrictionOfAShaftThatGoesOneWayAndStandsIsFriction) {
  auto one_way = motor;
  one_way.drive = [](std::size_t row, std::mt19937& random) {
    const double level = levels<29, 20, 100>(row, random);
    return row / 58 % 3 == 0 ? 0.1 : level;  // less than what friction holds
  };
  const auto d = diagnose(one_way, {term("dry_friction", "w", {4.0})}, 3);
  expect(d, "dry_friction", "w", 4.0, 0.3);
}

/// Beyond its dead zone an input is off by a steady value, and nothing says that there is a zone.
TEST_F(Equations, ADeadZoneInWhichItsInputNeverWasIsAnOffset) {
  auto one_way = motor;
  one_way.drive = levels<29, 40, 100>;
  const auto d = diagnose(one_way, {term("dead_zone", "u", {0.2})}, 3);
  expect(d, "constant", "w", -4.0, 0.3);
  EXPECT_GT(d.findings[0].probability, 0.75);
}

/// A room and its walls, which nobody measures. The numbers of the room answer for what the walls get of the sun until none
/// is right, and from there the sun on the walls is not seen.
TEST_F(Equations, NamesWhatAnInputDoesToAMassThatNobodyMeasures) {
  const auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {I: sun, To: outdoor, Q: radiator}\n"
      "states:\n"
      "  Tr: {derivative: '(g*I + Q - Uv*(Tr - To) - Uw*(Tr - Tw))/Cr', initial: {value: 19, unit: degC, "
      "sigma: "
      "0.3}}\n"
      "  Tw: {derivative: '(Uw*(Tr - Tw) - Uo*(Tw - To))/Cw', initial: {value: 16, unit: degC, sigma: 1}}\n"
      "outputs: {room: {column: room, expression: Tr}}\n"
      "parameters:\n  Cr: {value: 1.04e6, unit: J/K, sigma: 5.2e4}\n"
      "  Cw: {value: 7.8e6, unit: J/K, sigma: 6e5}\n  Uw: {value: 130, unit: W/K, sigma: 10}\n"
      "  Uo: {value: 31, unit: W/K, sigma: 2.5}\n  Uv: {value: 13, unit: W/K, sigma: 1.3}\n"
      "  g: {value: 1, unit: m2, sigma: 0.08}\n");
  auto truth = model;
  truth.terms = {term("coupling", "Tw", {1.7e-7}, "I")};
  std::mt19937 random{6};
  std::uniform_real_distribution<double> share{0.0, 1.0};
  physics::Record inputs;
  double clouds = 0.5, power = 390.0;
  for (int i = 0; i < 2600; ++i) {
    const double day = 2.0 * std::numbers::pi * i / 288.0;
    if (i % 40 == 0) clouds = share(random);
    if (i % 70 == 0) power = 780.0 * share(random);
    inputs.time.push_back(300.0 * i);
    inputs.signals["I"].push_back(600.0 * clouds * std::max(0.0, -std::cos(day)));
    inputs.signals["To"].push_back(7.0 - 5.0 * std::cos(day - 0.7));
    inputs.signals["Q"].push_back(power);
  }
  physics::Outputs out;
  physics::prepare(truth, inputs)->run(truth, out);
  std::normal_distribution<double> noise{0.0, 0.03};
  for (double& y : out[0]) y += noise(random);
  recording::Table table;
  table.add("t", "s", inputs.time);
  table.add("sun", "", inputs.signals["I"]);
  table.add("outdoor", "", inputs.signals["To"]);
  table.add("radiator", "", inputs.signals["Q"]);
  table.add("room", "", out[0]);
  table.write(folder / "recording.csv");
  data = load_case(model, {folder / "recording.csv"});
  const auto d = diagnosis::diagnose(data, [](double, const std::string&) {});
  expect(d, "coupling", "Tw", 1.7e-7, 1e-8);
}

/// A damper in the middle of the way (x^2 v) is none of the table; what comes nearest leaves a third more than the noise.
TEST_F(Equations, NoNameStandsThatLeavesFarMoreThanTheNoise) {
  for (const unsigned seed : {1U, 2U}) {
    const auto d = diagnose(spring, {}, seed, "(12*u - k*x - c*v)/m - 900*x*x*v");
    EXPECT_EQ(d.verdict, Verdict::unknown_physics);
    for (const auto& finding : d.findings) EXPECT_EQ(finding.term.info->name, "unmodelled") << seed;
  }
}

TEST_F(Equations, ClaimsNothingWhereNothingIsHidden) {
  for (const Machine* machine : {&oscillator, &tanks, &motor})
    EXPECT_TRUE(diagnose(*machine, {}, 11).findings.empty()) << machine->yaml;
}

/// Mass under dry friction alone, pushed once: it stops after v^2 / (2 level) and stays.
TEST(SimulateEquations, DryFrictionStopsAMassWhereTheClosedFormSays) {
  auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\n"
      "states:\n  x: {derivative: v, initial: {value: 0, unit: m}}\n  v: {derivative: '0*x', initial: "
      "{value: 3, unit: m/s}}\n"
      "outputs: {way: {column: x, expression: x}}\n");
  model.terms = {term("dry_friction", "v", {1.7})};
  for (const double step : {0.01, 0.31}) {
    physics::Record inputs;
    for (int i = 0; i * step < 4.0; ++i) inputs.time.push_back(i * step);
    physics::Outputs out;
    physics::prepare(model, inputs)->run(model, out);
    EXPECT_NEAR(out[0].back(), 3.0 * 3.0 / (2.0 * 1.7), 1e-9) << step;
  }
}

/// A valve that sticks follows x' = u - x - level sign(x'), and stays where u - x is no more than the level.
TEST(SimulateEquations, FrictionAgainstTheRateLeavesAValveShortOfWhereItShouldBe) {
  auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\n"
      "states:\n  x: {derivative: '5 - x', initial: {value: 2, unit: 1}}\n"
      "  y: {derivative: '5 - y', initial: {value: 4.8, unit: 1}}\n"
      "outputs: {x: {column: x, expression: x}, y: {column: y, expression: y}}\n");
  model.terms = {term("dry_friction", "x", {0.5}, "x"), term("dry_friction", "y", {0.5}, "y")};
  physics::Record inputs;
  for (int i = 0; i <= 100; ++i) inputs.time.push_back(0.02 * i);
  physics::Outputs out;
  physics::prepare(model, inputs)->run(model, out);
  for (std::size_t i = 0; i < out[0].size(); ++i) {
    EXPECT_NEAR(out[0][i], 4.5 - 2.5 * std::exp(-inputs.time[i]), 1e-7);
    EXPECT_DOUBLE_EQ(out[1][i], 4.8);
  }
}

/// Rows of the first output of x' = -2 x from 1, with one term.
std::vector<double> falling(const physics::Term& added, double step, std::size_t rows) {
  auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\nstates:\n"
      "  x: {derivative: '-2*x', initial: {value: 1, unit: m}}\noutputs: {way: {column: x, expression: "
      "x}}\n");
  model.terms = {added};
  physics::Record inputs;
  for (std::size_t i = 0; i < rows; ++i) inputs.time.push_back(step * static_cast<double>(i));
  physics::Outputs out;
  physics::prepare(model, inputs)->run(model, out);
  return out[0];
}

TEST(SimulateEquations, AStateIsFeltLateBehindALagAndBehindADeadZoneAsClosedFormsSay) {
  constexpr double k = 2.0, step = 0.01;
  const double delay = 0.2;
  const auto late = falling(term("delay", "x", {delay}), step, 41);
  for (std::size_t i = 0; i < late.size(); ++i) {
    const double t = step * static_cast<double>(i), second = std::max(0.0, t - delay);
    EXPECT_NEAR(late[i], 1.0 - k * t + 0.5 * k * k * second * second, 2e-4) << t;
  }
  const double tau = 0.25;  // x'' + x' / tau + k x / tau = 0 with x = 1, x' = -k: it swings
  const auto lagged = falling(term("lag", "x", {tau}), step, 200);
  const double a = 0.5 / tau, w = std::sqrt(k / tau - a * a);
  for (std::size_t i = 0; i < lagged.size(); ++i) {
    const double t = step * static_cast<double>(i);
    EXPECT_NEAR(lagged[i], std::exp(-a * t) * (std::cos(w * t) + (a - k) / w * std::sin(w * t)), 1e-6) << t;
  }
  const double width = 0.3;
  const auto dead = falling(term("dead_zone", "x", {width}), step, 200);
  for (std::size_t i = 0; i < dead.size(); ++i)
    EXPECT_NEAR(dead[i], width + (1.0 - width) * std::exp(-k * step * static_cast<double>(i)), 1e-6);
  const auto nearly = falling(term("lag", "x", {1e-9}), step, 100),
             none = falling(term("delay", "x", {0.0}), step, 100);
  for (std::size_t i = 0; i < nearly.size(); ++i) {
    EXPECT_NEAR(nearly[i], std::exp(-k * step * static_cast<double>(i)), 1e-6);
    EXPECT_NEAR(none[i], nearly[i], 1e-6);
  }
}

TEST(SimulateEquations, AStoreOnTheWayOfAnInputAndWhatRunsOverFromOneToAnother) {
  auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: pump, w: drain}\nstates:\n"
      "  x: {derivative: '-x', initial: {value: 0, unit: m, sigma: 0}}\n"
      "outputs: {one: {column: a, expression: u}, other: {column: b, expression: w}}\n");
  physics::Record inputs;
  for (int i = 0; i < 50; ++i) {
    inputs.time.push_back(0.1 * i);
    inputs.signals["u"].push_back(i < 10 ? 0.0 : 2.0);
    inputs.signals["w"].push_back(0.5);
  }
  physics::Outputs out;
  model.terms = {term("hidden_state", "u", {0.4, 0.7})};
  physics::prepare(model, inputs)->run(model, out);
  for (std::size_t i = 10; i < 50; ++i)
    EXPECT_NEAR(out[0][i], 2.0 * (1.0 - 0.4 * std::exp(-0.1 * (static_cast<double>(i) - 10.0) / 0.7)), 1e-9);
  model.terms = {term("overflow", "u", {1.5, 0.25}, "w")};
  physics::prepare(model, inputs)->run(model, out);
  EXPECT_DOUBLE_EQ(out[0][5], 0.0);
  EXPECT_DOUBLE_EQ(out[0][20], 1.5);
  EXPECT_DOUBLE_EQ(out[1][5], 0.5);
  EXPECT_DOUBLE_EQ(out[1][20], 0.5 + 0.25 * 0.5);
}

/// A curve that goes straight through zero is a coefficient: x' = -2 x - 1.5 x.
TEST(SimulateEquations, ACurveOverAStateIsTheRateThatItDraws) {
  physics::Term curve;
  curve.info = physics::unmodelled(physics::Plant::equations, "state");
  curve.on = "x";
  curve.curve = {"x", {-1.0, 0.25, 2.0}, {1.5, -0.375, -3.0}};
  const auto out = falling(curve, 0.01, 200);
  for (std::size_t i = 0; i < out.size(); i += 20)
    EXPECT_NEAR(out[i], std::exp(-3.5 * 0.01 * static_cast<double>(i)), 1e-7) << i;
}

/// One that stays the same, in proportion to the state, is a coefficient too: x' = -2 x - 1.5 x; in proportion to the time
/// x' = -2 x + 3 t.
TEST(SimulateEquations, ACurveInProportionToAVariableIsItsCoefficient) {
  physics::Term curve;
  curve.info = physics::unmodelled(physics::Plant::equations, "state");
  curve.on = curve.with = "x";
  curve.curve = {"t", {0.0, 1.0, 2.0}, {-1.5, -1.5, -1.5}};
  const auto out = falling(curve, 0.01, 200);
  for (std::size_t i = 0; i < out.size(); i += 20)
    EXPECT_NEAR(out[i], std::exp(-3.5 * 0.01 * static_cast<double>(i)), 1e-7) << i;
  curve.with = "t";
  curve.curve.values.assign(3, 3.0);
  const auto pushed = falling(curve, 0.01, 200);
  for (std::size_t i = 0; i < out.size(); i += 20) {
    const double t = 0.01 * static_cast<double>(i);
    EXPECT_NEAR(pushed[i], 1.75 * std::exp(-2.0 * t) + 1.5 * t - 0.75, 1e-7) << i;
  }
}

/// A thousand times faster than its rows, and across a gap of days: at its balance, not run away.
TEST(SimulateEquations, WhatIsFarFasterThanTheRowsIsAtItsBalance) {
  const auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: in}\n"
      "states:\n  x: {derivative: '1000*(u - x)', initial: {value: 0, unit: V}}\n"
      "  z: {derivative: '0.3*(x - z)', initial: {value: 0, unit: V}}\n"
      "outputs: {fast: {column: a, expression: x}, slow: {column: b, expression: z}}\n");
  physics::Record inputs;
  for (int i = 0; i < 40; ++i) {
    inputs.time.push_back(i < 20 ? i : 3e5 + i);
    inputs.signals["u"].push_back(i % 5 == 0 ? 2.0 : -1.0);
  }
  physics::Outputs out;
  physics::prepare(model, inputs)->run(model, out);
  double z = 0.0;
  for (std::size_t i = 1; i < 40; ++i) {
    const double u = inputs.signals["u"][i - 1], h = inputs.time[i] - inputs.time[i - 1];
    z = u + (z - u) * std::exp(-0.3 * h);
    EXPECT_NEAR(out[0][i], u, 1e-6) << i;
    EXPECT_NEAR(out[1][i], z, 5e-3) << i;
  }
}

/// S' = F - V S / (K + S): full, it empties slowly, and near its balance it is three hundred times as fast.
TEST(SimulateEquations, WhatBecomesFastBetweenTwoLooksAtTheRatesIsFollowed) {
  const auto model = test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\n"
      "states:\n  S: {derivative: '0.1 - S/(0.05 + S)', initial: {value: 1, unit: g/l}}\n"
      "outputs: {left: {column: a, expression: S}}\n");
  physics::Record inputs;
  for (int i = 0; i < 1000; ++i) inputs.time.push_back(0.4 * i);
  physics::Outputs out;
  physics::prepare(model, inputs)->run(model, out);
  EXPECT_GT(out[0][1], 0.5);
  for (std::size_t i = 16; i < 1000; ++i) EXPECT_NEAR(out[0][i], 0.05 * 0.1 / 0.9, 1e-6) << i;
}

TEST(EquationsModel, SaysWhereATermCannotAct) {
  const std::string head =
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: pump}\nstates:\n"
      "  level: {derivative: 'u - level', initial: {value: 0, unit: m}}\n"
      "outputs: {one: {column: a, expression: level}}\n";
  const auto fault_of = [&](const std::string& terms) {
    try {
      const auto yaml = config::Yaml::parse(head + terms, "model.yaml");
      (void)model::read(yaml);
      yaml.finish();
    } catch (const InputError& error) {
      return std::string{error.what()};
    }
    return std::string{"none"};
  };
  EXPECT_THAT(
      fault_of("terms: [{term: delay, on: leve, delay: 1}]\n"),
      ::testing::AllOf(::testing::HasSubstr("no state, input or output"), ::testing::HasSubstr("`level`")));
  EXPECT_THAT(fault_of("terms: [{term: linear, on: u, coefficient: 1}]\n"), ::testing::HasSubstr("no state"));
  EXPECT_EQ(fault_of("terms: [{term: delay, on: level, delay: 1}]\n"), "none");
  EXPECT_THAT(fault_of("terms: [{term: unmodelled, on: level, over: w, knots: [0, 1], values: [0, 1]}]\n"),
              ::testing::HasSubstr("`w` is no state, no input and not t"));
  EXPECT_EQ(fault_of("terms: [{term: unmodelled, on: level, over: u, knots: [0, 1], values: [0, 1]}]\n"),
            "none");
  EXPECT_THAT(
      fault_of("terms: [{term: unmodelled, on: level, over: u, with: w, knots: [0, 1], values: [0, 1]}]\n"),
      ::testing::HasSubstr("with: `w` is no state, no input and not t"));
}

}  // namespace
}  // namespace invar::diagnosis

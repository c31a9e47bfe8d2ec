// The experiment that a report proposes for two causes that a recording cannot tell apart does tell them apart: the recording
// is made with each of them and diagnosed.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <stdexcept>

#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/physics/library.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

physics::Model read(const std::string& text) { return test::model_of("invar_model: 1\n" + text); }

const std::string axis_numbers =
    "parameters: {mass: {value: 4, unit: kg, sigma: 0.06}, motor_constant: {value: 20, unit: N/A, sigma: "
    "0.2}, "
    "viscous_damping: {value: 15, unit: N s/m, sigma: 1.5}}\n"
    "noise: {position: 1.0e-8, current: 1.0e-4}\n";
const std::string loop =
    "plant: axis\ncolumns: {time: t, reference: r, position: y, current: u}\n"
    "controller: {kind: pid, rate: 1000, kp: 8.0e3, ki: 2.0e5, kd: 60, velocity_filter_hz: 300, limit: "
    "20}\n" +
    axis_numbers;
const std::string no_loop = "plant: axis\ncolumns: {time: t, position: y, current: u}\n" +
                            axis_numbers.substr(0, axis_numbers.find("noise")) +
                            "noise: {position: 1.0e-8}\n";

/// What a machine of this model does on these inputs, with noise on the outputs.
recording::Table record(const physics::Model& truth, const physics::Record& inputs,
                        const std::map<std::string, double>& noise, unsigned seed) {
  physics::Outputs outputs;
  physics::prepare(truth, inputs)->run(truth, outputs);
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  recording::Table table;
  table.add(truth.signal("time")->column, "s", inputs.time);
  std::size_t o = 0;
  for (const auto& signal : truth.signals) {
    if (signal.name == "time") continue;
    if (!signal.is_output) {
      table.add(signal.column, signal.unit, inputs.signals.at(signal.name));
      continue;
    }
    auto values = outputs[o++];
    for (double& v : values) v += noise.at(signal.name) * normal(random);
    table.add(signal.column, signal.unit, std::move(values));
  }
  return table;
}

struct Answer {
  Case data;
  Diagnosis d;
  [[nodiscard]] std::multiset<std::string> names() const {
    std::multiset<std::string> all;
    for (const auto& finding : d.findings) all.emplace(finding.term.info->name);
    return all;
  }
};

Answer diagnosis_of(const physics::Model& model, const recording::Table& table) {
  Answer answer{make_case(model, {table}), {}};
  answer.d = diagnose(answer.data, [](double, const std::string&) {});
  return answer;
}

physics::Term term(physics::Plant plant, const char* name, std::map<std::string, double> values) {
  physics::Term t;
  t.info = physics::find_term(plant, name);
  for (const auto& [parameter, value] : values) {
    const auto i = t.info->index_of(parameter);
    t.values[i] = value, t.given[i] = true;
  }
  return t;
}

physics::Model with(physics::Model model, const physics::Term& t) {
  model.terms.push_back(t);
  return model;
}

/// A smooth way to and fro at these peak speeds [m/s], one after the other.
physics::Record motion(const std::vector<double>& speeds, double way) {
  physics::Record inputs;
  double at = 0.02, begin = at;
  const auto rest = [&](int rows) {
    for (int i = 0; i < rows; ++i) inputs.signals["reference"].push_back(at);
  };
  rest(200);
  bool forth = true;
  for (const double speed : speeds) {
    const int rows =
        static_cast<int>(1000.0 * way * 1.875 / speed);  // 1.875: peak over mean of this polynomial
    const double to = begin + (forth ? way : -way);
    for (int i = 1; i <= rows; ++i) {
      const double s = static_cast<double>(i) / rows;
      at = begin + (to - begin) * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
      inputs.signals["reference"].push_back(at);
    }
    begin = at;
    rest(150);
    forth = !forth;
  }
  for (std::size_t i = 0; i < inputs.signals["reference"].size(); ++i)
    inputs.time.push_back(1e-3 * static_cast<double>(i));
  return inputs;
}

const std::map<std::string, double> axis_noise{{"position", 1e-8}, {"current", 1e-4}};

/// The two causes of the pair that the report calls ambiguous, as it fitted them; and what it proposes.
struct Twins {
  physics::Term one, other;
  std::string experiment;
};
Twins twins_of(const Answer& answer) {
  Twins twins;
  EXPECT_EQ(answer.d.verdict, Verdict::ambiguous) << summary(answer.data, answer.d);
  for (const auto& finding : answer.d.findings)
    for (const auto& a : finding.alternatives)
      if (a.explains_as_well() && twins.experiment.empty())
        twins = {finding.term, a.term, next_experiment(answer.data, answer.d)};
  if (twins.experiment.empty()) throw std::runtime_error{"there are no twins"};
  return twins;
}

TEST(Experiment, BothDirectionsTellFrictionFromAConstantForce) {
  const auto model = read(loop);
  for (const auto& truth : {term(physics::Plant::axis, "coulomb_friction", {{"level", 2.0}}),
                            term(physics::Plant::axis, "constant_force", {{"force", -2.0}})}) {
    const auto then =
        diagnosis_of(model, record(with(model, truth), motion({0.05, 0.1, 0.08, 0.1}, 0.03), axis_noise, 2));
    EXPECT_EQ(then.d.verdict, Verdict::explained) << summary(then.data, then.d);
    EXPECT_THAT(then.names(), UnorderedElementsAre(std::string{truth.info->name}));
  }
}

TEST(Experiment, ADirectInstrumentTellsALateMotorFromALateEncoder) {
  const auto model = read(loop);
  const auto late = term(physics::Plant::axis, "transport_delay", {{"delay", 6e-4}});
  const auto first =
      diagnosis_of(model, record(with(model, late), motion({0.1, 0.2, 0.15, 0.2}, 0.03), axis_noise, 1));
  const auto twins = twins_of(first);
  EXPECT_THAT(twins.experiment, HasSubstr("second, direct instrument"));
  // The loop goes on as it was; the direct instrument shows where the carriage is. `current` is recorded.
  const auto open = read(no_loop);
  for (const auto& truth : {twins.one, twins.other}) {
    const auto inputs = motion({0.2, 0.1, 0.2, 0.15}, 0.03);
    physics::Outputs of_loop;
    physics::prepare(with(model, truth), inputs)->run(with(model, truth), of_loop);
    physics::Record direct;
    direct.time = inputs.time;
    direct.signals["current"] = of_loop[1];
    const bool is_motor = truth.info->site == "actuator";
    const auto then = diagnosis_of(open, record(is_motor ? with(open, truth) : open, direct, axis_noise, 2));
    if (is_motor)
      EXPECT_THAT(then.names(), ::testing::Contains(::testing::AnyOf("transport_delay", "measurement_delay")))
          << summary(then.data, then.d);
    else
      EXPECT_EQ(then.d.verdict, Verdict::no_mismatch) << summary(then.data, then.d);
  }
}

TEST(Experiment, QuickMotionTellsADelayFromALag) {
  const auto model = read(loop);
  auto inputs = motion({0.1, 0.2}, 0.02);
  std::mt19937 random{5};
  std::normal_distribution<double> normal;
  for (std::size_t i = 300; i + 300 < inputs.rows(); ++i)
    inputs.signals["reference"][i] += 2e-6 * normal(random);  // up to half the rate of the rows
  for (const char* name : {"transport_delay", "amplifier_lag"}) {
    const auto* parameter = name == std::string{"amplifier_lag"} ? "time_constant" : "delay";
    const auto then = diagnosis_of(
        model,
        record(with(model, term(physics::Plant::axis, name, {{parameter, 4e-4}})), inputs, axis_noise, 3));
    ASSERT_FALSE(then.d.findings.empty());
    std::set<std::string> left{std::string{then.d.findings[0].term.info->name}};
    for (const auto& a : then.d.findings[0].alternatives)
      if (a.explains_as_well()) left.emplace(a.term.info->name);
    EXPECT_TRUE(left.contains(name)) << summary(then.data, then.d);
    EXPECT_FALSE(left.contains("amplifier_lag") && left.contains("transport_delay"));
  }
}

TEST(Experiment, HighAndLowCurrentTellTheRippleOfTheMotorFromThatOfTheForce) {
  const auto model = read(loop);
  const auto inputs = motion({0.1, 0.4, 0.15, 0.3}, 0.12);
  for (const auto& truth :
       {term(physics::Plant::axis, "force_ripple", {{"amplitude", 0.8}, {"pitch", 0.024}, {"phase", 0.4}}),
        term(physics::Plant::axis, "motor_constant_ripple",
             {{"amplitude", 0.05}, {"pitch", 0.024}, {"phase", 0.4}})}) {
    const auto then = diagnosis_of(model, record(with(model, truth), inputs, axis_noise, 4));
    EXPECT_EQ(then.d.verdict, Verdict::explained) << summary(then.data, then.d);
    EXPECT_THAT(then.names(), UnorderedElementsAre(std::string{truth.info->name}));
  }
}

TEST(Experiment, WithTheMotorOffAForceShakesTheCarriageStill) {
  const auto model = read(no_loop);
  physics::Record off;
  for (int i = 0; i < 4000; ++i) off.time.push_back(1e-3 * i), off.signals["current"].push_back(0.0);
  const auto force = term(physics::Plant::axis, "periodic_disturbance",
                          {{"amplitude", 0.5}, {"frequency", 17.0}, {"phase", 0.3}});
  const auto shaken = diagnosis_of(model, record(with(model, force), off, axis_noise, 5));
  EXPECT_FALSE(shaken.d.findings.empty()) << summary(shaken.data, shaken.d);
  const auto still =
      diagnosis_of(model, record(model, off, axis_noise, 5));  // what was added to the current is off too
  EXPECT_EQ(still.d.verdict, Verdict::no_mismatch) << summary(still.data, still.d);
}

TEST(Experiment, TwoHeightsTellCarryFromAValveThatOpensLate) {
  const auto model = read(
      "plant: droplet\ncolumns: {time: t, target_x: a, target_y: b, height: h, velocity_x: p, velocity_y: q, "
      "landed_x: x, landed_y: y}\n"
      "parameters: {placement_error_x: {value: 0, unit: m, sigma: 1.0e-5}, placement_error_y: {value: 0, "
      "unit: m, "
      "sigma: 1.0e-5}, slope_x: {value: 0, unit: 1, sigma: 1.0e-3}, slope_y: {value: 0, unit: 1, sigma: "
      "1.0e-3}, "
      "speed: {value: 2.5, unit: m/s, sigma: 0.1}}\nnoise: {landed_x: 2.0e-6, landed_y: 2.0e-6}\n");
  const auto prints = [&](const std::vector<double>& heights) {
    physics::Record inputs;
    std::mt19937 random{6};
    std::uniform_real_distribution<double> place{0.0, 0.1}, velocity{-0.1, 0.1};
    for (int i = 0; i < 240; ++i) {
      inputs.time.push_back(0.5 * i);
      for (const char* name : {"target_x", "target_y"}) inputs.signals[name].push_back(place(random));
      for (const char* name : {"velocity_x", "velocity_y"}) inputs.signals[name].push_back(velocity(random));
      inputs.signals["height"].push_back(heights[static_cast<std::size_t>(i) % heights.size()]);
    }
    return inputs;
  };
  const std::map<std::string, double> noise{{"landed_x", 2e-6}, {"landed_y", 2e-6}};
  const auto late = term(physics::Plant::droplet, "valve_delay", {{"delay", 2e-3}});
  const auto first = diagnosis_of(model, record(with(model, late), prints({0.005}), noise, 1));
  const auto twins = twins_of(first);
  EXPECT_THAT(twins.experiment, HasSubstr("two clearly different heights"));
  for (const auto& truth : {twins.one, twins.other}) {
    const auto then = diagnosis_of(model, record(with(model, truth), prints({0.002, 0.015}), noise, 2));
    EXPECT_EQ(then.d.verdict, Verdict::explained) << summary(then.data, then.d);
    EXPECT_THAT(then.names(), UnorderedElementsAre(std::string{truth.info->name}));
  }
}

TEST(Experiment, OneInputVariedAloneTellsItFromItsTwin) {
  Case data;
  data.model.plant = physics::Plant::equations;
  physics::Term one;
  one.info = physics::find_term(physics::Plant::equations, "coupling");
  one.on = "x", one.with = "u";
  auto other = one;
  other.with = "w";
  EXPECT_EQ(separating_experiment(data, one, other), "record with u varied on its own and all else held");
  EXPECT_NE(name_beside(data, one, other), name_beside(data, other, one));
}

TEST(Experiment, OfPairsWithoutOneOfTheirOwnSaysWhatToVary) {
  const auto model = read(loop);
  const auto data = make_case(model, {record(model, motion({0.1}, 0.02), axis_noise, 1)});
  const auto experiment = [&](const char* one, const char* other) {
    return separating_experiment(data, term(physics::Plant::axis, one, {}),
                                 term(physics::Plant::axis, other, {}));
  };
  EXPECT_EQ(experiment("force_ripple", "slow_drift"),
            "record with position varied on its own and all else held: force ripple goes with it, slow drift "
            "does not");
  EXPECT_EQ(experiment("constant_force", "slow_drift"),
            "record the same motion twice, the second time after a pause: slow "
            "drift goes with it, constant force does not");
  EXPECT_THAT(experiment("force_ripple", "position_stiffness"),
              HasSubstr("at a third and at three times of its size"));
}

}  // namespace
}  // namespace invar::diagnosis

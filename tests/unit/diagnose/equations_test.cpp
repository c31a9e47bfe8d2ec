// The diagnosis on models that a user wrote down: other machines than any recording at hand, one effect hidden in each.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "core/model/model_file.hpp"
#include "core/physics/library.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tools/diagnose/search.hpp"

namespace invar::diagnose {
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

class Equations : public ::testing::Test {
 protected:
  Diagnosis diagnose(const Machine& machine, const std::vector<physics::Term>& hidden, unsigned seed) {
    const auto yaml = config::Yaml::parse(machine.yaml, "model.yaml");
    const auto model = model::read(yaml);
    yaml.finish();
    auto truth = model;
    truth.terms = hidden;
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
    auto data = load_case(model, {folder / "recording.csv"});
    std::cout << "seed " << seed << '\n';
    return search(data, [](double, const std::string&) {});
  }

  static void expect(const Diagnosis& d, const char* name, const char* on, double value, double tolerance) {
    ASSERT_EQ(d.findings.size(), 1U);
    EXPECT_EQ(d.findings[0].term.info->name, name);
    EXPECT_EQ(d.findings[0].term.on, on);
    EXPECT_NEAR(d.findings[0].term.values[0], value, tolerance);
    EXPECT_LT(d.heldout[0].after, 0.7 * d.heldout[0].retuned);
  }

  invar::testing::TemporaryFolder folder;
};

TEST_F(Equations, NamesASpringThatHardens) {
  expect(diagnose(oscillator, {term("cubic", "v", {-30.0}, "x")}, 1), "cubic", "v", -30.0, 3.0);
}

TEST_F(Equations, NamesDryFriction) {
  expect(diagnose(motor, {term("dry_friction", "w", {4.0})}, 3), "dry_friction", "w", 4.0, 0.3);
}

TEST_F(Equations, NamesALateInput) {
  expect(diagnose(motor, {term("delay", "u", {0.07})}, 4), "delay", "u", 0.07, 0.01);
}

TEST_F(Equations, ClaimsNothingWhereNothingIsHidden) {
  for (const Machine* machine : {&oscillator, &tanks, &motor})
    EXPECT_TRUE(diagnose(*machine, {}, 11).findings.empty()) << machine->yaml;
}

/// Mass under dry friction alone, pushed once: it stops after v^2 / (2 level) and stays.
TEST(SimulateEquations, DryFrictionStopsAMassWhereTheClosedFormSays) {
  const auto yaml = config::Yaml::parse(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\n"
      "states:\n  x: {derivative: v, initial: {value: 0, unit: m}}\n  v: {derivative: '0*x', initial: "
      "{value: 3, unit: m/s}}\n"
      "outputs: {way: {column: x, expression: x}}\n",
      "model.yaml");
  auto model = model::read(yaml);
  model.terms = {term("dry_friction", "v", {1.7})};
  for (const double step : {0.01, 0.31}) {
    physics::Record inputs;
    for (int i = 0; i * step < 4.0; ++i) inputs.time.push_back(i * step);
    physics::Outputs out;
    physics::prepare(model, inputs)->run(model, out);
    EXPECT_NEAR(out[0].back(), 3.0 * 3.0 / (2.0 * 1.7), 1e-9) << step;
  }
}

}  // namespace
}  // namespace invar::diagnose

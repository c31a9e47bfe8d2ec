// What is a slip of the instrument, and what the machine did: rows whose truth is written out here.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/dataset/outliers.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

/// Rows of the first recording that are not used, of the first output.
std::set<std::size_t> dropped(const Case& data, std::size_t output = 0) {
  std::set<std::size_t> rows;
  const auto& measured = data.recordings[0].measured[output];
  for (std::size_t i = 0; i < measured.size(); ++i)
    if (!std::isfinite(measured[i])) rows.insert(i);
  return rows;
}

TEST(Outliers, AreNotTheEndsOfSweepsAfterWhichTheErrorBeginsAnew) {
  std::mt19937 random{31};
  std::normal_distribution<double> reading{0.0, 2e-7};
  std::vector<double> time, position, error;
  for (int k = 0; k < 220; ++k) {  // ten sweeps one way over a scale that has grown
    time.push_back(10.0 * k), position.push_back(0.1 * (k % 22));
    error.push_back(6e-6 * position.back() + reading(random));
  }
  error[50] += 2e-5;
  recording::Table table;
  table.add("t", "s", time);
  table.add("x", "m", position);
  table.add("e", "m", error);
  auto data = make_case(
      test::model_of("invar_model: 1\nplant: error_map\ncolumns: {time: t, position: x, error: e}\n"
                     "baseline: {positions: [0, 0.7, 1.4, 2.2], errors: [0, 0, 0, 0]}\n"
                     "parameters: {reference_temperature: {value: 20, unit: degC, sigma: 0.1}}\nterms: []\n"),
      {table});
  drop_outliers(data, simulate(data, data.model));
  EXPECT_EQ(dropped(data), std::set<std::size_t>{50});
}

/// A residual that rises for most of the recording and rests for the remainder: in the rise each value is the median of its
/// neighbours, which says nothing of the noise.
TEST(Outliers, AreNotTheNoiseOfRestsBesideALongRise) {
  std::mt19937 random{7};
  std::normal_distribution<double> reading{0.0, 0.02};
  std::vector<double> time, u, y;
  for (int i = 0; i < 900; ++i) {
    time.push_back(i), u.push_back(0.0);
    y.push_back(0.02 * std::clamp(i - 100, 0, 600) + reading(random));
  }
  y[820] += 0.5;
  recording::Table table;
  table.add("t", "s", time);
  table.add("u", "1", u);
  table.add("y", "m", y);
  auto data =
      make_case(test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
                               "states: {x: {derivative: 'k*u', initial: {value: 0, unit: m, sigma: 1}}}\n"
                               "outputs: {y: {column: y, expression: x}}\n"
                               "parameters: {k: {value: 1, unit: m/s, sigma: 0.1}}\nterms: []\n"),
                {table});
  drop_outliers(data, simulate(data, data.model));
  EXPECT_EQ(dropped(data), std::set<std::size_t>{820});
}

/// Drops from three heights, with a slip now and then; `landed` of height and velocity.
template <class Landed>
Case printed(Landed landed, const std::set<std::size_t>& slips, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> scatter{0.0, 5e-6};
  std::uniform_real_distribution<double> share{0.0, 1.0};
  std::vector<double> time, target, height, velocity, x, y;
  for (std::size_t k = 0; k < 600; ++k) {
    time.push_back(0.5 * static_cast<double>(k)), target.push_back(0.02 * share(random));
    height.push_back(0.002 * std::pow(2.0, static_cast<double>(k / 7 % 3)));
    velocity.push_back(share(random) < 0.08 ? 0.2 : 0.0);
    x.push_back(target.back() + landed(height.back(), velocity.back()) + scatter(random) +
                (slips.contains(k) ? (k % 2 == 0 ? -1e-4 : 1e-4) : 0.0));
    y.push_back(scatter(random));
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("tx", "m", target);
  table.add("ty", "m", std::vector<double>(time.size(), 0.0));
  table.add("h", "m", height);
  table.add("v", "m/s", velocity);
  table.add("w", "m/s", std::vector<double>(time.size(), 0.0));
  table.add("x", "m", x);
  table.add("y", "m", y);
  return make_case(
      test::model_of(
          "invar_model: 1\nplant: droplet\ncolumns: {time: t, target_x: tx, target_y: ty, height: h, "
          "velocity_x: v, velocity_y: w, landed_x: x, landed_y: y}\n"
          "parameters: {placement_error_x: {value: 0, unit: m, sigma: 1e-6}, placement_error_y: {value: 0, "
          "unit: m, sigma: 1e-6}, slope_x: {value: 0, sigma: 1e-3}, slope_y: {value: 0, sigma: 1e-3}, speed: "
          "{value: 2, unit: m/s, sigma: 0.1}, camera_scale: {value: 1e-5, unit: m/px, sigma: 1e-8}}\n"
          "terms: []\n"),
      {table});
}

const std::set<std::size_t> slips{42, 111, 238, 371, 502};

TEST(Outliers, AreSeenOnceTheNumbersThatHideThemAreRight) {
  auto data = printed([](double height, double) { return 0.02 * height; }, slips, 32);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::parameters_only);
  EXPECT_EQ(data.count.outliers, slips.size());
  EXPECT_EQ(dropped(data), slips);
}

/// A vessel whose pump gives twice what the model says; the numbers that are wrong are far louder than the slip in row 180.
TEST(Outliers, OfAModelThatRemembersAreSeenOnceItsNumbersAreNear) {
  std::mt19937 random{34};
  std::normal_distribution<double> reading{0.0, 0.01};
  std::vector<double> time, pump, level;
  double x = 0.0, u = 0.0;
  for (int k = 0; k < 400; ++k) {
    u = std::uniform_real_distribution<double>{0.0, 2.0}(random);
    time.push_back(0.2 * k), pump.push_back(u), level.push_back(x + reading(random));
    x = 2.0 * u / 1.5 + (x - 2.0 * u / 1.5) * std::exp(-1.5 * 0.2);
  }
  level[180] += 0.4;
  recording::Table table;
  table.add("t", "s", time);
  table.add("u", "", pump);
  table.add("y", "", level);
  auto data =
      make_case(test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
                               "states: {x: {derivative: 'b*u - k*x', initial: {value: 0, sigma: 0}}}\n"
                               "outputs: {y: {column: y, expression: x}}\n"
                               "parameters: {b: {value: 1, sigma: 0.2}, k: {value: 1.4, sigma: 0.2}}\n"),
                {table});
  auto far = data;
  drop_outliers(far, simulate(far, far.model));
  EXPECT_FALSE(dropped(far).contains(180));
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::parameters_only);
  EXPECT_EQ(dropped(data), std::set<std::size_t>{180});
}

/// A vessel that leaks, read by a converter: `read` makes counts of what is there.
template <class Read>
Case leaking(Read read, const std::set<std::size_t>& slipped, double slip) {
  recording::Table table;
  std::vector<double> time, pressure;
  for (std::size_t k = 0; k < 1400; ++k) {
    time.push_back(0.02 * static_cast<double>(k));
    pressure.push_back(read(7.5 * std::exp(-0.17 * time.back()), k) + (slipped.contains(k) ? slip : 0.0));
  }
  table.add("t", "s", time);
  table.add("p", "bar", pressure);
  return make_case(
      test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\n"
                     "states: {p: {derivative: '-k*p', initial: {value: 7.5, unit: bar, sigma: 0.05}}}\n"
                     "outputs: {pressure: {column: p, expression: p}}\n"
                     "parameters: {k: {value: 0.16, unit: 1/s, sigma: 0.05}}\n"),
      {table});
}

TEST(Outliers, AreNotStepsOfOneOrTwoCounts) {
  std::mt19937 random{35};
  std::uniform_int_distribution<int> flicker{-1, 1};
  const std::set<std::size_t> rare{200, 640, 1100};
  const auto even = [&](double count) {
    return [&, count](double value, std::size_t k) {
      return count * (std::round(value / count) + (k % 9 == 0 ? flicker(random) : 0));
    };
  };
  // The steps of a thermistor's converter grow along its range.
  const auto bent = [&](double value, std::size_t k) {
    return std::pow((std::round(std::sqrt(value) / 0.004) + (k % 9 == 0 ? flicker(random) : 0)) * 0.004, 2);
  };
  auto plain = leaking(even(0.001), {}, 0.0), slipped = leaking(even(0.001), rare, 0.02),
       coarse = leaking(even(0.05), rare, 0.6), curved = leaking(bent, rare, 0.4);
  for (auto* data : {&plain, &slipped, &coarse, &curved}) drop_outliers(*data, simulate(*data, data->model));
  EXPECT_THAT(dropped(plain), testing::IsEmpty());
  EXPECT_EQ(dropped(slipped), rare);
  EXPECT_EQ(dropped(coarse), rare);
  EXPECT_EQ(dropped(curved), rare);
}

TEST(Outliers, OfATwentiethOfAllRowsAreSaid) {
  auto data = leaking([](double value, std::size_t) { return value; }, {}, 0.0);
  Diagnosis d;
  d.best.model = data.model;
  data.count.outliers = 69;  // of 1400
  EXPECT_THAT(beside_the_verdict(data, d), testing::Not(testing::HasSubstr("outliers")));
  data.count.outliers = 70;
  EXPECT_THAT(beside_the_verdict(data, d),
              testing::HasSubstr("70 of 1400 readings are left out as outliers"));
}

TEST(Outliers, TheLastRowMayBeOfAnotherRun) {
  // A heated body in steps of its converter: most readings are the median of their neighbours.
  recording::Table table;
  std::vector<double> time, power, read;
  double temperature = 20.0;
  for (std::size_t k = 0; k < 600; ++k) {
    time.push_back(static_cast<double>(k));
    power.push_back(0.5);
    read.push_back(0.25 * std::round(temperature / 0.25));
    temperature += 0.5 / 12.0 - (temperature - 20.0) / 1200.0;
  }
  read.back() = 20.0;
  table.add("t", "s", time);
  table.add("heater", "", power);
  table.add("T", "degC", read);
  table.add("room", "degC", std::vector<double>(600, 20.0));
  auto data = make_case(
      test::model_of(
          "invar_model: 1\nplant: thermal\ncolumns: {time: t}\n"
          "nodes: {body: {column: T, capacity: {value: 12, unit: J/K}, loss: {value: 0.01, unit: W/K}}}\n"
          "heaters: {pad: {node: body, column: heater, gain: {value: 1, unit: W/W}}}\nambient: room\n"),
      {table});
  drop_outliers(data, simulate(data, data.model));
  EXPECT_EQ(dropped(data), std::set<std::size_t>{599});
}

TEST(Outliers, AreNotTheFewDropsOnWhichAnEffectActs) {
  auto data = printed([](double, double velocity) { return 4e-4 * velocity; }, slips, 33);
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "valve_delay");
  EXPECT_NEAR(d.findings[0].term.values[0], 4e-4, 2e-5);
  EXPECT_EQ(dropped(data), slips);
}

}  // namespace
}  // namespace invar::diagnosis

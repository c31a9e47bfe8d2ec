// Models that integrate or run away, against machines made here by formulas of their own: judged over windows.
#include "core/diagnosis/segments/windows.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

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

using test::model_of;

struct Recorded {
  std::vector<double> time, drive, way;
  [[nodiscard]] Case with(const physics::Model& model) const {
    recording::Table table;
    table.add("t", "s", time);
    table.add("drive", "", drive);
    table.add("y", "", way);
    return make_case(model, {table});
  }
};

/// A mass that is pushed; the air's drag and what is not even: a wind that nobody records.
Recorded pushed_mass(double drag, double wind, std::size_t rows) {
  std::mt19937 random{7};
  std::normal_distribution<double> normal;
  Recorded r;
  double x = 0.0, v = 0.0, u = 0.0, blows = 0.0;
  for (std::size_t i = 0; i < rows; ++i) {
    if (i % 25 == 0) u = std::uniform_real_distribution<double>{-1.0, 1.0}(random)-0.2 * v - 0.05 * x;
    blows += -0.02 * blows + wind * normal(random);
    r.time.push_back(0.05 * static_cast<double>(i));
    r.drive.push_back(u);
    r.way.push_back(x + 1e-3 * normal(random));
    for (int part = 0; part < 50; ++part) {  // Heun's rule
      const double h = 0.001, a = 3.0 * u + blows - drag * v * std::abs(v), w = v + h * a;
      const double b = 3.0 * u + blows - drag * w * std::abs(w);
      x += h * (v + 0.5 * h * a);
      v += 0.5 * h * (a + b);
    }
  }
  return r;
}

const char* const mass =
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
    "states:\n  x: {derivative: v, initial: {value: 0, unit: m, sigma: 0.01}}\n"
    "  v: {derivative: 'k*u', initial: {value: 0, unit: m/s, sigma: 0.01}}\n"
    "outputs: {way: {column: y, expression: x}}\n"
    "parameters: {k: {value: 3.1, unit: m/s2, sigma: 0.1}}\n";

TEST(Windows, ADriftOfWhatIntegratesIsNoOtherParameter) {
  auto data = pushed_mass(0.0, 0.01, 1500).with(model_of(mass));
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_GT(data.windows.count, 5U);
  EXPECT_TRUE(d.findings.empty()) << d.findings[0].term.info->name;
  // No farther off than what was believed, 3.1: that stays where other numbers do no better on windows that no fit saw.
  EXPECT_NEAR(d.retuned.model.value("k"), 3.0, 0.1 + 1e-9);
  EXPECT_THAT(summary(data, d), ::testing::HasSubstr("because the model integrates"));
}

TEST(Windows, TheAirsDragIsNamedWhereTheFreeRunDrifts) {
  auto data = pushed_mass(0.3, 0.0, 1500).with(model_of(mass));
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "quadratic");
  EXPECT_EQ(d.findings[0].term.on, "v");
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_NEAR(d.findings[0].term.values[0], -0.3, 0.03);
  EXPECT_LT(d.heldout[0].after, 0.2 * d.heldout[0].retuned);
}

/// A wind so slow that each short window takes it for a speed of its own.
TEST(Windows, WhatShortOnesHideLeavesTheVerdictOpen) {
  auto data = pushed_mass(0.3, 5e-4, 3000).with(model_of(mass));
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "quadratic");
  EXPECT_LT(d.heldout[0].after, 2.0 * d.heldout[0].noise_floor);  // in the short windows nothing is left
  EXPECT_EQ(d.verdict, Verdict::partly_explained);
  EXPECT_THAT(summary(data, d), ::testing::HasSubstr("something slow is left"));
}

/// A pendulum let go from these angles, of which the first is near the top, damped by the air.
std::vector<recording::Table> swings(const std::vector<double>& from, std::size_t rows) {
  std::mt19937 random{11};
  std::normal_distribution<double> normal;
  std::vector<recording::Table> all;
  for (const double angle : from) {
    std::vector<double> time, read;
    double x = angle, v = 0.0;
    for (std::size_t i = 0; i < rows; ++i) {
      time.push_back(0.001 * static_cast<double>(i));
      read.push_back(x + 1e-4 * normal(random));
      for (int part = 0; part < 4; ++part) {  // Heun's rule
        const double h = 0.00025, a = -9.81 * std::sin(x) - 0.1 * v, w = v + h * a;
        const double b = -9.81 * std::sin(x + h * v) - 0.1 * w;
        x += h * (v + 0.5 * h * a);
        v += 0.5 * h * (a + b);
      }
    }
    auto& table = all.emplace_back();
    table.add("t", "s", time);
    table.add("y", "rad", read);
  }
  return all;
}

const char* const let_go =
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\n"
    "states:\n  x: {derivative: v, initial: {value: 0, unit: rad, sigma: 3}}\n"
    "  v: {derivative: '-g*sin(x)', initial: {value: 0, unit: rad/s, sigma: 3}}\n"
    "outputs: {angle: {column: y, expression: x}}\n"
    "parameters: {g: {value: 9.6, unit: 1/s2, sigma: 0.2}}\n";

TEST(Windows, APendulumIsJudgedFromWhereItWasLetGoAndNotFromWhereItHangs) {
  auto data = make_case(model_of(let_go), swings({3.1, -2.9}, 3500));
  EXPECT_LE(rows_of(data), 6000);  // of 7000: what swings once a second is known from fewer
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_GT(data.windows.count, data.recordings.size());
  ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
  EXPECT_EQ(d.findings[0].term.info->name, "linear");
  EXPECT_EQ(d.findings[0].term.on, "v");
  EXPECT_NEAR(d.findings[0].term.values[0], -0.1, 0.005);
  EXPECT_NEAR(d.best.model.value("g"), 9.81, 0.01);
}

/// A cell that loses 0.7 % of its charge an hour by itself: less than a window of some rows shows.
TEST(Windows, ASlowLeakOfWhatAddsUpIsNamed) {
  std::mt19937 random{4};
  std::normal_distribution<double> normal;
  constexpr double h = 10.0, leak = 2e-6, capacity = 72e3, resistance = 0.01;
  Recorded r;
  double charge = 0.8, current = 0.0;
  for (int i = 0; i < 2400; ++i) {
    if (i % 60 == 0) current = std::uniform_real_distribution<double>{-5.0, 6.5}(random);
    r.time.push_back(h * i);
    r.drive.push_back(current);
    r.way.push_back(3.2 + 0.9 * charge - resistance * current + 2e-3 * normal(random));
    const double gone = 1.0 - std::exp(-leak * h);
    charge -= gone * (charge + current / capacity / leak);
  }
  auto data =
      r.with(model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {i: drive}\n"
                      "states: {soc: {derivative: '-i/Q', initial: {value: 0.8, unit: 1, sigma: 0.05}}}\n"
                      "outputs: {v: {column: y, expression: '3.2 + 0.9*soc - R*i'}}\nnoise: {v: 0.002}\n"
                      "parameters: {Q: {value: 71000, unit: A s, sigma: 3000}, R: {value: 0.01, unit: ohm, "
                      "sigma: 0.001}}\n"));
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
  EXPECT_EQ(d.findings[0].term.info->name, "linear") << summary(data, d);
  EXPECT_NEAR(d.findings[0].term.values[0], -leak, 0.3e-6);
}

/// What grows e-fold in half a second, held by a law that the model does not know: its input was recorded alone.
TEST(Windows, WhatRunsAwayIsFollowedOverShortOnes) {
  std::mt19937 random{3};
  std::normal_distribution<double> normal;
  Recorded r;
  double x = 0.0, to = 0.0;
  for (std::size_t i = 0; i < 1200; ++i) {
    if (i % 40 == 0) to = normal(random);
    const double y = x + 2e-3 * normal(random), u = 6.0 * (to - y);
    r.time.push_back(0.02 * static_cast<double>(i));
    r.drive.push_back(u);
    r.way.push_back(y);
    x = (x + u / 2.0) * std::exp(2.0 * 0.02) - u / 2.0;  // x' = 2 x + u
  }
  auto data = r.with(model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
      "states: {x: {derivative: 'a*x + u', initial: {value: 0, unit: m, sigma: 0.01}}}\n"
      "outputs: {way: {column: y, expression: x}}\nparameters: {a: {value: 1.9, unit: 1/s, sigma: 0.1}}\n"));
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_GT(data.windows.count, 5U);
  EXPECT_TRUE(d.findings.empty()) << d.findings[0].term.info->name;
  EXPECT_NEAR(d.retuned.model.value("a"), 2.0, 0.02);
  EXPECT_LT(d.heldout[0].after, 3.5e-3);
}

/// A tank forgets: it runs from its first row to its last.
TEST(Windows, WhatForgetsHasNone) {
  auto data =
      pushed_mass(0.0, 0.0, 1500)
          .with(model_of(
              "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
              "states: {x: {derivative: 'k*u - x', initial: {value: 0, unit: m, sigma: 0.01}}}\n"
              "outputs: {way: {column: y, expression: x}}\nparameters: {k: {value: 1, unit: m/s}}\n"));
  cut_into_windows(data);
  EXPECT_EQ(data.windows.count, 0U);
  EXPECT_EQ(data.model.parameters.size(), 2U);
}

/// An axis that a loop the model does not know leads to and fro: exact between rows, for the force is constant there but for
/// the friction, which turns or holds where the speed passes zero.
/// Of the rows from `lost` on, fifty were not recorded; 0: all were.
/// `slips` [m], by row, of the instrument.
Case led_axis(double friction, int lost = 0, const std::map<int, double>& slips = {}) {
  std::mt19937 random{11};
  std::normal_distribution<double> normal;
  constexpr double moved = 3.2, motor = 20.0, h = 1e-3;
  recording::Table table;
  std::vector<double> time, current, position;
  double x = 0.0, v = 0.0;
  for (int i = 0; i < 4000; ++i) {
    const double t = h * i;
    const double to = 0.03 * std::sin(4.0 * t) + 0.01 * std::sin(11.0 * t),
                 reading = x + 1e-6 * normal(random);
    const double u = std::clamp(1500.0 * (to - reading) - 40.0 * v, -8.0, 8.0);
    if (lost == 0 || i < lost || i >= lost + 50)
      time.push_back(t), current.push_back(u),
          position.push_back(reading + (slips.contains(i) ? slips.at(i) : 0.0));
    for (double left = h; left > 0.0;) {
      const double push = motor * u;
      if (v == 0.0 && std::abs(push) <= friction) break;  // holds
      const double a = (push - std::copysign(friction, v != 0.0 ? v : push)) / moved;
      const double stop = v * a < 0.0 ? -v / a : 2.0 * left, part = std::min(left, stop);
      x += part * (v + 0.5 * a * part);
      v = stop <= left ? 0.0 : v + a * part;
      left -= part;
    }
  }
  table.add("t", "s", time);
  table.add("i", "A", current);
  table.add("y", "m", position);
  return make_case(model_of("invar_model: 1\nplant: axis\ncolumns: {time: t, position: y, current: i}\n"
                            "parameters:\n  mass: {value: 3.2, unit: kg, sigma: 0.06}\n"
                            "  motor_constant: {value: 20.1, unit: N/A, sigma: 0.2}\n"
                            "  viscous_damping: {value: 0, unit: N s/m, sigma: 0}\n"),
                   {table});
}

TEST(Windows, AnAxisWithoutControllerIsJudgedOverThem) {
  auto data = led_axis(3.0);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_GT(data.windows.count, 20U);
  ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
  EXPECT_EQ(d.findings[0].term.info->name, "coulomb_friction") << summary(data, d);
  EXPECT_NEAR(d.findings[0].term.values[0], 3.0, 0.15);
  EXPECT_THAT(summary(data, d), ::testing::HasSubstr("each from states of its own"));
}

TEST(Windows, AnAxisThatTheModelKnowsLacksNothing) {
  auto data = led_axis(0.0);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.verdict, Verdict::no_mismatch) << summary(data, d);
  EXPECT_LT(d.heldout[0].after, 1.3e-6);
}

TEST(Windows, SlipsAreSeenWhereAWrongModelRunsAwaySmoothly) {
  auto data = led_axis(0.0, 0, {{501, 2e-4}, {1402, -1e-3}, {2203, 5e-5}, {3304, 4e-3}});
  for (auto& parameter : data.model.parameters)
    if (parameter.name == "motor_constant") parameter.value = 12.0;
  cut_into_windows(data);
  drop_outliers(data, simulate(data, data.model));
  const auto& position = data.recordings[0].measured[0];
  for (const std::size_t row : {501U, 1402U, 2203U, 3304U}) EXPECT_TRUE(std::isnan(position[row])) << row;
  EXPECT_LE(data.count.outliers, 8U);
}

TEST(Windows, WhatTheCurrentDidInAGapIsNotKnown) {
  auto data = led_axis(0.0, 2110);
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(data.windows.anew, 1U);
  EXPECT_EQ(d.verdict, Verdict::no_mismatch) << summary(data, d);
  EXPECT_LT(d.heldout[0].after, 1.3e-6);
}

/// A spring that the model has brings the carriage back: it goes through in one run, and what is slow shows.
TEST(Windows, AnAxisThatASpringHoldsHasNone) {
  std::mt19937 random{12};
  std::normal_distribution<double> normal;
  constexpr double h = 1e-3, air = 300.0;
  std::vector<double> time, current, position;
  double x = 0.0, v = 0.0, u = 0.0;
  for (int i = 0; i < 6000; ++i) {
    if (i % 200 == 0) u = std::uniform_real_distribution<double>{-4.0, 4.0}(random);
    time.push_back(h * i), current.push_back(u), position.push_back(x + 2e-5 * normal(random));
    for (int part = 0; part < 20; ++part) {
      const double s = h / 20.0, a = (20.0 * u - 60.0 * v - air * v * std::abs(v) - 900.0 * x) / 3.2;
      v += s * a;
      x += s * v;
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("i", "A", current);
  table.add("y", "m", position);
  auto data = make_case(
      model_of("invar_model: 1\nplant: axis\ncolumns: {time: t, position: y, current: i}\nparameters:\n"
               "  mass: {value: 3.2, unit: kg, sigma: 0.06}\n"
               "  motor_constant: {value: 20.1, unit: N/A, sigma: 0.2}\n"
               "  viscous_damping: {value: 70, unit: N s/m, sigma: 20}\n"
               "terms: [{term: position_stiffness, stiffness: {value: 900, unit: N/m, sigma: 9}, center: "
               "{value: 0, unit: m, sigma: 0}}]\n"),
      {table});
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(data.windows.count, 0U);
  ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
  EXPECT_EQ(d.findings[0].term.info->name, "quadratic_drag");
  EXPECT_NEAR(d.findings[0].term.values[0], air, 0.05 * air);
}

/// A pendulum that goes over the top again and again, in small steps of Verlet's rule; its angle as turns add up.
Recorded pendulum(unsigned seed, double torque) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  Recorded r;
  double angle = 0.0, rate = 0.0, u = 0.0;
  for (int i = 0; i < 1200; ++i) {
    if (i % 25 == 0) u = std::uniform_real_distribution<double>{-2.2, 2.2}(random);
    r.time.push_back(0.02 * i), r.drive.push_back(u), r.way.push_back(angle + 0.01 * normal(random));
    for (int part = 0; part < 200; ++part) {
      const double h = 1e-4;
      angle += 0.5 * h * rate;
      rate = (rate * (1.0 - 0.45 * h) + h * (torque * u - 20.0 * std::sin(angle))) / (1.0 + 0.45 * h);
      angle += 0.5 * h * rate;
    }
  }
  return r;
}

/// What the believed torque does not carry over the top goes another way: from there no small step leads to the machine.
TEST(Windows, WhatWentAnotherWayIsFoundFromShortOnes) {
  for (const unsigned seed : {22U, 26U, 34U}) {
    auto data =
        pendulum(seed, 11.0)
            .with(model_of(
                "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
                "states:\n  th: {derivative: w, initial: {value: 0, unit: rad, sigma: 0}}\n"
                "  w: {derivative: '-g*sin(th) - c*w + b*u', initial: {value: 0, unit: rad/s, sigma: 0}}\n"
                "outputs: {way: {column: y, expression: th}}\nparameters:\n"
                "  g: {value: 20, unit: 1/s2, sigma: 0.6}\n"
                "  c: {value: 0.9, unit: 1/s, sigma: 0.1}\n"
                "  b: {value: 9.2, unit: 1/(kg m2), sigma: 0.3}\n"));
    const auto d = diagnose(data, [](double, const std::string&) {});
    EXPECT_EQ(d.verdict, Verdict::parameters_only) << seed << summary(data, d);
    EXPECT_NEAR(d.best.model.value("b"), 11.0, 0.05) << seed;
  }
}

/// A name that only leads the user's numbers out of the valley in which they were stuck is none.
TEST(Windows, ANameThatOnlyLeadsOutOfAValleyIsNone) {
  for (const unsigned seed : {4U, 13U}) {
    auto data = pendulum(seed, 7.0).with(model_of(
        "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: drive}\n"
        "states:\n  th: {derivative: w, initial: {value: 0, unit: rad, sigma: 0}}\n"
        "  w: {derivative: '-g*sin(th) - c*w + b*u', initial: {value: 0, unit: rad/s, sigma: 0.13}}\n"
        "outputs: {way: {column: y, expression: th}}\nparameters:\n"
        "  g: {value: 25, unit: 1/s2, sigma: 0.75}\n"
        "  c: {value: 0.8, unit: 1/s, sigma: 0.13}\n"
        "  b: {value: 7, unit: 1/(kg m2), sigma: 0.35}\n"));
    const auto d = diagnose(data, [](double, const std::string&) {});
    EXPECT_EQ(d.verdict, Verdict::parameters_only) << seed << summary(data, d);
    EXPECT_NEAR(d.best.model.value("g"), 20.0, 0.1) << seed;
  }
}

TEST(Windows, AVesselWhoseFlowEbbsForgetsAllTheSame) {
  Recorded r;
  for (int i = 0; i < 600; ++i) {
    r.time.push_back(0.5 * i), r.way.push_back(i % 2 == 0 ? 2.0 : 2.001);
    r.drive.push_back(i < 300 ? 1.0 : 0.3);  // 10 s to fill anew, then 33 s of 300 s
  }
  auto vessel =
      r.with(model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {q: drive}\n"
                      "states:\n  c: {derivative: 'q*(2 - c)/10', initial: {value: 2, sigma: 0.01}}\n"
                      "outputs: {way: {column: y, expression: c}}\nparameters: {}\n"));
  cut_into_windows(vessel);
  EXPECT_EQ(vessel.windows.count, 0U);
  auto level =
      r.with(model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {q: drive}\n"
                      "states:\n  c: {derivative: 'q - 0.65', initial: {value: 2, sigma: 0.01}}\n"
                      "outputs: {way: {column: y, expression: c}}\nparameters: {}\n"));
  cut_into_windows(level);
  EXPECT_GT(level.windows.count, 0U);  // what it was given it keeps
}

}  // namespace
}  // namespace invar::diagnosis

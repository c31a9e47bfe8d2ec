// Axes in closed loop whose missing force is small beside the noise that goes round in the loop, simulated here.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <random>

#include "core/diagnosis/candidates/kin.hpp"
#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/diagnosis/search/verdict.hpp"
#include "core/physics/library.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

constexpr double mass = 20.0, motor = 23.0, damping = 19.0, period = 1e-3;

struct Axis {
  std::function<double(double time)> push = [](double) { return 0.0; };  // [N]
  double friction = 0.0;                                                 // at speed [N]
  double excess = 0.0,
         fades = 0.01;  // of the friction at rest [N], and the speed at which it has fallen to 1/e [m/s]
  std::function<double(double place)> misread = [](double) { return 0.0; };  // by the encoder [m]
  double noise = 2.3e-8;                                                     // of the encoder [m]
  double bristles = 0.0, stiffness = 1e4;                                    // Dahl's friction [N], [N/m]
  double reach = 0.02;                                                       // of the moves [m]
  std::function<double(double place)> rub = [](double) { return 0.0; };      // dry friction there [N]
  std::function<double(double place)> grease = [](double) { return 0.0; };   // damping there [N s/m]
  std::function<double(double place)> pull = [](double) { return 0.0; };     // there [N]
  std::function<double(double time)> warmth;                                 // degC; none: not recorded
  double thins = 0.0;  // by so much is the damping less for every degree above 20 [N s/(m K)]
  double dead = 0.0;   // current that moves nothing, to either side [A]
  double far = 0.0;    // place to which the third move goes [m]; 0: as the others
  std::function<double(double time)> load = [](double) { return 0.0; };  // lies on the carriage then [kg]
  double swings = 0.0, rings = 0.0;  // share of the mass that hangs on a spring, its frequency held fast [Hz]
  double size = 1.0;                 // of its mass, damping and motor
  std::function<double(double time)> weaker = [](double) {
    return 0.0;
  };                    // share that the motor has lost then
  double steady = 0.0;  // speed of a way without a turn, from the first row on [m/s]; 0: moves and rests
};

std::string belief(const char* name, double value, const char* unit, double sigma) {
  return std::string{"  "} + name + ": {value: " + std::to_string(value) + ", unit: " + unit +
         ", sigma: " + std::to_string(sigma) + "}\n";
}

/// Moves and rests under the contract's PID; forty steps of Heun's rule a cycle, stuck where friction holds.
Case recorded(const Axis& axis, double rest, unsigned seed) {
  constexpr double kp = 26000.0, ki = 470000.0, kd = 210.0, filter = 380.0;
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, axis.noise};
  std::uniform_real_distribution<double> places{-axis.reach, axis.reach};
  const double share = 1.0 - std::exp(-2.0 * std::numbers::pi * filter * period);
  std::vector<double> time, reference, position, current, temperature;
  double swing = 0.0, swing_speed = 0.0;
  const double heavy = axis.size * mass,
               pull_of_part = axis.swings * heavy * std::pow(2.0 * std::numbers::pi * axis.rings, 2);
  double bend = 0.0, x = 0.0, v = 0.0, sum = 0.0, slope = 0.0, last = 0.0, from = 0.0, to = 0.0, begun = 0.0;
  int moves = 0;
  for (int k = 0; k < 11000; ++k) {
    const double now = k * period;
    if (now > begun + 0.3 + rest) {
      begun = now, from = to, to = places(random);
      if (++moves == 3 && axis.far != 0.0) to = axis.far;
    }
    const double s = std::min(1.0, (now - begun) / 0.3);
    const double r = axis.steady > 0.0 ? axis.steady * now
                                       : from + (to - from) * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    const double y = x + axis.misread(x) + noise(random), e = r - y;
    if (k == 0) last = e;
    slope += share * ((e - last) / period - slope);
    last = e;
    sum += e;
    const double u = kp * e + ki * sum * period + kd * slope;
    const double felt = std::copysign(std::max(0.0, std::abs(u) - axis.dead), u);
    time.push_back(now), reference.push_back(r), position.push_back(y), current.push_back(u);
    temperature.push_back(axis.warmth ? axis.warmth(now) : 20.0);
    const double thinner = axis.thins * (temperature.back() - 20.0);
    constexpr int parts = 40;
    const double h = period / parts;
    for (int part = 0; part < parts; ++part) {
      double given =
          axis.size * motor * (1.0 - axis.weaker(now)) * felt + axis.push(now + part * h) + axis.pull(x);
      const double moved = (1.0 - axis.swings) * heavy + axis.load(now), spring = pull_of_part * swing;
      given += spring;
      if (axis.bristles > 0.0) {
        bend += h * v * (1.0 - std::copysign(1.0, v) * axis.stiffness / axis.bristles * bend);
        given -= axis.stiffness * bend;
      }
      const double dry = axis.friction + axis.rub(x), damps = axis.size * damping + axis.grease(x) - thinner;
      if (v == 0.0 && std::abs(given) <= dry + axis.excess) continue;
      const double way = v != 0.0 ? std::copysign(1.0, v) : std::copysign(1.0, given);
      const auto slows = [&](double speed) {
        const double held = dry + axis.excess * std::exp(-std::pow(speed / axis.fades, 2));
        return (given - damps * speed - way * held) / moved;
      };
      const double a = slows(v), b = slows(v + h * a), next = v + 0.5 * h * (a + b);
      if (axis.swings > 0.0) {
        swing_speed -= h * (spring / (axis.swings * heavy) + a);
        swing += h * swing_speed;
      }
      x += h * (v + 0.5 * h * a);
      v = dry > 0.0 && next * way < 0.0 ? 0.0 : next;
    }
  }
  recording::Table table;
  table.add("t", "s", time);
  table.add("r", "m", reference);
  table.add("y", "m", position);
  table.add("u", "A", current);
  if (axis.warmth) table.add("T", "degC", temperature);
  return make_case(
      test::model_of(
          std::string{
              "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: y, current: u"} +
          (axis.warmth ? ", temperature: T" : "") +
          "}\ncontroller: {kind: pid, rate: 1000, kp: 26000, ki: 470000, kd: 210, velocity_filter_hz: 380, "
          "limit: 50}\nparameters:\n" +
          belief("mass", axis.size * 20.1, "kg", axis.size * 0.25) +
          belief("motor_constant", axis.size * 23.0, "N/A", axis.size * 0.1) +
          belief("viscous_damping", axis.size * 18.0, "N s/m", axis.size * 2.5)),
      {table});
}

Diagnosis searched(Case data) {
  return diagnose(data, [](double, const std::string&) {});
}

TEST(AxisLoop, ASlowWaveThatTheLoopHoldsAgainstIsFound) {
  Axis axis;
  axis.push = [](double t) { return 0.12 * std::sin(2.0 * std::numbers::pi * 0.7 * t + 1.0); };
  const auto d = searched(recorded(axis, 0.25, 5));
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.findings[0].term;
  ASSERT_TRUE(term.info->name == "periodic_disturbance" || term.info->name == "additive_disturbance");
  EXPECT_NEAR(term.values[term.info->index_of("frequency")], 0.7, 0.004);
}

TEST(AxisLoop, FrictionThatTheNoiseShakesLooseIsFoundAndMeasured) {
  Axis axis;
  axis.friction = 0.15;
  axis.noise = 4.0e-8;
  const auto d = searched(recorded(axis, 1.8, 3));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "coulomb_friction");
  EXPECT_NEAR(d.findings[0].term.values[0], axis.friction, 0.15 * axis.friction);
}

TEST(AxisLoop, FrictionThatNoiseSmearsHasItsWholeLevel) {
  Axis axis;
  axis.friction = 0.3;
  axis.noise = 2.0e-7;
  const auto d = searched(recorded(axis, 1.5, 5));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "coulomb_friction");
  EXPECT_NEAR(d.findings[0].term.values[0], axis.friction, 0.15 * axis.friction);
}

TEST(AxisLoop, FrictionAtOneSpeedIsNotMoreThanCoulombs) {
  Axis axis;
  axis.friction = 4.0;
  axis.noise = 1.0e-7;
  axis.steady = 0.004;
  const auto d = searched(recorded(axis, 0.0, 4));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "coulomb_friction");
  EXPECT_NEAR(d.findings[0].term.values[0], axis.friction, 0.05 * axis.friction);
}

TEST(AxisLoop, BristlesOfAWeakSealBendAsFarAsThoseOfAStrongOne) {
  Axis axis;
  axis.bristles = 0.03;
  axis.stiffness = 1000.0;
  axis.reach = 2e-4;
  const auto d = searched(recorded(axis, 0.2, 6));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "presliding_friction");
  EXPECT_NEAR(d.findings[0].term.values[0], axis.bristles, 0.1 * axis.bristles);
  EXPECT_NEAR(d.findings[0].term.values[1], axis.stiffness, 0.2 * axis.stiffness);
}

TEST(AxisLoop, WhatHuntsWhereItRestsIsFrictionAlone) {
  for (const auto& [noise, seed] : {std::pair{1.0e-8, 5U}, {1.0e-7, 7U}}) {
    Axis axis;
    axis.friction = 1.0;
    axis.noise = noise;
    auto data = recorded(axis, 1.5, seed);
    const auto d = diagnose(data, [](double, const std::string&) {});
    EXPECT_GT(data.count.left_to_chance, 500U);
    ASSERT_EQ(d.findings.size(), 1U) << "noise " << noise;
    EXPECT_EQ(d.findings[0].term.info->name, "coulomb_friction");
    EXPECT_NEAR(d.findings[0].term.values[0], axis.friction, 0.03 * axis.friction);
  }
}

TEST(AxisLoop, FrictionFarBelowTheNoiseThatShakesItIsFound) {
  Axis axis;  // the noise makes the motor push with 0.5 N
  axis.friction = 0.015;
  axis.noise = 8.0e-8;
  const auto d = searched(recorded(axis, 1.2, 5));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "coulomb_friction");
  EXPECT_NEAR(d.findings[0].term.values[0], axis.friction, 0.1 * axis.friction);
}

TEST(AxisLoop, ADeadZoneFarBelowTheNoiseThatShakesItIsFound) {
  for (const double dead : {0.0003, 0.003}) {
    Axis axis;
    axis.dead = dead;
    axis.noise = 6.0e-8;
    const auto d = searched(recorded(axis, 1.2, 6));
    ASSERT_EQ(d.findings.size(), 1U);
    EXPECT_EQ(d.findings[0].term.info->name, "dead_zone");
    EXPECT_NEAR(d.findings[0].term.values[0], dead, 0.08 * dead);
  }
}

TEST(AxisLoop, ATiltBesideFrictionThatTheNoiseShakesIsFound) {
  Axis axis;
  axis.friction = 0.12;
  axis.push = [](double) { return -0.12; };
  axis.noise = 5.0e-8;
  const auto d = searched(recorded(axis, 0.3, 7));
  ASSERT_EQ(d.findings.size(), 2U);
  for (const auto& finding : d.findings) {
    const bool is_tilt = finding.term.info->name == "constant_force";
    EXPECT_TRUE(is_tilt || finding.term.info->name == "coulomb_friction") << finding.term.info->name;
    EXPECT_NEAR(finding.term.values[0], is_tilt ? -0.12 : axis.friction, 0.15 * axis.friction);
  }
}

TEST(AxisLoop, FrictionThatFallsWithTheSpeedIsReachedFromCoulombs) {
  Axis axis;
  axis.friction = 0.6;
  axis.excess = 0.5;
  axis.fades = 0.012;
  axis.reach = 0.004;
  const auto data = recorded(axis, 0.1, 8);
  auto model = data.model;
  auto& term = model.terms.emplace_back();
  term.info = physics::find_term(physics::Plant::axis, "coulomb_friction");
  term.values[0] = axis.friction;
  term.given[0] = true;
  const auto plain = weigh(data, simulate(data, model), Colour::white);
  const auto coulomb = fit(data, plain, model, data.model, Effort::follow(8));
  const auto others = fits_of_other_laws(data, plain, coulomb, 0, {});
  ASSERT_FALSE(others.empty());
  EXPECT_GT(others[0].evidence, coulomb.evidence + 100.0);
  const auto& found = others[0].model.terms[0];
  EXPECT_EQ(found.info->name, "stribeck_friction");
  EXPECT_NEAR(found.values[0], axis.friction, 0.1 * axis.friction);
  EXPECT_NEAR(found.values[1], axis.friction + axis.excess, 0.1);
  EXPECT_NEAR(found.values[2], axis.fades, 0.2 * axis.fades);
}

TEST(AxisLoop, AnEncoderThatReadsWrongInOnePlaceIsSeenToDoSo) {
  Axis axis;
  axis.misread = [](double x) { return 3e-7 * std::exp(-0.5 * std::pow((x - 0.004) / 0.0012, 2)); };
  const auto d = searched(recorded(axis, 0.1, 9));
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& curve = d.findings[0].term.curve;
  EXPECT_EQ(d.findings[0].term.info->site, "measurement");
  EXPECT_EQ(curve.over, "position");
  EXPECT_NEAR(curve(0.004) - 0.5 * (curve(-0.002) + curve(0.010)), 3e-7, 1e-7);
}

TEST(AxisLoop, FrictionInOneStretchIsFoundThereAndNowhereElse) {
  Axis axis;
  axis.rub = [](double x) { return x > 0.002 && x < 0.008 ? 0.8 : 0.0; };
  const auto d = searched(recorded(axis, 0.05, 7));
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  EXPECT_EQ(term.with, "direction");
  EXPECT_EQ(term.curve.over, "position");
  EXPECT_NEAR(term.curve(0.005), 0.8, 0.2);
  EXPECT_NEAR(term.curve(-0.005), 0.0, 0.1);
  EXPECT_NEAR(term.curve(0.015), 0.0, 0.1);
}

TEST(AxisLoop, DampingInOneStretchIsFoundThereAndNowhereElse) {
  Axis axis;
  axis.grease = [](double x) { return x > 0.002 && x < 0.008 ? 20.0 : 0.0; };
  const auto d = searched(recorded(axis, 0.05, 7));
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  EXPECT_EQ(term.with, "velocity");
  EXPECT_EQ(term.curve.over, "position");
  EXPECT_NEAR(term.curve(0.005) - term.curve(-0.005), 20.0, 5.0);
  EXPECT_NEAR(term.curve(0.015) - term.curve(-0.005), 0.0, 4.0);
}

TEST(AxisLoop, GreaseThatThinsAsItWarmsIsDampingOverTheTemperature) {
  Axis axis;
  axis.warmth = [](double t) { return 22.0 + 3.0 * std::sin(0.9 * t); };
  axis.thins = 2.0;
  const auto d = searched(recorded(axis, 0.05, 7));
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(term.with, "velocity");
  EXPECT_EQ(term.curve.over, "temperature");
  EXPECT_NEAR(term.curve(20.0) - term.curve(24.0), 8.0, 2.0);
}

TEST(AxisLoop, WhatPullsAtOnePlaceStandsThoughOneFoldAloneCameThere) {
  Axis axis;  // the third move goes by and the fourth comes back, both within one stretch of the eighteen
  axis.far = 0.1;
  axis.pull = [](double x) { return 1.5 * std::exp(-0.5 * std::pow((x - 0.09) / 0.003, 2)); };
  const auto d = searched(recorded(axis, 0.25, 6));
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& curve = d.findings[0].term.curve;
  EXPECT_EQ(d.findings[0].term.info->site, "force");
  EXPECT_EQ(curve.over, "position");
  EXPECT_NEAR(curve(0.09) - curve(0.0), 1.5, 0.4);
}

/// The model with a term more.
physics::Model with_term(physics::Model model, const char* name, const std::vector<double>& values) {
  auto& term = model.terms.emplace_back();
  term.info = physics::find_term(physics::Plant::axis, name);
  for (std::size_t i = 0; i < term.info->parameter_count(); ++i)
    term.values[i] = term.info->parameters[i].starts[0];
  for (std::size_t i = 0; i < values.size(); ++i) term.values[i] = values[i];
  term.given.fill(true);
  return model;
}

TEST(AxisLoop, AWaveThatOnlyShakesFrictionLooseIsNone) {
  for (const unsigned seed : {7U, 8U, 9U}) {
    Axis axis;
    axis.friction = 0.12;
    axis.push = [](double) { return -0.12; };
    axis.noise = 1.0e-7;
    const auto data = recorded(axis, 0.3, seed);
    // Where by chance most of the noise stands: a wave fast beside the machine, as large as the friction.
    const auto& current = data.recordings[0].measured[1];
    double frequency = 0.0, most = 0.0, phase = 0.0;
    for (double f = 150.0; f < 200.0; f += 0.03) {
      std::complex<double> sum;
      for (std::size_t i = 0; i < current.size(); ++i)
        sum += current[i] * std::polar(1.0, -2.0 * std::numbers::pi * f * period * static_cast<double>(i));
      if (std::abs(sum) > most) most = std::abs(sum), frequency = f, phase = std::arg(sum);
    }
    auto model = with_term(with_term(data.model, "coulomb_friction", {0.12}), "constant_force", {-0.12});
    model = with_term(model, "periodic_disturbance", {0.15, frequency, phase});
    const auto plain = weigh(data, simulate(data, model), Colour::white);
    auto found = fit(data, plain, model, data.model, Effort::evaluate());
    EXPECT_FALSE(stands(data, found, 2)) << seed;
  }
}

TEST(AxisLoop, NoRivalIsLedAstrayByTheStretchesThatItIsFittedTo) {
  Axis axis;  // moves in which it hardly slides, and one long one that two of three folds do not hold
  axis.bristles = 0.4;
  axis.stiffness = 1200.0;
  axis.reach = 1e-4;
  axis.far = 0.02;
  axis.noise = 1e-8;
  const auto data = recorded(axis, 0.1, 4);
  Diagnosis d;
  d.best = fit(data, weigh(data, simulate(data, data.model), Colour::white),
               with_term(data.model, "presliding_friction", {axis.bristles, axis.stiffness, 0.0}), data.model,
               Effort::follow(8));
  d.weighing = weigh(data, simulate(data, d.best.model));
  d.best = fit(data, d.weighing, d.best.model, data.model, Effort::follow(6));
  d.retuned = fit(data, d.weighing, data.model, data.model, Effort::follow(8));
  hold_out(data, data, d);
  ASSERT_EQ(d.heldout.size(), 2U);
  EXPECT_LT(d.heldout[0].retuned, 1.02 * d.heldout[0].before);  // counted in every row it was 1.08
}

TEST(AxisLoop, WhoLeansOnItForAMomentIsSeenThen) {
  Axis axis;
  axis.push = [](double t) { return 0.5 * std::exp(-0.5 * std::pow((t - 4.2) / 0.12, 2)); };
  const auto d = searched(recorded(axis, 0.25, 12));
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& curve = d.findings[0].term.curve;
  EXPECT_EQ(d.findings[0].term.info->site, "force");
  EXPECT_EQ(curve.over, "time");
  EXPECT_GT(curve.knots.front(), 3.0);
  EXPECT_LT(curve.knots.back(), 5.4);
  EXPECT_NEAR(curve(4.2) - curve(3.0), 0.5, 0.15);
  EXPECT_NEAR(curve(5.4) - curve(3.0), 0.0, 0.1);
}

TEST(AxisLoop, WhatIsPickedUpIsMassFromThenOn) {
  Axis axis;
  axis.load = [](double t) { return t < 5.0 ? 0.0 : 0.6; };
  auto data = recorded(axis, 0.25, 14);
  const auto d = searched(data);
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(term.curve.over, "time");
  EXPECT_EQ(place_of(data, term), "mass of the carriage");
  EXPECT_EQ(unit_of_curve(data, term), "kg");
  EXPECT_NEAR(term.curve(9.0) - term.curve(2.0), 0.6, 0.03);
  EXPECT_NEAR(d.best.model.value("mass") + term.curve(2.0), mass, 0.1);
}

TEST(AxisLoop, WhatIsPickedUpIsMassBesideALawOfFrictionToo) {
  Axis axis;
  axis.friction = 0.6;
  axis.load = [](double t) { return t < 5.0 ? 0.0 : 0.6; };
  const auto d = searched(recorded(axis, 0.25, 17));
  ASSERT_EQ(d.findings.size(), 2U);
  EXPECT_EQ(d.findings[0].term.info->name, "coulomb_friction");
  EXPECT_NEAR(d.findings[0].term.values[0], 0.6, 0.05);
  EXPECT_EQ(d.findings[1].term.with, "acceleration");
  EXPECT_NEAR(d.findings[1].term.curve(9.0) - d.findings[1].term.curve(2.0), 0.6, 0.1);
}

TEST(AxisLoop, OfASmallAxisSmallForcesAreFound) {
  Axis axis;  // 20 g, and a loop as stiff as 600 N/m: of half a newton first order would tell nothing
  axis.size = 1e-3;
  axis.pull = [](double x) { return 2e-5 * std::sin(2.0 * std::numbers::pi * x / 1.3e-3 + 0.4); };
  const auto d = searched(recorded(axis, 0.25, 18));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "force_ripple");
  EXPECT_NEAR(d.findings[0].term.values[0], 2e-5, 3e-6);
  EXPECT_NEAR(d.findings[0].term.values[1], 1.3e-3, 1e-6);
}

TEST(AxisLoop, SoftBristlesBendOverAGoodPartOfTheWay) {
  Axis axis;
  axis.bristles = 0.6, axis.stiffness = 150.0;  // 4 mm of 40
  const auto d = searched(recorded(axis, 0.25, 19));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "presliding_friction");
  EXPECT_NEAR(d.findings[0].term.values[0], 0.6, 0.06);
  EXPECT_NEAR(d.findings[0].term.values[1], 150.0, 40.0);
}

TEST(AxisLoop, AMotorThatFadesDoesSoOverTheTime) {
  Axis axis;
  axis.weaker = [](double t) { return 0.03 * (1.0 - std::exp(-t / 4.0)); };
  auto data = recorded(axis, 0.25, 20);
  const auto d = searched(data);
  EXPECT_EQ(d.verdict, Verdict::unknown_physics);
  ASSERT_EQ(d.findings.size(), 1U);
  const auto& term = d.findings[0].term;
  EXPECT_EQ(term.info->site, "actuator");
  EXPECT_EQ(term.curve.over, "time");
  EXPECT_NEAR(term.curve(9.0) - term.curve(1.0), -0.03 * (std::exp(-0.25) - std::exp(-2.25)), 0.004);
}

TEST(AxisLoop, AWaveThatComesOnceAndAHalfIsOne) {
  Axis axis;
  axis.pull = [](double x) { return 0.4 * std::sin(2.0 * std::numbers::pi * x / 0.024 + 0.4); };
  const auto d = searched(recorded(axis, 0.25, 21));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "force_ripple");
  EXPECT_NEAR(d.findings[0].term.values[1], 0.024, 0.0005);
}

TEST(AxisLoop, APartThatRingsForLongIsAModeAllTheSame) {
  Axis axis;
  axis.swings = 0.01, axis.rings = 43.0;
  const auto d = searched(recorded(axis, 0.25, 15));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "flexible_mode");
  EXPECT_NEAR(d.findings[0].term.values[1], 43.0, 2.0);
  EXPECT_LT(d.findings[0].term.values[2], 0.02);
}

TEST(AxisLoop, AWaveThatPaysTwiceIsSaidThoughTheResidualHardlyShowsIt) {
  Axis axis;
  axis.push = [](double t) { return 0.0012 * std::sin(2.0 * std::numbers::pi * 7.3 * t); };
  const auto d = searched(recorded(axis, 0.25, 16));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_NEAR(d.findings[0].term.values[d.findings[0].term.info->index_of("frequency")], 7.3, 0.05);
}

TEST(AxisLoop, WhatPaysIsSaidThoughTheResidualHardlyShowsIt) {
  Axis axis;  // two in ten thousand of it, and sixty nats
  axis.pull = [](double x) { return -0.2 * x; };
  const auto d = searched(recorded(axis, 0.25, 13));
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].term.info->name, "position_stiffness");
  EXPECT_NEAR(d.findings[0].term.values[0], 0.2, 0.04);
}

TEST(AxisLoop, NoiseAloneIsNoPhysics) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const auto d = searched(recorded({}, 1.0, seed));
    EXPECT_TRUE(d.findings.empty()) << "seed " << seed;
    EXPECT_EQ(d.verdict, Verdict::no_mismatch) << "seed " << seed;
  }
}

}  // namespace
}  // namespace invar::diagnosis

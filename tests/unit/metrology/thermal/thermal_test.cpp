// Thermistor golden numbers; identification on machines whose truth is known.
#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "core/metrology/thermal/heat_trace.hpp"
#include "core/metrology/thermal/lone_outliers.hpp"
#include "core/metrology/thermal/thermal_error.hpp"
#include "core/metrology/thermal/thermal_identification.hpp"
#include "core/metrology/thermal/thermistor.hpp"

namespace invar::metrology {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Thermistor, HasTheGoldenResistances) {
  const Thermistor seed;  // 1 kOhm at 25 degC, a = 4.4
  EXPECT_NEAR(seed.resistance(20.0), 1250.761, 1e-3);
  EXPECT_NEAR(seed.resistance(26.8), 924.294, 1e-3);
  EXPECT_NEAR(seed.resistance(28.5), 858.805, 1e-3);
  EXPECT_NEAR(seed.resistance(30.0), 805.436, 1e-3);
  EXPECT_NEAR((seed.resistance(28.55) - seed.resistance(28.45)) / 0.1, -36.9, 0.1);
  for (double t = -20.0; t < 80.0; t += 7.0) EXPECT_NEAR(seed.temperature(seed.resistance(t)), t, 1e-9);
}

TEST(Thermistor, IsCalibratedFromReadings) {
  const Thermistor truth{1013.0, 25.0, 4.1};
  const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(9, 20.0, 40.0);
  const Eigen::VectorXd r = t.unaryExpr([&](double at) { return truth.resistance(at); });
  const ThermistorFit fit = fit_thermistor(t, r);
  EXPECT_NEAR(fit.thermistor.resistance_at_base, 1013.0, 1e-6);
  EXPECT_NEAR(fit.thermistor.coefficient_percent, 4.1, 1e-9);
  EXPECT_LT(fit.rms, 1e-9);
}

/// 10 kOhm NTC of many data sheets: 1/T = A + B ln R + C ln(R)^3, 25 degC at 10 kOhm.
double steinhart_hart(double resistance) {
  const double x = std::log(resistance);
  return 1.0 / (1.129148e-3 + 2.34125e-4 * x + 8.76741e-8 * x * x * x) - 273.15;
}

TEST(Thermistor, IsSteinhartHartWhereThatPredictsReadingsBetter) {
  Eigen::VectorXd r(15), t(15);
  for (Eigen::Index i = 0; i < 15; ++i) r(i) = 400.0 * std::pow(1.42, static_cast<double>(i));
  for (Eigen::Index i = 0; i < 15; ++i) t(i) = steinhart_hart(r(i));
  const ThermistorFit fit = fit_thermistor(t, r);
  EXPECT_GT(fit.thermistor.third_order, 0.0);
  EXPECT_NEAR(fit.thermistor.third_order, 8.76741e-8, 1e-12);
  EXPECT_NEAR(fit.thermistor.resistance_at_base, 1e4, 1.0);
  EXPECT_GT(fit.held_out_b, 0.3);
  for (double resistance = 450.0; resistance < 5e4; resistance *= 1.3) {
    EXPECT_NEAR(fit.thermistor.temperature(resistance), steinhart_hart(resistance), 1e-6);
    EXPECT_NEAR(fit.thermistor.resistance(steinhart_hart(resistance)), resistance, 1e-6 * resistance);
  }
}

TEST(Thermistor, StaysWithTheBLawWhereNothingSpeaksAgainstIt) {
  const Thermistor truth{1013.0, 25.0, 4.1};
  int b_laws = 0;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    std::mt19937 random{seed};
    std::normal_distribution<double> normal;
    const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(12, 10.0, 80.0);
    const Eigen::VectorXd r =
        t.unaryExpr([&](double at) { return truth.resistance(at + 0.02 * normal(random)); });
    const ThermistorFit fit = fit_thermistor(t, r);
    b_laws += fit.thermistor.third_order == 0.0 ? 1 : 0;
    EXPECT_LT(std::abs(fit.thermistor.temperature(truth.resistance(45.0)) - 45.0), 0.05) << seed;
  }
  EXPECT_GT(b_laws, 30);
}

/// A stage with smooth geometry, expansion with curvature, and what else a test asks for.
struct Stage {
  std::array<double, 5> geometry{};
  double expansion = 12e-6;  // [1/K]
  double curved = 0.15;      // of the expansion, per K
  double lag = 0.0;          // [m s/(K m)]: error per rate and metre
  double hysteresis = 0.0;   // [m] at full travel
  explicit Stage(unsigned seed) {
    std::mt19937 random{seed};
    std::normal_distribution<double> normal;
    for (double& g : geometry) g = 0.7e-6 * normal(random);
    expansion *= 1.0 + 0.3 * normal(random);
  }
  double error(double x, double t, double rate) const {
    const double dt = t - 27.0;
    double e = 0.0;
    for (std::size_t k = 0; k < geometry.size(); ++k)
      e += geometry[k] *
           std::sin(std::numbers::pi * static_cast<double>(k + 1) * x / 0.2 + static_cast<double>(k));
    e -= expansion * (x + 0.01) * dt * (1.0 + curved * (dt - 1.5) * std::cos(8.0 * x));
    return e + lag * x * rate + hysteresis * x / 0.2 * std::tanh(rate / 1e-4);
  }
};

ThermalReadings record(const Stage& stage, unsigned seed, const std::vector<double>& rates, double noise) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  std::vector<double> x, t, e, r, d;
  for (const double level : {27.0, 28.0, 29.0, 30.0})
    for (const double rate : rates)
      for (const double way : {1.0, -1.0})
        for (int k = 0; k <= 40; ++k) {
          x.push_back(0.005 * (way > 0.0 ? k : 40 - k));
          t.push_back(level + 0.03 * normal(random));
          r.push_back(rate);
          d.push_back(way);
          e.push_back(stage.error(x.back(), t.back(), rate) + 0.2e-6 * way + noise * normal(random));
          if (random() % 100 == 0) e.back() += 20e-6 * normal(random);
        }
  const auto vector = [](const std::vector<double>& v) -> Eigen::VectorXd {
    return Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
  };
  ThermalReadings readings{vector(x), vector(t), vector(e), std::nullopt, vector(d), std::nullopt, {}};
  if (rates.front() != rates.back()) readings.heating_rate = vector(r);
  return readings;
}

TEST(ThermalIdentification, FindsTheSurfaceAndKnowsHowWellOverManyStages) {
  constexpr int stages = 4;
  int covered = 0;
  int total = 0;
  for (unsigned seed = 1; seed <= stages; ++seed) {
    const Stage stage{seed};
    const ThermalFit fit = identify_thermal(record(stage, seed, {0.0, 0.0}, 0.3e-6));
    double squares = 0.0;
    int count = 0;
    for (double x = 0.001; x < 0.2; x += 0.004)
      for (double t = 27.1; t < 30.0; t += 0.37) {
        const double apart = fit.model.value({x, t, 0.0}) - stage.error(x, t, 0.0);
        squares += apart * apart;
        covered += std::abs(apart) <= 2.0 * fit.model.sigma({x, t, 0.0}) ? 1 : 0;
        ++count;
      }
    total += count;
    EXPECT_LT(std::sqrt(squares / count), 0.12e-6) << "stage " << seed;  // noise 0.3 um, 656 readings
    EXPECT_NEAR(fit.reversal, 0.4e-6, 0.05e-6);
    EXPECT_THAT(fit.unidentified, IsEmpty());
  }
  EXPECT_GT(static_cast<double>(covered) / total, 0.88);
  EXPECT_LT(static_cast<double>(covered) / total, 0.999);
}

TEST(ThermalIdentification, TakesHeatingRateAndHysteresisWhereTheDataShowThem) {
  Stage stage{11};
  stage.lag = 4e-3;
  stage.hysteresis = 0.6e-6;
  const std::vector<double> rates{-1.5e-3, -7e-4, 0.0, 7e-4, 1.5e-3};
  const ThermalFit fit = identify_thermal(record(stage, 4, rates, 0.2e-6));
  double squares = 0.0;
  int count = 0;
  for (double x = 0.0; x <= 0.2; x += 0.01)
    for (const double rate : {-1.2e-3, -3e-4, 4e-4, 1.3e-3}) {
      squares += std::pow(fit.model.value({x, 28.6, rate}) - stage.error(x, 28.6, rate), 2);
      ++count;
    }
  EXPECT_LT(std::sqrt(squares / count), 0.15e-6);

  const ThermalFit plain = identify_thermal(record(Stage{12}, 5, rates, 0.2e-6));
  for (const auto& candidate : plain.candidates) {
    if (candidate.chosen) {
      EXPECT_EQ(candidate.name, "position and temperature");
    }
  }
}

// Heating and cooling differ, but no column says which it was: nothing can tell them apart, and sigma has to say so.
TEST(ThermalIdentification, SigmaHoldsWhatTheColumnsDoNotTell) {
  Stage stage{3};
  stage.hysteresis = 2e-6;
  ThermalReadings readings = record(stage, 3, {1e-4, -1e-4, 1e-4, -1e-4}, 0.3e-6);
  readings.heating_rate.reset();
  const ThermalFit fit = identify_thermal(readings);
  int covered = 0;
  int total = 0;
  for (double x = 0.001; x < 0.2; x += 0.004)
    for (double t = 27.1; t < 30.0; t += 0.37)
      for (const double rate : {1e-4, -1e-4}) {
        const double apart = fit.model.value({x, t, 0.0}) - stage.error(x, t, rate);
        covered += std::abs(apart) <= 2.0 * fit.model.sigma({x, t, 0.0}) ? 1 : 0;
        ++total;
      }
  EXPECT_GT(static_cast<double>(covered) / total, 0.88);
  EXPECT_THAT(fit.unexplained, Contains(HasSubstr("heating_rate [K/s]")));
}

TEST(ThermalIdentification, HoldsTheValueOutsideAndLetsSigmaGrow) {
  const ThermalFit fit = identify_thermal(record(Stage{2}, 2, {0.0, 0.0}, 0.3e-6));
  const Range& range = fit.model.temperature;
  EXPECT_DOUBLE_EQ(fit.model.value({0.15, range.upper + 3.0, 0.0}),
                   fit.model.value({0.15, range.upper, 0.0}));
  const double edge = fit.model.sigma({0.15, range.upper, 0.0});
  EXPECT_GT(fit.model.sigma({0.15, range.upper + 1.0, 0.0}), 2.0 * edge);
  EXPECT_GT(fit.model.sigma({0.15, range.upper + 4.0, 0.0}),
            3.0 * fit.model.sigma({0.15, range.upper + 1.0, 0.0}));
  EXPECT_FALSE(fit.model.inside({0.15, range.upper + 0.1, 0.0}));
}

TEST(ThermalIdentification, SaysThatOneTemperatureTellsNothingOfOthers) {
  ThermalReadings readings = record(Stage{3}, 3, {0.0, 0.0}, 0.3e-6);
  readings.temperature.setConstant(27.0);
  const ThermalFit fit = identify_thermal(readings);
  EXPECT_THAT(fit.unidentified, Contains("temperature dependence"));
  EXPECT_GT(fit.model.sigma({0.1, 28.0, 0.0}), 1e-6);
}

TEST(ThermalIdentification, FindsTheTimeConstantOfABodyThatLags) {
  // Section 9: fast cycles, tau 600 s, 12 um/(m K) over 0.2 m, 27 to 30 degC.
  const Stage stage{5};
  std::vector<double> time, temperature;
  for (double at = 0.0; at < 14'400.0; at += 10.0) {
    time.push_back(at);
    temperature.push_back(28.5 + 0.9 * std::sin(at / 400.0) + 0.6 * std::sin(at / 1300.0 + 1.0));
  }
  const auto n = static_cast<Eigen::Index>(time.size());
  const Eigen::Map<const Eigen::VectorXd> t{time.data(), n};
  const Eigen::Map<const Eigen::VectorXd> measured{temperature.data(), n};
  const Eigen::VectorXd body = lagged_temperature(t, measured, 600.0);
  std::mt19937 random{9};
  std::normal_distribution<double> normal;
  ThermalReadings readings{Eigen::VectorXd(n), measured, Eigen::VectorXd(n), std::nullopt, std::nullopt,
                           Eigen::VectorXd(t), {}};
  for (Eigen::Index i = 0; i < n; ++i) {
    readings.x(i) = 0.005 * static_cast<double>(i % 82 < 41 ? i % 82 : 81 - i % 82);
    readings.error(i) = stage.error(readings.x(i), body(i), 0.0) + 0.2e-6 * normal(random);
  }
  const ThermalFit fit = identify_thermal(readings);
  EXPECT_NEAR(fit.model.lag, 600.0, 60.0);
}

/// A slide that is heated and cools over 40 minutes while a line is read forth and back, one pass in four left out. Its scale
/// lags behind the thermistor by `lag`, or its error also follows the heating rate as the thermistor shows it.
struct HeatedLine {
  double lag = 0.0;          // s
  double rate_effect = 0.0;  // m s/(K m)
  unsigned seed = 1;
  double noise = 2e-7;  // m; of the thermistor in proportion, 3 mK
};

ThermalReadings read_while_heated(const HeatedLine& world) {
  const auto wanted = [](double t) {
    constexpr std::array<double, 6> time{0, 600, 800, 1400, 1500, 2400};
    constexpr std::array<double, 6> level{26.8, 28.6, 28.6, 30, 30, 27};
    for (std::size_t i = 0; i + 1 < time.size(); ++i)
      if (t < time[i + 1])
        return level[i] + (level[i + 1] - level[i]) * std::max(0.0, t - time[i]) / (time[i + 1] - time[i]);
    return level.back();
  };
  std::mt19937 random{world.seed};
  std::normal_distribution<double> normal;
  HeatTrace trace{20.0};
  std::vector<double> x, t, e, r, d, at;
  ThermalReadings readings;
  constexpr double step = 0.1;
  double slide = 26.8, scale = slide, next = -150.0;
  for (int k = 0, i = 0; k < 25'500; ++k) {
    const double now = k * step - 150.0;
    const double before = slide;
    slide += step / 15.0 * (wanted(now) - slide);  // the heater follows its trace a little late
    scale = world.lag > 0.0 ? lag_step(scale, before, slide, step, world.lag) : slide;
    const double measured = slide + 1.5e4 * world.noise * normal(random);
    if (k % 2 == 0) trace.add(now, measured);
    if (k % 20 == 0) {
      readings.history.time.push_back(now);
      readings.history.temperature.push_back(measured);
    }
    if (now < next) continue;
    const int place = i % 42;
    const double position = 0.01 * (place < 21 ? place : 41 - place), warmth = scale - 26.8;
    if ((i / 42) % 4 != 3) {
      x.push_back(position), t.push_back(measured), r.push_back(trace.rate()), at.push_back(now);
      d.push_back(place < 21 ? 1.0 : -1.0);
      e.push_back(1.4e-6 * std::sin(37.0 * position + 0.7) - (19e-6 * position + 2e-7) * warmth +
                  world.rate_effect * position * trace.rate() + world.noise * normal(random));
    }
    next = now + 1.7 + (++i % 42 == 0 ? 20.0 : 0.0);
  }
  const auto vector = [](const std::vector<double>& v) -> Eigen::VectorXd {
    return Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
  };
  readings.x = vector(x), readings.temperature = vector(t), readings.error = vector(e);
  readings.heating_rate = vector(r), readings.direction = vector(d), readings.time = vector(at);
  return readings;
}

const ThermalCandidate& chosen_of(const ThermalFit& fit) {
  return *std::find_if(fit.candidates.begin(), fit.candidates.end(), [](const auto& c) { return c.chosen; });
}

TEST(ThermalIdentification, KeepsReadingsWithoutNoise) {
  const ThermalFit fit = identify_thermal(read_while_heated({.seed = 4, .noise = 0.0}));
  EXPECT_GT(fit.kept.mean(), 0.99);
}

TEST(ThermalIdentification, ChoosesTheBodyThatLagsOrTheHeatingRateAsTheWorldHasIt) {
  for (unsigned seed = 1; seed <= 2; ++seed) {
    for (const HeatedLine& world :
         {HeatedLine{.lag = 90.0, .seed = seed}, HeatedLine{.lag = 300.0, .seed = seed}}) {
      const ThermalFit fit = identify_thermal(read_while_heated(world));
      EXPECT_EQ(chosen_of(fit).name, "lagged temperature") << "lag " << world.lag << " seed " << seed;
      EXPECT_NEAR(fit.model.lag, world.lag, 0.1 * world.lag);
    }
    const ThermalFit fit = identify_thermal(read_while_heated({.rate_effect = 1.7e-3, .seed = seed}));
    EXPECT_EQ(chosen_of(fit).name, "heating rate") << "seed " << seed;
    EXPECT_EQ(fit.model.lag, 0.0);
    const ThermalFit neither = identify_thermal(read_while_heated({.seed = seed}));
    EXPECT_EQ(chosen_of(neither).name, "position and temperature") << "seed " << seed;
  }
}

TEST(ThermalIdentification, SaysWhyAndMeetsPassesThatItDidNotSee) {
  const ThermalFit fit = identify_thermal(read_while_heated({.lag = 90.0}));
  const ThermalCandidate& chosen = chosen_of(fit);
  EXPECT_THAT(chosen.verdict, ::testing::StartsWith("taken: log evidence changes by"));
  EXPECT_THAT(chosen.verdict, ::testing::HasSubstr("passes not fitted are met to"));
  EXPECT_NEAR(chosen.held_out_rms, 2e-7, 2e-8);  // the noise of one reading
  for (const auto& candidate : fit.candidates) {
    EXPECT_GE(candidate.held_out_rms, 0.98 * chosen.held_out_rms) << candidate.name;
    EXPECT_FALSE(candidate.verdict.empty()) << candidate.name;
  }
}

TEST(ThermalReadings, TheTemperatureOfABodyThatLagsComesFromTheHistoryNotFromTheFewReadings) {
  const auto sensor = [](double t) { return t < 300.0 ? 25.0 + 6e-3 * t : 26.8 - 2e-3 * (t - 300.0); };
  ThermalReadings readings;
  readings.time = Eigen::Vector3d{101.0, 640.0, 641.5};
  readings.x = Eigen::Vector3d::Zero();
  readings.temperature = readings.time->unaryExpr(sensor);
  for (double t = 0.0; t <= 640.0; t += 2.0) {
    readings.history.time.push_back(t);
    readings.history.temperature.push_back(sensor(t));
  }
  // A ramp from equilibrium lags by rate * tau (1 - exp(-t / tau)); the second ramp begins with what the first left.
  const auto body = [](double t) {
    const double tau = 150.0, gone = std::exp(-300.0 / tau);
    if (t < 300.0) return 25.0 + 6e-3 * (t - tau * (1.0 - std::exp(-t / tau)));
    const double after = std::exp(-(t - 300.0) / tau);
    return 26.8 - 2e-3 * (t - 300.0) + 2e-3 * tau * (1.0 - after) - 6e-3 * tau * (1.0 - gone) * after;
  };
  const Eigen::VectorXd lagged = readings.lagged(150.0);
  for (Eigen::Index i = 0; i < 3; ++i) EXPECT_NEAR(lagged(i), body((*readings.time)(i)), 1e-9) << i;
  readings.history = {};
  EXPECT_GT(std::abs(readings.lagged(150.0)(1) - body(640.0)), 0.1);
}

TEST(ThermalIdentification, TakesAZoneThatMattersAndLeavesOutOneThatDoesNot) {
  ThermalReadings readings = record(Stage{6}, 6, {0.0, 0.0}, 0.2e-6);
  const Eigen::Index n = readings.x.size();
  std::mt19937 random{3};
  std::uniform_real_distribution<double> uniform;
  Eigen::VectorXd base(n);
  Eigen::VectorXd cabinet(n);
  const auto by_base = [](double x, double t) { return 6e-6 * x * (t - 23.0); };
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto pass = static_cast<double>(i / 41);
    base(i) = 22.0 + 2.0 * std::sin(0.7 * pass);
    cabinet(i) = 25.0 + 3.0 * uniform(random);
    readings.error(i) += by_base(readings.x(i), base(i));
  }
  readings.zones = {{"cabinet", cabinet}, {"base", base}};
  const ThermalFit fit = identify_thermal(readings);
  ASSERT_EQ(fit.model.zones.size(), 1U);
  EXPECT_EQ(fit.model.zones[0].name, "base");
  for (const double x : {0.02, 0.1, 0.19})
    for (const double t : {20.5, 23.5}) {
      const ThermalState at{x, 28.5, 0.0, {t}};
      const double apart = fit.model.value(at) - Stage{6}.error(x, 28.5, 0.0) - by_base(x, t);
      EXPECT_LT(std::abs(apart), 0.2e-6);
      EXPECT_LT(std::abs(apart), 4.0 * fit.model.sigma(at));
    }
  CompiledThermalError compiled{fit.model, 5e-9};
  compiled.set(28.2, 0.0, {24.5});
  const ThermalState outside{0.15, 28.2, 0.0, {24.5}};
  EXPECT_NEAR(compiled.value(0.15), fit.model.value(outside), 5e-9);
  EXPECT_FALSE(compiled.inside());
  EXPECT_GT(fit.model.sigma(outside), fit.model.sigma({0.15, 28.2, 0.0, {23.0}}));
}

/// Readings at a few places, in turn, while the temperature rises by ten kelvin.
ThermalReadings at_places(int places, unsigned seed, double noise,
                          const std::function<double(double u, double dt)>& error) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  constexpr int rounds = 150;
  ThermalReadings readings;
  const Eigen::Index n = rounds * places;
  readings.x.resize(n), readings.temperature.resize(n), readings.error.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double u = 2.0 * static_cast<double>(i % places) / (places - 1) - 1.0;
    const double dt = 10.0 * static_cast<double>(i / places) / (rounds - 1);
    readings.x(i) = 0.3 + 0.3 * u;
    readings.temperature(i) = 21.0 + dt;
    readings.error(i) = error(u, dt) + noise * normal(random);
  }
  return readings;
}

double worst_between(const ThermalFit& fit, const std::function<double(double u, double dt)>& error) {
  double worst = 0.0;
  for (double u = -1.0; u <= 1.0; u += 0.05)
    for (double dt = 0.0; dt <= 10.0; dt += 1.0)
      worst = std::max(worst, std::abs(fit.model.value({0.3 + 0.3 * u, 21.0 + dt, 0.0}) - error(u, dt)));
  return worst;
}

TEST(ThermalIdentification, KnowsAConstantAScaleAndABowBetweenTheFewPlacesRead) {
  using Error = std::function<double(double, double)>;
  const Error constant = [](double, double dt) { return 4e-5 - 2.5e-5 * dt; };
  const Error scale = [](double u, double dt) { return 7e-6 * (1.0 + u) * dt - 2e-5 * u; };
  const Error bow = [](double u, double dt) { return 3e-6 * (1.0 - u * u) * dt + 1e-6 * u; };
  constexpr double noise = 3e-7;  // a fit of six numbers knows each to 0.05 um
  for (const int places : {2, 3, 4, 6})
    for (const Error* error : {&constant, &scale, &bow}) {
      if (places == 2 && error == &bow) continue;
      const ThermalFit fit = identify_thermal(at_places(places, 7, noise, *error));
      EXPECT_LT(worst_between(fit, *error), noise) << places << " places";
    }
}

TEST(ThermalIdentification, SigmaGrowsBetweenTwoPlacesForTheBowThatTheyDoNotShow) {
  const auto bow = [](double u, double dt) { return 1e-6 * (1.0 - u * u) * dt + 1e-5 * u * dt; };
  const ThermalFit fit = identify_thermal(at_places(2, 7, 3e-7, bow));
  const double apart = std::abs(fit.model.value({0.3, 31.0, 0.0}) - bow(0.0, 10.0));
  EXPECT_GT(apart, 9e-6);
  EXPECT_LT(apart, 2.0 * fit.model.sigma({0.3, 31.0, 0.0}));
  EXPECT_LT(fit.model.sigma({0.0, 31.0, 0.0}), 2e-7);
}

// The mount of a laser that warms for a while: a quarter of the readings lie far off, one after another.
TEST(ThermalIdentification, AStretchIsNoOutlier) {
  const auto plain = [](double u, double dt) { return 2e-6 * (1.0 + u) * dt; };
  ThermalReadings readings = at_places(5, 3, 2e-7, plain);
  const Eigen::Index n = readings.x.size();
  for (Eigen::Index i = n / 4; i < n / 2; ++i)
    readings.error(i) +=
        2e-5 * std::sin(std::numbers::pi * static_cast<double>(i - n / 4) / static_cast<double>(n / 4));
  readings.error(n - 20) += 4e-4;
  const ThermalFit fit = identify_thermal(readings);
  EXPECT_EQ(static_cast<Eigen::Index>(fit.kept.sum()), n - 1);
  EXPECT_EQ(fit.kept(n - 20), 0.0);
  EXPECT_THAT(fit.unexplained, ::testing::Not(IsEmpty()));
  int covered = 0;
  for (Eigen::Index i = 0; i < n; ++i)
    covered += std::abs(readings.error(i) - fit.predicted(i)) <=
                       2.0 * fit.model.sigma({readings.x(i), readings.temperature(i), 0.0})
                   ? 1
                   : 0;
  EXPECT_GT(covered, 0.85 * static_cast<double>(n));
}

TEST(LoneOutliers, AreToldFromStretchesInTimeAndAtOnePlace) {
  // Three places in turn; the last of them deviates four times running, two glitches stand beside one another.
  const std::vector<int> place{0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2};
  Eigen::VectorXd residual = Eigen::VectorXd::Constant(15, 0.1);
  for (const Eigen::Index i : {2, 5, 8, 11}) residual(i) = 6.0;
  residual(12) = 40.0, residual(13) = -30.0;
  const LoneOutliers judged = lone_outliers(residual, place, 1.0);
  EXPECT_EQ(judged.outliers, 2);
  EXPECT_EQ(judged.in_stretches, 4);
  EXPECT_EQ(judged.weights(12), 0.0);
  EXPECT_EQ(judged.weights(13), 0.0);
  EXPECT_EQ(judged.weights.sum(), 13.0);
}

TEST(HeatTrace, KnowsTheRateAndTheLaggedTemperatureOfWhatItWasGiven) {
  HeatTrace trace{10.0, 1000.0, 2.0};
  std::vector<double> time;
  std::vector<double> temperature;
  for (double t = 0.0; t < 600.0; t += 0.5) {
    time.push_back(t);
    temperature.push_back(25.0 + (t < 300.0 ? 4e-3 * t : 1.2 - 2e-3 * (t - 300.0)));
    trace.add(t, temperature.back());
    if (t == 250.0) {
      EXPECT_NEAR(trace.rate(), 4e-3, 1e-8);
    }
  }
  EXPECT_NEAR(trace.rate(), -2e-3, 1e-8);
  const auto n = static_cast<Eigen::Index>(time.size());
  const Eigen::VectorXd lagged = lagged_temperature(
      Eigen::Map<Eigen::VectorXd>(time.data(), n), Eigen::Map<Eigen::VectorXd>(temperature.data(), n), 120.0);
  EXPECT_NEAR(trace.lagged(120.0), lagged(n - 1), 1e-9);
  EXPECT_NEAR(trace.known(), 599.5, 1e-9);
  for (double t = 600.0; t < 2000.0; t += 0.5) trace.add(t, 26.0);  // the ring goes round
  EXPECT_NEAR(trace.lagged(120.0), 26.0, 1e-3);
  EXPECT_LE(trace.known(), 1002.0);
}

TEST(LaggedTemperature, IsExactForARamp) {
  const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(7, 0.0, 3000.0);
  const Eigen::VectorXd lagged = lagged_temperature(t, 20.0 + (t.array() * 1e-3), 400.0);
  for (Eigen::Index i = 0; i < 7; ++i)
    EXPECT_NEAR(lagged(i), 20.0 + 1e-3 * (t(i) - 400.0 * (1.0 - std::exp(-t(i) / 400.0))), 1e-12);
}

TEST(CompiledThermalError, StaysWithinItsBoundOfTheModel) {
  Stage stage{11};
  stage.lag = 4e-3;
  const ThermalFit fit = identify_thermal(record(stage, 4, {-1.5e-3, 0.0, 1.5e-3}, 0.2e-6));
  CompiledThermalError compiled{fit.model, 5e-9};
  EXPECT_LE(compiled.bound(), 5e-9);
  double worst = 0.0;
  for (const double t : {26.0, 27.3, 28.9, 31.0})
    for (const double rate : {-1e-3, 0.0, 2e-3}) {
      compiled.set(t, rate);
      for (double x = -0.01; x < 0.21; x += 1.7e-3) {
        worst = std::max(worst, std::abs(compiled.value(x) - fit.model.value({x, t, rate})));
        EXPECT_NEAR(compiled.sigma(x), fit.model.sigma({x, t, rate}), 0.05 * compiled.sigma(x));
        EXPECT_EQ(compiled.inside() && x >= 0.0 && x <= 0.2, fit.model.inside({x, t, rate}));
      }
    }
  EXPECT_LE(worst, compiled.bound());
}

}  // namespace
}  // namespace invar::metrology

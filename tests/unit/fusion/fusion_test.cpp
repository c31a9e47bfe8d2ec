#include "components/fusion/fusion.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "tests/support/real_time_guard.hpp"

namespace invar::fusion {
namespace {

struct Ends final : Component {
  Output<stage::AxisFeedback> feedback{*this, "feedback"};
  Input<sensing::FusedPosition> fused{*this, "fused"};
  void step(const Tick&) noexcept override {}
};

/// A sinusoid of 100 mm read by an encoder of 1 mm and a velocity sensor with noise: the fused position must be far nearer to
/// the truth than the best that the encoder alone can give, 1 mm / sqrt(12).
TEST(Fusion, IsFarBetterThanTheEncoderAlone) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 0.002};
  Fusion::Parameters parameters;
  parameters.resolution = 1e-3;
  parameters.largest_velocity = 0.13;
  Fusion fusion{parameters};
  Ends ends;
  ASSERT_TRUE(ends.feedback.connect(*static_cast<InputPort*>(fusion.find_port("feedback"))));
  ASSERT_TRUE(static_cast<OutputPort*>(fusion.find_port("fused"))->connect(ends.fused));
  fusion.configure();
  fusion.activate();
  const double omega = 2 * std::numbers::pi / 5.0;
  double squares = 0.0;
  int count = 0;
  for (std::int64_t k = 0; k < 10'000; ++k) {
    const double t = static_cast<double>(k) * 1e-3;
    const double truth = 0.05 - 0.05 * std::cos(omega * t);
    stage::AxisFeedback sample;
    sample.position(1e-3 * std::round(truth / 1e-3));
    sample.velocity(0.05 * omega * std::sin(omega * t) + noise(random));
    ends.feedback.write(sample);
    fusion.step({Instant{k * 1'000'000}, 1e-3, static_cast<std::uint64_t>(k)});
    if (k < 1000) continue;
    const double error = ends.fused.latest()->position() - truth;
    squares += error * error;
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 0.25 * 1e-3 / std::sqrt(12.0));
}

TEST(Fusion, SaysNothingBeforeItsFirstReading) {
  Fusion::Parameters parameters;
  Fusion fusion{parameters};
  Ends ends;
  ASSERT_TRUE(static_cast<OutputPort*>(fusion.find_port("fused"))->connect(ends.fused));
  fusion.configure();
  fusion.activate();
  fusion.step({Instant{0}, 1e-3, 0});
  EXPECT_EQ(ends.fused.latest(), nullptr);
}

/// Three sensors on ports: an encoder of 0.1 mm, an analogue position sensor and a velocity sensor, at a sinusoid.
struct Rig {
  struct Ends final : Component {
    Output<sensing::AxisReading> encoder{*this, "encoder"}, analogue{*this, "analogue"},
        speed{*this, "speed"};
    Input<sensing::FusedPosition> fused{*this, "fused"};
    void step(const Tick&) noexcept override {}
  };
  static Fusion::Parameters parameters_of() {
    Fusion::Parameters p;
    p.sensors.resize(3);
    p.sensors[0].name = "speed";  // the order does not matter: positions come first
    p.sensors[0].quantity = "velocity";
    p.sensors[0].largest = 0.13;
    p.sensors[0].delay_sigma = 5e-3;
    p.sensors[1].name = "encoder";
    p.sensors[1].resolution = 1e-4;
    p.sensors[2].name = "analogue";
    p.sensors[2].noise = 5e-5;
    return p;
  }
  explicit Rig(Fusion::Parameters p = parameters_of()) : parameters{std::move(p)}, fusion{parameters} {
    const auto join = [&](OutputPort& output, const char* port) {
      EXPECT_TRUE(output.connect(*static_cast<InputPort*>(fusion.find_port(port))));
    };
    join(ends.encoder, "sensor_encoder");
    join(ends.analogue, "sensor_analogue");
    join(ends.speed, "sensor_speed");
    EXPECT_TRUE(static_cast<OutputPort*>(fusion.find_port("fused"))->connect(ends.fused));
    fusion.configure();
    fusion.activate();
  }
  static double truth(double t) { return 0.1 * (1.0 - std::cos(omega * t)); }

  /// One period; `meddle` may change or drop (false) what a sensor (0 encoder, 1 analogue, 2 speed) says.
  using Meddle = std::function<bool(int sensor, double t, sensing::AxisReading& reading)>;
  const sensing::FusedPosition& step(const Meddle& meddle = {}) {
    const double t = static_cast<double>(cycle) * 1e-3;
    const Tick tick{Instant{cycle * 1'000'000}, 1e-3, static_cast<std::uint64_t>(cycle)};
    ends.set_now(tick.now);
    fusion.set_now(tick.now);
    sensing::AxisReading r;
    r.at().time_ns(tick.now.ns);
    const auto say = [&](int sensor, Output<sensing::AxisReading>& output) {
      if (!meddle || meddle(sensor, t, r)) output.write(r);
    };
    r.position(1e-4 * std::round(truth(t) / 1e-4));
    say(0, ends.encoder);
    r.at().time_ns(tick.now.ns);
    r.position(truth(t) + 5e-5 * noise(random));
    say(1, ends.analogue);
    r.at().time_ns(tick.now.ns);
    r.position(std::nan(""));
    r.velocity(0.1 * omega * std::sin(omega * (t - lag)) + 0.005 * noise(random));
    say(2, ends.speed);
    fusion.step(tick);
    ++cycle;
    return *ends.fused.latest();
  }
  [[nodiscard]] double time() const { return static_cast<double>(cycle) * 1e-3; }

  static constexpr double omega = 2.0 * std::numbers::pi / 5.0;
  Fusion::Parameters parameters;
  Fusion fusion;
  Ends ends;
  double lag = 0.0;
  std::mt19937 random{7};
  std::normal_distribution<double> noise{0.0, 1.0};
  std::int64_t cycle = 0;
};

struct Fault {
  const char* name;
  int sensor;
  double within;  // s, after which the sensor is out
  bool (*meddle)(double since, double held, double truth, sensing::AxisReading& reading);
};

class FusionFault : public ::testing::TestWithParam<Fault> {};

TEST_P(FusionFault, LeavesInTimeWithoutAStepAndComesBack) {
  const Fault& fault = GetParam();
  for (const double at : {1.0, 1.3, 2.2}) {
    SCOPED_TRACE("fault at " + std::to_string(at) + " s");
    Rig rig;
    std::array<double, 3> held{};
    const auto meddle = [&](int sensor, double t, sensing::AxisReading& reading) {
      double& last = held[static_cast<std::size_t>(sensor)];
      const double value = sensor == 2 ? reading.velocity() : reading.position();
      if (sensor != fault.sensor || t < at || t > at + 0.8) {
        last = value;
        return true;
      }
      return fault.meddle(t - at, last, Rig::truth(t), reading);
    };
    while (rig.time() < at) rig.step(meddle);
    double before = rig.ends.fused.latest()->position();
    double out_at = -1.0;
    double squares = 0.0;
    int count = 0;
    bool back = false;
    while (rig.time() < at + 1.5) {
      const double t = rig.time();
      const auto& fused = rig.step(meddle);
      const bool live = (fused.live() >> fault.sensor & 1U) != 0U;
      if (!live && out_at < 0.0) out_at = t - at;
      // No step: from one period to the next it moves at most 0.126 mm by itself.
      EXPECT_LT(std::abs(fused.position() - before), 0.126e-3 + 0.05e-3) << "at " << t;
      before = fused.position();
      squares += std::pow(fused.position() - Rig::truth(t), 2);
      ++count;
      back = t > at + 0.8 && live;
    }
    EXPECT_GE(out_at, 0.0) << "it stayed in";
    EXPECT_LE(out_at, fault.within);
    EXPECT_LT(std::sqrt(squares / count), 0.1e-3);
    EXPECT_TRUE(back) << "it did not come back";
  }
}

bool late(double, double, double, sensing::AxisReading& reading) {
  reading.at().time_ns(reading.at().time_ns() - 30'000'000);
  return true;
}

INSTANTIATE_TEST_SUITE_P(
    All, FusionFault,
    ::testing::Values(
        Fault{"encoder_missing", 0, 0.006,
              [](double, double, double, sensing::AxisReading&) { return false; }},
        Fault{"analogue_missing", 1, 0.006,
              [](double, double, double, sensing::AxisReading&) { return false; }},
        Fault{"speed_missing", 2, 0.006, [](double, double, double, sensing::AxisReading&) { return false; }},
        Fault{"encoder_stuck", 0, 0.02,
              [](double, double held, double, sensing::AxisReading& r) { return r.position(held), true; }},
        Fault{"analogue_stuck", 1, 0.006,
              [](double, double held, double, sensing::AxisReading& r) { return r.position(held), true; }},
        Fault{"speed_stuck", 2, 0.006,
              [](double, double held, double, sensing::AxisReading& r) { return r.velocity(held), true; }},
        Fault{"speed_dead", 2, 0.006,
              [](double, double, double, sensing::AxisReading& r) { return r.velocity(0.0), true; }},
        Fault{"encoder_dead", 0, 0.006,
              [](double, double, double, sensing::AxisReading& r) { return r.position(0.0), true; }},
        Fault{"encoder_jumps", 0, 0.006,
              [](double, double, double truth,
                 sensing::AxisReading&
                     r) { return r.position(1e-4 * std::round((truth + 0.02) / 1e-4)), true; }},
        Fault{"analogue_dead", 1, 0.006,
              [](double, double, double, sensing::AxisReading& r) { return r.position(0.0), true; }},
        Fault{"analogue_jumps", 1, 0.006,
              [](double, double, double,
                 sensing::AxisReading& r) { return r.position(r.position() - 0.01), true; }},
        Fault{"speed_jumps", 2, 0.006,
              [](double, double, double,
                 sensing::AxisReading& r) { return r.velocity(r.velocity() + 0.3), true; }},
        Fault{"encoder_late", 0, 0.006, late}, Fault{"analogue_late", 1, 0.006, late},
        Fault{"speed_late", 2, 0.006, late}),
    [](const ::testing::TestParamInfo<Fault>& fault) { return std::string{fault.param.name}; });

TEST(Fusion, EstimatesHowLateTheVelocityIsAndAlignsIt) {
  for (const double lag : {0.0, 4e-3}) {
    Rig rig;
    rig.lag = lag;
    sensing::FusedPosition fused;
    while (rig.time() < 15.0) fused = rig.step();
    EXPECT_NEAR(fused.lateness()[2], lag, 0.6e-3);
    EXPECT_NEAR(fused.noise()[2], 0.005, 0.0005);  // the noise it was given
  }
}

TEST(Fusion, TakesSensorsOfOtherRates) {
  Rig rig;
  double squares = 0.0;
  int count = 0;
  const auto slower = [&](int sensor, double, sensing::AxisReading&) {
    return sensor == 0 || rig.cycle % (sensor == 1 ? 4 : 3) == 0;
  };
  while (rig.time() < 5.0) {
    const double t = rig.time();
    const auto& fused = rig.step(slower);
    if (t < 0.5) continue;
    EXPECT_EQ(fused.live(), 7U) << t;
    squares += std::pow(fused.position() - Rig::truth(t), 2);
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 0.03e-3);
}

TEST(Fusion, SwitchesOffWhatAddsLittleAndOnWhenItIsNeeded) {
  auto parameters = Rig::parameters_of();
  parameters.sensors[2].noise = 2e-3;  // tells nothing beside an encoder of 0.1 mm
  parameters.rest.least_weight = 0.05;
  parameters.rest.after = 0.3;
  parameters.rest.look_again = 2.0;
  Rig rig{parameters};
  bool rested = false;
  while (rig.time() < 1.9) rested = (rig.step().resting() & 2U) != 0U || rested;
  EXPECT_TRUE(rested);
  EXPECT_EQ(rig.ends.fused.latest()->resting(), 2U);
  const auto without_speed = [](int sensor, double, sensing::AxisReading&) { return sensor != 2; };
  while (rig.time() < 1.95) rig.step(without_speed);
  EXPECT_EQ(rig.ends.fused.latest()->resting(), 0U) << "another sensor is gone: all are needed";
}

TEST(Fusion, NeitherAllocatesNorLocksWhateverFails) {
  Rig rig;
  std::int64_t cycle = 0;
  const Rig::Meddle fails = [&](int sensor, double, sensing::AxisReading& reading) {
    if (sensor == 0) ++cycle;
    if (cycle > 500 && cycle < 800 && sensor == 2) return false;
    if (cycle > 1000 && cycle < 1300 && sensor == 0) reading.position(0.0);
    return cycle < 1500 || sensor != 1;
  };
  for (int i = 0; i < 300; ++i) rig.step(fails);
  const support::RealTimeGuard guard;
  for (int i = 0; i < 2000; ++i) rig.step(fails);
  EXPECT_EQ(guard.violations(), 0U);
}

}  // namespace
}  // namespace invar::fusion

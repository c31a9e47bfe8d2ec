// Sensors that go missing, die, stick, jump or come late leave the fusion in time and without a step, and come back; however they
// are fused.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "core/compensation/fusion_file.hpp"
#include "core/metrology/fusion/weight_identification.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/unit/fusion/fusion_rig.hpp"

namespace invar::fusion {
namespace {

using testing::Rig;

struct Fault {
  const char* name;
  int sensor;
  double within;  // s, after which the sensor is out
  bool (*meddle)(double since, double held, double truth, sensing::AxisReading& reading);
};

/// How the three sensors are fused.
enum class Method { observer, weights };
class FusionFault : public ::testing::TestWithParam<std::tuple<Fault, Method>> {
 protected:
  /// The weights of the sensors as they are, learnt from sinusoids of other periods.
  std::filesystem::path weights() const {
    std::mt19937 random{3};
    std::normal_distribution<double> normal;
    std::vector<metrology::FusionRun> runs;
    for (const double period : {3.0, 4.0, 5.0, 6.0}) {
      constexpr Eigen::Index n = 6000;
      metrology::FusionRun run{
          Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::MatrixXd(n, 2), Eigen::MatrixXd(n, 1), {}, {}};
      for (Eigen::Index i = 0; i < n; ++i) {
        const double t = 1e-3 * static_cast<double>(i), w = 2.0 * std::numbers::pi / period,
                     x = 0.1 * (1.0 - std::cos(w * t));
        run.time(i) = t;
        run.reference(i) = x;
        run.positions(i, 0) = 1e-4 * std::round(x / 1e-4);
        run.positions(i, 1) = x + 5e-5 * normal(random);
        run.velocities(i, 0) = 0.1 * w * std::sin(w * t) + 0.005 * normal(random);
      }
      runs.push_back(std::move(run));
    }
    metrology::FusionModel sensors;
    sensors.position_names = {"encoder", "analogue"};
    sensors.velocity_names = {"speed"};
    sensors.positions = {{1e-4, 0.0, 0.0, 0.0, 2e-6}, {0.0, 0.0, 0.0, 0.0, 5e-5}};
    sensors.velocities.resize(1);
    sensors.start_sigma = 1e-4;
    compensation::ModelText text{"fusion", {}};
    compensation::write_fusion(text, {"weights", false, sensors, metrology::identify_weights(runs), ""});
    text.write(folder / "weights.yaml");
    return folder / "weights.yaml";
  }
  invar::testing::TemporaryFolder folder;
};

TEST_P(FusionFault, LeavesInTimeWithoutAStepAndComesBack) {
  const auto& [fault, method] = GetParam();
  auto parameters = Rig::parameters_of();
  if (method == Method::weights) parameters.model = weights();
  for (const double at : {1.0, 1.3, 2.2}) {
    SCOPED_TRACE("fault at " + std::to_string(at) + " s");
    Rig rig{parameters};
    std::array<double, 3> held{};
    const auto meddle = [&, &fault = fault](int sensor, double t, sensing::AxisReading& reading) {
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
      // No step: from one period to the next it moves at most 0.126 mm by itself. Weights know no motion: the noise of
      // what is left, in the worst case of the analogue sensor alone, shows.
      const double noise = method == Method::observer ? 0.05e-3 : 6.0 * std::sqrt(2.0) * 5e-5;
      EXPECT_LT(std::abs(fused.position() - before), 0.126e-3 + noise) << "at " << t;
      before = fused.position();
      squares += std::pow(fused.position() - Rig::truth(t), 2);
      ++count;
      back = t > at + 0.8 && live;
    }
    EXPECT_GE(out_at, 0.0) << "it stayed in";
    EXPECT_LE(out_at, fault.within);
    EXPECT_LT(std::sqrt(squares / count), method == Method::observer ? 0.1e-3 : 0.15e-3);
    EXPECT_TRUE(back) << "it did not come back";
  }
}

bool late(double, double, double, sensing::AxisReading& reading) {
  reading.at().time_ns(reading.at().time_ns() - 30'000'000);
  return true;
}

INSTANTIATE_TEST_SUITE_P(
    All, FusionFault,
    ::testing::Combine(
        ::testing::Values(Fault{"encoder_missing", 0, 0.006,
                                [](double, double, double, sensing::AxisReading&) { return false; }},
                          Fault{"analogue_missing", 1, 0.006,
                                [](double, double, double, sensing::AxisReading&) { return false; }},
                          Fault{"speed_missing", 2, 0.006,
                                [](double, double, double, sensing::AxisReading&) { return false; }},
                          Fault{"encoder_stuck", 0, 0.02,
                                [](double, double held, double, sensing::AxisReading& r) {
                                  return r.position(held), true;
                                }},
                          Fault{"analogue_stuck", 1, 0.006,
                                [](double, double held, double, sensing::AxisReading& r) {
                                  return r.position(held), true;
                                }},
                          Fault{"speed_stuck", 2, 0.006,
                                [](double, double held, double, sensing::AxisReading& r) {
                                  return r.velocity(held), true;
                                }},
                          Fault{"speed_dead", 2, 0.006,
                                [](double, double, double,
                                   sensing::AxisReading& r) { return r.velocity(0.0), true; }},
                          Fault{"encoder_dead", 0, 0.006,
                                [](double, double, double, sensing::AxisReading& r) {
                                  return r.position(0.0), true;
                                }},
                          Fault{"encoder_jumps", 0, 0.006,
                                [](double, double, double truth, sensing::AxisReading& r) {
                                  return r.position(1e-4 * std::round((truth + 0.02) / 1e-4)), true;
                                }},
                          Fault{"analogue_dead", 1, 0.006,
                                [](double, double, double, sensing::AxisReading& r) {
                                  return r.position(0.0), true;
                                }},
                          Fault{"analogue_jumps", 1, 0.006,
                                [](double, double, double, sensing::AxisReading& r) {
                                  return r.position(r.position() - 0.01), true;
                                }},
                          Fault{"speed_jumps", 2, 0.006,
                                [](double, double, double,
                                   sensing::AxisReading& r) { return r.velocity(r.velocity() + 0.3), true; }},
                          Fault{"encoder_late", 0, 0.006, late}, Fault{"analogue_late", 1, 0.006, late},
                          Fault{"speed_late", 2, 0.006, late}),
        ::testing::Values(Method::observer, Method::weights)),
    [](const auto& one) {
      return std::string{std::get<0>(one.param).name} +
             (std::get<1>(one.param) == Method::observer ? "_observer" : "_weights");
    });

}  // namespace
}  // namespace invar::fusion

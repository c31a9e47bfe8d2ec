// Heat that does not show: a thermistor that lies, on a link that drops, at any power. The truth is the simulated slide.
#include "components/thermal/heat_watch.hpp"

#include <gmock/gmock.h>

#include <random>

#include "tests/support/heat_bench.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::thermal {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string script(const std::vector<std::string>& faults) {
  std::string text = "invar_modbus_faults: 1\nfaults:\n";
  for (const auto& fault : faults) text += "  - {" + fault + "}\n";
  return text;
}

/// The link is gone for `gap` seconds in each `every`, from `from` until `until`.
std::vector<std::string> drops(double from, double until, double every, double gap) {
  std::vector<std::string> faults;
  for (double at = from; gap > 0.0 && at < until; at += every)
    faults.push_back("at: " + std::to_string(at) + ", for: " + std::to_string(gap) + ", do: refuse");
  return faults;
}

struct Outcome {
  bool latched = false;
  double at = 0.0;       // s
  double hottest = 0.0;  // slide in truth [degC]
};

/// Until this time, or a while after the latch.
Outcome run(HeatBench& bench, double seconds) {
  Outcome outcome;
  while (bench.at().in_seconds() < seconds &&
         (!outcome.latched || bench.at().in_seconds() < outcome.at + 60.0)) {
    const bool latched = bench.cycle_once().over_temperature();
    if (latched && !outcome.latched) outcome.at = bench.at().in_seconds();
    outcome.latched = outcome.latched || latched;
    outcome.hottest = std::max(outcome.hottest, bench.true_slide.latest()->temperature());
  }
  return outcome;
}

// The reading froze, the link drops, the power is full or less: the latch comes before the heat of `within` at full power is
// in the slide, beyond where it stood or what holding power keeps it at.
struct Frozen {
  double at, every, gap;  // s
  double kp, ki;
};

TEST(HeatWatch, FrozenThermistorLatchesThroughDropsOfTheLinkAndAtAnyPower) {
  const invar::testing::TemporaryFolder folder;
  for (const Frozen& one : {Frozen{40, 60, 1, 60, 0.4},
                            {1, 60, 0, 60, 0.4},
                            {40, 20, 1, 8, 0},
                            {40, 10, 3, 3, 0.05},
                            {40, 30, 0.4, 2, 0.05}}) {
    auto faults = drops(5.0, 3000.0, one.every, one.gap);
    faults.push_back("at: " + std::to_string(one.at) +
                     ", for: 100000, do: freeze, register: slide_resistance");
    HeatBench bench{folder.write("faults.yaml", script(faults))};
    bench.heater_parameters.noise = 0.003;
    bench.thermal_parameters.setpoint = 40.0;
    bench.thermal_parameters.pid.kp = one.kp;
    bench.thermal_parameters.pid.ki = one.ki;
    bench.bring_up();
    const Outcome outcome = run(bench, 1500.0);
    const ::testing::Message what = ::testing::Message() << "frozen at " << one.at << " s, gap " << one.gap
                                                         << " s each " << one.every << " s, kp " << one.kp
                                                         << ", ki " << one.ki << ": latched at " << outcome.at
                                                         << " s, hottest " << outcome.hottest << " degC";
    std::cout << what << '\n';
    EXPECT_TRUE(outcome.latched) << what;
    // 120 W for 120 s in a slide of 910 J/K are 15.8 K, less what is lost meanwhile; it froze below 30 degC.
    EXPECT_LT(outcome.hottest, 40.0 + 0.5) << what;
  }
}

TEST(HeatWatch, ThermistorThatComesOffReadsTheRoomAndLatches) {
  HeatWatch watch;
  const HeatWatch::Settings settings{.full = 120.0};
  std::mt19937 random{7};
  std::normal_distribution<double> noise{0.0, 0.01};
  double latched = -1.0;
  for (int i = 0; i < 40000 && latched < 0.0; ++i) {
    const Instant now{static_cast<std::int64_t>(i) * 100'000'000};
    const double t = 0.1 * i;
    // Holds 40 degC with 54 W for 1000 s, falls to the room within a minute, then only noise; a second each minute is lost.
    const double true_reading = t < 1000.0 ? 40.0 : 23.0 + 17.0 * std::exp((1000.0 - t) / 15.0);
    const bool lost = std::fmod(t, 60.0) < 1.0;
    const auto reading = lost ? std::nullopt : std::optional{true_reading + noise(random)};
    EXPECT_TRUE(watch.trusts(settings, reading, now));
    const double power = lost ? 0.0 : t < 1000.0 ? 54.0 : 120.0;
    if (watch.look(settings, reading, 40.0, power, now, 0.1) != HeatWatch::Doubt::none) latched = t;
  }
  EXPECT_GT(latched, 1100.0);
  EXPECT_LT(latched, 1130.0);
}

TEST(HeatWatch, AReadingThatLeapsIsNotUsedAndLatchesWhereItStays) {
  const HeatWatch::Settings settings{.full = 120.0};
  for (const double to : {20.0, 60.0})
    for (const int cycles : {1, 10, 40}) {
      HeatWatch watch;
      bool latched = false;
      for (int i = 0; i < 200; ++i) {
        const Instant now{static_cast<std::int64_t>(i) * 100'000'000};
        const bool leapt = i >= 100 && i < 100 + cycles;
        const double reading = leapt ? to : 40.0 + 1e-3 * (i % 3);
        EXPECT_EQ(watch.trusts(settings, reading, now), !leapt || latched) << i;
        latched = latched || watch.look(settings, leapt ? std::nullopt : std::optional{reading}, 40.0, 50.0,
                                        now, 0.1) == HeatWatch::Doubt::leapt;
        if (latched) break;
      }
      EXPECT_EQ(latched, cycles > 20) << to << ' ' << cycles;
    }
}

// Nothing of a sound loop latches: cold start, regulation, changes of setpoint, drops, doors, weak heaters and heavy slides.
TEST(HeatWatch, SoundLoopsNeverLatch) {
  const auto seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random{seed};
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution{low, high}(random);
  };
  const invar::testing::TemporaryFolder folder;
  const int runs = std::getenv("INVAR_HEAT_RUNS") != nullptr ? std::atoi(std::getenv("INVAR_HEAT_RUNS")) : 2;
  for (int i = 0; i < runs; ++i) {
    HeatBench bench{
        folder.write("faults.yaml", script(drops(30.0, 3000.0, between(15.0, 90.0), between(0.0, 4.0))))};
    auto& plant = bench.heater_parameters;
    plant.slide_capacity = std::exp(between(std::log(300.0), std::log(12000.0)));
    plant.base_capacity = between(1000.0, 20000.0);
    plant.noise = random() % 3 == 0 ? 0.0 : 0.003;
    bench.thermal_parameters.pid.kp = std::exp(between(std::log(15.0), std::log(80.0)));
    bench.thermal_parameters.pid.ki = between(0.05, 0.5);
    bench.thermal_parameters.setpoint = between(24.0, 44.0);
    SCOPED_TRACE(::testing::Message()
                 << "run " << i << ": slide " << plant.slide_capacity << " J/K, base " << plant.base_capacity
                 << " J/K, kp " << bench.thermal_parameters.pid.kp << ", ki "
                 << bench.thermal_parameters.pid.ki << ", setpoint " << bench.thermal_parameters.setpoint);
    bench.bring_up();
    for (double at = 0.0; at < 3000.0; at += between(200.0, 2000.0)) {
      const Outcome outcome = run(bench, at);
      if (outcome.latched) {
        const auto said = bench.said();
        FAIL() << "latched at " << outcome.at << " s: " << (said.empty() ? "" : said.back());
      }
      bench.ask(between(23.0, 44.0));
    }
  }
}

}  // namespace
}  // namespace invar::thermal

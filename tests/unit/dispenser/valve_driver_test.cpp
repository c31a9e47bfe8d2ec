// What the valve's driver is told with each pulse - on-time, spike, hold - and how often: 60 Hz to 1 kHz.
#include <gmock/gmock.h>

#include <algorithm>

#include "core/component/registry.hpp"
#include "tests/unit/dispenser/valve_bench.hpp"

namespace invar::dispenser {
namespace {

using namespace dispensing;
using testing::Bench;

/// Points one after the other on the way, each with this on-time [ns]; 0: the valve's own.
TriggerPattern pattern_of(const std::vector<std::pair<double, std::int64_t>>& points) {
  TriggerPattern sample;
  sample.id(7);
  for (const auto& [aim, pulse_ns] : points) {
    TriggerPoint point;
    point.droplet(sample.points().size() + 1);
    point.position({aim, 0.0, 0.002});
    point.pulse_ns(pulse_ns);
    sample.points().push_back(point);
  }
  return sample;
}

TEST(ValveDriver, GetsOnTimeSpikeAndHoldWithEachPulse) {
  Bench bench;
  bench.parameters.pulse = 200e-6;
  bench.parameters.spike = {.time = 80e-6, .current = 4.5};
  bench.parameters.hold_current = 0.7;
  bench.bring_up();
  bench.pattern.write(pattern_of({{0.002, 0}, {0.003, 120'000}, {0.004, 2'000'000}, {0.005, 0}}));
  bench.send(TRIGGER_ARM);
  bench.run(150);
  std::vector<std::int64_t> on_times;
  std::int64_t before = -1;
  for (ValvePulse pulse; bench.pulses.take(pulse);) {
    on_times.push_back(pulse.pulse_ns());
    EXPECT_EQ(pulse.spike_ns(), 80'000);  // the rest of the on-time is hold
    EXPECT_EQ(pulse.spike_current(), 4.5);
    EXPECT_EQ(pulse.hold_current(), 0.7);
    EXPECT_GT(pulse.open_ns(), before);
    before = pulse.open_ns();
  }
  EXPECT_THAT(on_times, ::testing::ElementsAre(200'000, 120'000, 2'000'000, 200'000));
  std::vector<std::int64_t> reported;
  for (const DropletJetted& one : bench.all_jetted()) reported.push_back(one.pulse_ns());
  EXPECT_EQ(reported, on_times);
}

TEST(ValveDriver, IsGivenNoOnTimeOutsideThoseAtWhichTheValveWorks) {
  Bench bench;
  bench.bring_up();
  bench.pattern.write(
      pattern_of({{0.002, 119'999}, {0.003, 120'000}, {0.004, 2'000'000}, {0.005, 2'000'001}, {0.006, -5}}));
  bench.send(TRIGGER_ARM);
  bench.run(200);
  std::vector<std::uint64_t> jetted;
  for (const DropletJetted& one : bench.all_jetted()) jetted.push_back(one.droplet());
  EXPECT_THAT(jetted, ::testing::ElementsAre(2U, 3U));
  EXPECT_THAT(bench.reasons(), ::testing::ElementsAre(REFUSED_PULSE, REFUSED_PULSE, REFUSED_PULSE));
}

/// How many of the points of one rate are jetted while the driver takes at most another.
struct Train {
  std::size_t points, jetted, too_fast;
};
Train train(double rate, double most_rate) {
  Bench bench;
  bench.parameters.most_rate = most_rate;
  bench.bring_up();
  std::vector<double> aims;  // at 50 mm/s
  for (double aim = 0.001; aim < 0.026; aim += 0.05 / rate) aims.push_back(aim);
  bench.load(aims, 0.0093);
  bench.run(560);
  std::int64_t before = 0;
  for (const DropletJetted& one : bench.all_jetted()) {
    const std::int64_t at = one.at().time_ns();
    if (before != 0) {
      EXPECT_GE(static_cast<double>(at - before), 0.999e9 / most_rate) << rate << " Hz";
    }
    before = at;
  }
  const auto reasons = bench.reasons();
  EXPECT_THAT(reasons, ::testing::Each(REFUSED_TOO_FAST)) << rate << " Hz";
  return {aims.size(), bench.state.latest()->jetted(), reasons.size()};
}

TEST(ValveDriver, JetsEveryDropletUpToItsRateAndNoneSoonerAfterTheLast) {
  for (const double most_rate : {60.0, 437.0, 1000.0}) {
    for (const double share : {0.2, 0.99, 1.0}) {
      const Train kept = train(share * most_rate, most_rate);
      EXPECT_EQ(kept.jetted, kept.points) << share << " of " << most_rate << " Hz";
    }
    // A droplet due a fiftieth too soon is refused, the one behind it is not.
    const Train beyond = train(1.02 * most_rate, most_rate);
    EXPECT_EQ(beyond.jetted, (beyond.points + 1) / 2) << most_rate << " Hz";
    EXPECT_EQ(beyond.too_fast, beyond.points / 2) << most_rate << " Hz";
  }
}

TEST(ValveDriver, IsDescribedWithinSixtyHertzAndOneKilohertz) {
  Registry registry;
  registry.add<Valve>("valve", "");
  const auto faults_of = [&](const std::string& text) {
    const auto yaml = config::Yaml::parse(text, "cell.yaml");
    (void)registry.prepare("valve", yaml.root(), {});
    std::string lines;
    for (const Fault& fault : yaml.faults()) lines += fault.line() + "\n";
    return lines;
  };
  EXPECT_EQ(faults_of("most_rate: 60\n"), "");
  EXPECT_EQ(faults_of("most_rate: {value: 1, unit: kHz}\n"), "");
  for (const char* wrong : {"59.9", "1000.1", "-60"})
    EXPECT_THAT(faults_of(std::string{"most_rate: "} + wrong + "\n"),
                ::testing::AllOf(::testing::HasSubstr("cell.yaml:1: most_rate"), ::testing::HasSubstr("60"),
                                 ::testing::HasSubstr("1000")));
  EXPECT_THAT(faults_of("spike: {time: 130.0e-6}\n"),
              ::testing::HasSubstr("longer than the shortest of `pulses`"));
  EXPECT_THAT(faults_of("pulse: 100.0e-6\n"), ::testing::HasSubstr("is outside `pulses`"));
}

}  // namespace
}  // namespace invar::dispenser

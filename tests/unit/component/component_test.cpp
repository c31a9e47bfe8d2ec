#include "core/component/component.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <thread>

#include "core/component/registry.hpp"

namespace invar {
namespace {

struct Position {
  std::int64_t stamp = 0;
  double position = 0.0;
};

/// Smooths one position signal with a first-order low-pass.
class LowPass final : public Component {
 public:
  struct Parameters {
    double cutoff = 100.0;
    void describe(auto& p) { p(cutoff, "cutoff", "Hz", Range{0.1, 450.0}, "-3 dB corner", while_running); }
  };
  Input<Position> raw{*this, "raw"};
  Output<Position> smooth{*this, "smooth"};

  explicit LowPass(const Parameters& parameters) : parameters_{parameters} {}
  void activate() override { primed_ = false; }
  void step(const Tick& tick) noexcept override {
    const Position* u = raw.latest();
    if (u == nullptr) return;
    if (!primed_) y_ = u->position;
    primed_ = true;
    y_ -= std::expm1(-2.0 * std::numbers::pi * parameters_.cutoff * tick.period) * (u->position - y_);
    smooth.write({u->stamp, y_});
  }

 private:
  const Parameters& parameters_;
  double y_ = 0.0;
  bool primed_ = false;
};

struct Probe final : Component {
  Inbox<Position> all{*this, "all"};
  Input<Position> newest{*this, "newest"};
  void step(const Tick&) noexcept override {}
};

Registry registry() {
  Registry r;
  r.add<LowPass>("low_pass", "first-order low-pass");
  return r;
}

struct Mistaken final : Component {
  struct Parameters {
    double speed = 1.0;
    void describe(auto& p) { p(speed, "speed", "m/sec", Range{}, "in what is no unit"); }
  };
  explicit Mistaken(const Parameters&) {}
  void step(const Tick&) noexcept override {}
};

TEST(Registry, NamesTheTypeWhoseUnitDoesNotExist) {
  Registry types;
  types.add<Mistaken>("mistaken", "a type with a fault");
  const auto yaml = config::Yaml::parse("type: mistaken\nspeed: {value: 1, unit: m/s}\n", "a.yaml");
  (void)types.prepare("mistaken", yaml.root(), {});
  ASSERT_EQ(yaml.faults().size(), 1U);
  EXPECT_EQ(
      yaml.faults().front().line(),
      "a.yaml:1: type: the component type `mistaken` is faulty: it describes `speed` in `m/sec`, which is no "
      "unit; mend the unit in its `describe`, and build its plugin again");
}

TEST(LowPass, FollowsTheStepResponseOfAFirstOrderLag) {
  const auto yaml = config::Yaml::parse("cutoff: 10\n", "a.yaml");
  const auto prepared = registry().prepare("low_pass", yaml.root(), {});
  yaml.finish();
  const auto component = prepared.make();
  auto& low_pass = dynamic_cast<LowPass&>(*component);
  Probe probe;
  ASSERT_TRUE(low_pass.smooth.connect(probe.newest));
  low_pass.activate();
  low_pass.raw.accept({0, 0.0}, Instant{0});
  low_pass.step({Instant{0}, 1e-3, 0});
  low_pass.raw.accept({0, 1.0}, Instant{0});
  for (int k = 1; k <= 50; ++k) {
    low_pass.step({Instant{k * 1'000'000}, 1e-3, static_cast<std::uint64_t>(k)});
    EXPECT_NEAR(probe.newest.latest()->position, 1.0 - std::exp(-2.0 * std::numbers::pi * 10.0 * 1e-3 * k),
                1e-12);
  }
}

TEST(Parameters, AreListedWithUnitBoundsDefaultAndAHandle) {
  const auto yaml = config::Yaml::parse("cutoff: 10\n", "a.yaml");
  const auto prepared = registry().prepare("low_pass", yaml.root(), {});
  ASSERT_EQ(prepared.infos.size(), 1U);
  const ParameterInfo& info = prepared.infos.front();
  EXPECT_EQ(info.path, "cutoff");
  EXPECT_EQ(info.unit, "Hz");
  EXPECT_TRUE(info.changeable);
  ASSERT_NE(info.number, nullptr);
  EXPECT_DOUBLE_EQ(*info.number, 10.0);
}

TEST(Parameters, OutOfBoundsOrUnknownAreFaults) {
  const auto yaml = config::Yaml::parse("cutoff: 1000\ncutof: 3\n", "a.yaml");
  (void)registry().prepare("low_pass", yaml.root(), {});
  EXPECT_EQ(yaml.faults().size(), 2U);
}

/// A band whose ends must not cross, of which one may change while running.
struct Band final : Component {
  struct Parameters {
    double lower = 1.0, upper = 2.0;
    void describe(auto& p) {
      p(lower, "lower", "m", Range{0.0, 10.0}, "", while_running);
      p(upper, "upper", "m", Range{0.0, 10.0}, "");
      if constexpr (requires { p.node(); })
        if (lower >= upper) p.node()["lower"].fault("is not below `upper`", "lower it");
    }
  };
  explicit Band(const Parameters&) {}
  void step(const Tick&) noexcept override {}
};

TEST(Parameters, AChangeIsCheckedAgainstTheOthers) {
  Registry r;
  r.add<Band>("band", "");
  const auto yaml = config::Yaml::parse("upper: 3\n", "a.yaml");
  const auto prepared = r.prepare("band", yaml.root(), {});
  yaml.finish();
  EXPECT_EQ(prepared.check(std::vector{2.9, 0.0}), "") << "the upper end is the file's: it may not change";
  EXPECT_EQ(prepared.check(std::vector{3.0, 0.0}), "is not below `upper`; lower it");
}

TEST(Ports, InboxKeepsEverySampleInOrderAndCountsWhatDoesNotFit) {
  LowPass::Parameters parameters;
  LowPass source{parameters};
  Probe probe;
  ASSERT_TRUE(source.smooth.connect(probe.all));
  for (int i = 0; i < 70; ++i) source.smooth.write({i, 0.0});
  Position sample;
  for (int i = 0; i < 64; ++i) {
    ASSERT_TRUE(probe.all.take(sample));
    EXPECT_EQ(sample.stamp, i);
  }
  EXPECT_FALSE(probe.all.take(sample));
  EXPECT_EQ(probe.all.lost(), 6U);
}

/// Looks twice at an input that is fed between the two looks, as by the thread of a transport.
struct TwoLooks final : Component {
  Input<Position> newest{*this, "newest"};
  std::int64_t first = 0, second = 0, held = 0;
  void step(const Tick& tick) noexcept override {
    const Position* before = newest.latest();
    first = before->stamp;
    for (int i = 1; i <= 3; ++i) newest.accept({first + i, 0.0}, tick.now);
    second = newest.latest()->stamp;
    held = before->stamp;
  }
};

TEST(Ports, AnInputKeepsItsSampleThroughoutAStep) {
  TwoLooks looking;
  looking.newest.accept({10, 0.0}, {});
  looking.run_step({});
  EXPECT_EQ(looking.first, 10);
  EXPECT_EQ(looking.second, 10);
  EXPECT_EQ(looking.held, 10);
  looking.run_step({});
  EXPECT_EQ(looking.first, 13) << "the next step sees what came since";
  EXPECT_EQ(looking.second, 13);
  EXPECT_EQ(looking.newest.latest()->stamp, 16) << "outside of a step each look sees the newest";
  looking.newest.accept({20, 0.0}, {});
  EXPECT_EQ(looking.newest.latest()->stamp, 20);
}

TEST(Ports, SafeValueIsWhatWasDeclared) {
  LowPass::Parameters parameters;
  LowPass source{parameters};
  Probe probe;
  ASSERT_TRUE(source.smooth.connect(probe.newest));
  EXPECT_EQ(probe.newest.latest(), nullptr);
  source.smooth.write_safe_value();
  EXPECT_EQ(probe.newest.latest(), nullptr);
  source.smooth.set_safe_value({7, 0.5});
  source.smooth.write_safe_value();
  EXPECT_EQ(probe.newest.latest()->stamp, 7);
}

TEST(Latest, ReaderNeverSeesATornOrAnOlderValue) {
  struct Pair {
    std::uint64_t a = 0;
    std::uint64_t b = 0;
  };
  Latest<Pair> channel;
  std::atomic<bool> done{false};
  std::thread writer{[&] {
    for (std::uint64_t i = 1; i <= 200'000; ++i) channel.write({i, ~i});
    done = true;
  }};
  std::uint64_t last = 0;
  while (!done || last < 200'000) {
    const Pair* pair = channel.read();
    if (pair == nullptr) continue;
    ASSERT_EQ(pair->b, ~pair->a);
    ASSERT_GE(pair->a, last);
    last = pair->a;
  }
  writer.join();
}

}  // namespace
}  // namespace invar

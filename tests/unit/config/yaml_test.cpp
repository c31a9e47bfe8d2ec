#include "core/config/yaml.hpp"

#include <gmock/gmock.h>

namespace invar::config {
namespace {

using ::testing::HasSubstr;

std::string only_fault(const Yaml& yaml) {
  const auto faults = yaml.faults();
  EXPECT_EQ(faults.size(), 1U);
  return faults.empty() ? "" : faults.front().line();
}

TEST(Yaml, ReadsNumbersInTheUnitThatIsAsked) {
  const auto yaml = Yaml::parse("mass: {value: 3200, unit: g, sigma: 60}\ntravel: 0.2\n", "m.yaml");
  const auto mass = yaml.root().required("mass").as_quantity("kg");
  EXPECT_DOUBLE_EQ(mass.value, 3.2);
  EXPECT_DOUBLE_EQ(mass.sigma.value(), 0.06);
  EXPECT_DOUBLE_EQ(yaml.root().number("travel", "m"), 0.2);
  yaml.finish();
}

TEST(Yaml, NamesFileLineKeyFaultAndMend) {
  const auto yaml = Yaml::parse("a: 1\nloop:\n  rate: 1200\n", "cell.yaml");
  (void)yaml.root()["a"];
  (void)yaml.root()["loop"].number("rate", "Hz", {1, 1000});
  EXPECT_EQ(only_fault(yaml),
            "cell.yaml:3: loop.rate: `1200` is out of range; it must be between 1 and 1000 Hz");
}

TEST(Yaml, SuggestsTheKeyThatWasMeant) {
  const auto yaml = Yaml::parse("interval: 1\nintervall: 2\n", "a.yaml");
  (void)yaml.root()["interval"];
  EXPECT_EQ(only_fault(yaml), "a.yaml:2: intervall: unknown key; did you mean `interval`?");
}

TEST(Yaml, RefusesAKeyThatStandsTwiceAtAnyDepth) {
  const auto yaml = Yaml::parse("loop:\n  rate: 500\n  rate: 100\n", "a.yaml");
  (void)yaml.root()["loop"].number("rate", "Hz");
  EXPECT_EQ(only_fault(yaml), "a.yaml:3: loop.rate: stands twice; keep one of them");
}

TEST(Yaml, SaysHowAUnitIsWritten) {
  const auto pure = Yaml::parse("share: {value: 2, unit: mm}\n", "a.yaml");
  (void)pure.root().number("share", "");
  EXPECT_EQ(
      only_fault(pure),
      "a.yaml:1: share.unit: `mm` does not measure the same as a number without unit; leave the unit out");
  const auto joined = Yaml::parse("way: 2 mm\n", "a.yaml");
  (void)joined.root().number("way", "m");
  EXPECT_EQ(only_fault(joined),
            "a.yaml:1: way: `2 mm` is not a number; write a number in m, or {value: ..., unit: ...}");
}

TEST(Yaml, FindsAllFaultsInOnePass) {
  const auto yaml = Yaml::parse("x: one\ny: {value: 2, unit: kg}\nz: true\n", "a.yaml");
  (void)yaml.root().number("x", "m");
  (void)yaml.root().number("y", "m");
  (void)yaml.root().number("missing", "m");
  EXPECT_EQ(yaml.faults().size(), 4U);  // the three, and the key `z` that nobody asked for
  EXPECT_THROW(yaml.finish(), InputError);
}

TEST(Yaml, RefusesWhatIsNoYaml) {
  for (const char* text : {"a: [1, 2", "just a text", "- 1\n- 2\n", ""})
    EXPECT_THROW(Yaml::parse(text, "bad.yaml"), InputError) << text;
  EXPECT_THROW(Yaml::load("does-not-exist.yaml"), InputError);
}

TEST(Yaml, RefusesNumbersThatAreNotFinite) {
  const auto yaml = Yaml::parse("x: .nan\n", "a.yaml");
  (void)yaml.root().number("x", "m");
  EXPECT_THAT(only_fault(yaml), HasSubstr("not finite"));
}

}  // namespace
}  // namespace invar::config

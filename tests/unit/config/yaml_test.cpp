#include "core/config/yaml.hpp"
#include "tests/support/fault_of.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>
#include <future>

#include "core/base/temporary_folder.hpp"

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

TEST(Yaml, TakesAnEmptyUnitForAPureNumber) {
  const auto yaml = Yaml::parse("gain: {value: 0.8, unit: \"\", sigma: 0.1}\n", "m.yaml");
  for (const auto* unit : {"", "1"}) {
    const auto gain = yaml.root().required("gain").as_quantity(unit);
    EXPECT_EQ(gain.value, 0.8);
    EXPECT_EQ(gain.sigma, 0.1);
  }
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

TEST(Yaml, AMisspeltKeyIsOneFaultAndNotAMissingOneBesideIt) {
  const auto yaml = Yaml::parse("loop:\n  rat: 500\n", "a.yaml");
  (void)yaml.root()["loop"].number("rate", "Hz");
  EXPECT_EQ(only_fault(yaml), "a.yaml:2: loop.rat: unknown key; did you mean `rate`?");
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

std::string refusal(const std::string& text) {
  try {
    (void)Yaml::parse(text, "a.yaml");
  } catch (const InputError& error) {
    return error.faults().size() == 1 ? error.faults().front().line() : "more than one fault";
  }
  return "";
}

TEST(Yaml, TellsAnOpenQuoteWhereItOpens) {
  const std::string expected = "a.yaml:2: a quote is not closed; close it on this line";
  EXPECT_EQ(refusal("a: 1\nb: \"one\nc: 2\n"), expected);
  EXPECT_EQ(refusal("a: 1\nb: 'one\nc: 2\nd: '\n"), expected);
  EXPECT_EQ(refusal("a: 1\nb: \"one\nc: \"two\"\n"), expected);
  EXPECT_EQ(refusal("a: it's\nb: \"a text\n  of two lines\"\nc: 'it''s' # don't\n"), "");
}

TEST(Yaml, RefusesASecondDocument) {
  EXPECT_THAT(refusal("a: 1\n---\nb: 2\n"), HasSubstr("a.yaml:3: a second document begins here"));
  EXPECT_EQ(refusal("---\na: 1\n...\n"), "");
}

TEST(Yaml, RefusesAKeyWithoutValueAndOneThatIsNoWord) {
  const auto empty = Yaml::parse("a: 1\nmass:\n", "a.yaml");
  (void)empty.root().number("a", "");
  EXPECT_DOUBLE_EQ(empty.root().number("mass", "kg", {}, 3.0), 3.0);
  EXPECT_EQ(only_fault(empty), "a.yaml:2: mass: has no value; write one behind the colon, or remove the key");
  const auto none = Yaml::parse("a: 1\n~: 2\n", "a.yaml");
  (void)none.root().number("a", "");
  EXPECT_EQ(only_fault(none), "a.yaml:2: ~: is no key; write a word before the colon");
}

TEST(Yaml, RefusesAScalarWhereAListOrAMapStands) {
  const auto yaml = Yaml::parse("list: 7\nmap: 8\n", "a.yaml");
  EXPECT_TRUE(yaml.root()["list"].list().empty());
  EXPECT_TRUE(yaml.root()["list"].list().empty());  // told once
  EXPECT_FALSE(yaml.root()["map"].has("key"));
  ASSERT_EQ(yaml.faults().size(), 2U);
  EXPECT_THAT(yaml.faults()[0].line(), HasSubstr("a.yaml:1: list: a list is expected here"));
  EXPECT_THAT(yaml.faults()[1].line(), HasSubstr("a.yaml:2: map: a map is expected here"));
}

TEST(Yaml, ShowsTheConvertedValueAndStopsAtAWrongUnit) {
  const auto fast = Yaml::parse("v: {value: 50, unit: km/s}\n", "a.yaml");
  (void)fast.root().number("v", "m/s", {0, 10});
  EXPECT_EQ(only_fault(fast),
            "a.yaml:1: v.value: `50 km/s` = 50000 m/s is out of range; it must be between 0 and 10 m/s");
  const auto wrong = Yaml::parse("v: {value: 50, unit: m/sec, sigma: 1}\n", "a.yaml");
  (void)wrong.root().number("v", "m/s", {0, 10});
  EXPECT_EQ(only_fault(wrong), "a.yaml:1: v.unit: `m/sec` is no unit; write it in m/s");
}

TEST(Yaml, SaysHowAListAndAWholeNumberAreWrittenThatHaveOneUnit) {
  const auto range = Yaml::parse("v: {value: [0, 200], unit: mm, sigma: 1}\n", "a.yaml");
  (void)range.root()["v"].as_range("m");
  EXPECT_EQ(only_fault(range),
            "a.yaml:1: v: a range is expected here; write [low, high] in m, or "
            "[{value: 0, unit: mm}, {value: 200, unit: mm}]");
  const auto right = Yaml::parse("v: [{value: 0, unit: mm}, {value: 200, unit: mm}]\n", "a.yaml");
  EXPECT_DOUBLE_EQ(right.root()["v"].as_range("m").upper, 0.2);  // the form that the message names
  EXPECT_TRUE(right.faults().empty());
  const auto list = Yaml::parse("v: {value: 7}\n", "a.yaml");
  (void)list.root()["v"].as_numbers("m");
  EXPECT_EQ(only_fault(list), "a.yaml:1: v: a list of numbers is expected here; write [1, 2, 3] in m");
  const auto pure = Yaml::parse("v: 7\n", "a.yaml");
  (void)pure.root()["v"].as_numbers("");
  EXPECT_EQ(only_fault(pure), "a.yaml:1: v: a list of numbers is expected here; write [1, 2, 3]");
  const auto count = Yaml::parse("v: {value: 50, unit: ms}\n", "a.yaml");
  (void)count.root().integer("v", 1, 100);
  EXPECT_EQ(only_fault(count), "a.yaml:1: v: a whole number has no unit; write 50");
}

TEST(Yaml, AnAliasMayNeitherHoldItselfNorRepeatAPartWithoutEnd) {
  const auto fault = [](const std::string& text) {
    return invar::testing::fault_of([&] { (void)Yaml::parse(text, "a.yaml"); });
  };
  EXPECT_THAT(fault("a: 1\nnotes: &n\n  - *n\n"),
              HasSubstr("a.yaml:3: an alias stands within what it names"));
  std::string bomb = "a0: &a0 [1, 2]\n";
  for (int i = 1; i < 40; ++i) {
    const std::string below = "*a" + std::to_string(i - 1), name = "a" + std::to_string(i);
    bomb += name + ": &" + name + " [" + below + ", " + below + "]\n";
  }
  EXPECT_THAT(fault(bomb), HasSubstr("a.yaml:17: holds more than 400000 values"));
}

TEST(Yaml, ShortensAVeryLongWord) {
  const auto yaml = Yaml::parse("v: " + std::string(500, 'x') + "\n", "a.yaml");
  (void)yaml.root().number("v", "");
  EXPECT_EQ(only_fault(yaml),
            "a.yaml:1: v: `" + std::string(57, 'x') + "...` is not a number; write a number");
}

TEST(Yaml, RefusesNumbersThatAreNotFinite) {
  const auto yaml = Yaml::parse("x: .nan\n", "a.yaml");
  (void)yaml.root().number("x", "m");
  EXPECT_THAT(only_fault(yaml), HasSubstr("not finite"));
}

TEST(Yaml, DoesNotWaitForAPipeIntoWhichNobodyWrites) {
  const TemporaryFolder folder{"yaml"};
  const auto pipe = folder / "model.yaml";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  auto said = std::async(std::launch::async, [&]() -> std::string {
    try {
      return "accepted " + Yaml::load(pipe).root().key();
    } catch (const InputError& error) {
      return error.what();
    }
  });
  if (said.wait_for(std::chrono::seconds{60}) != std::future_status::ready) {
    std::ofstream{pipe} << "a: 1\n";  // ends the wait
    FAIL() << "waits without end";
  }
  EXPECT_THAT(said.get(), HasSubstr("model.yaml: is a pipe into which nobody has written; name a YAML file"));
}

}  // namespace
}  // namespace invar::config

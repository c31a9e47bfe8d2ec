// A YAML file is refused in one line, and soon, where it is larger than any file that is meant for us.
#include <gmock/gmock.h>

#include "core/base/limits.hpp"
#include "core/config/yaml.hpp"
#include "tests/support/fault_of.hpp"

namespace invar::config {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string refusal(const std::string& text) {
  try {
    (void)Yaml::parse(text, "f.yaml");
  } catch (const InputError& error) {
    EXPECT_EQ(error.faults().size(), 1u);
    return error.what();
  }
  return "taken";
}

TEST(YamlBounds, AliasesCountWithAllThatTheyStandFor) {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + before;
    for (int k = 1; k < 10; ++k) bomb += ", " + before;
    bomb += "]\n";
  }
  EXPECT_THAT(refusal(bomb), AllOf(StartsWith("f.yaml:6: "), HasSubstr("holds more than 400000 values")));
  EXPECT_EQ(refusal("base: &b {rate: 10}\nother: *b\n"), "taken");
}

TEST(YamlBounds, AreOfDepthCountSizeAndText) {
  EXPECT_THAT(refusal("a: " + std::string(33, '[') + std::string(33, ']')),
              HasSubstr("nested more than 32 deep"));
  EXPECT_THAT(refusal("a: " + std::string(100'000, '[')), HasSubstr("f.yaml:1: "));
  EXPECT_THAT(refusal("a: [" + std::string(900'000, ',') + "]"), HasSubstr("f.yaml:1: "));
  std::string many = "a: [1";
  for (int i = 0; i < 400'000; ++i) many += ",1";
  EXPECT_THAT(refusal(many + "]"), HasSubstr("holds more than 400000 values"));
  EXPECT_THAT(refusal("a: " + std::string(limits::yaml_bytes, 'x')),
              HasSubstr("f.yaml: has more than 16 MiB"));
  EXPECT_THAT(refusal("a: " + std::string(70'000, 'x')), HasSubstr("a text has 70000 bytes"));
  std::string long_key(300, 'k');
  long_key += ": 1";
  EXPECT_THAT(refusal(long_key), HasSubstr("has 300 bytes"));
}

TEST(YamlBounds, NoTextSteersATerminal) {
  EXPECT_THAT(refusal("a: 1\nb: \"\\e[31m\""),
              StartsWith("f.yaml:2: `\\x1b[31m` has the control character U+001b at byte 1"));
  EXPECT_THAT(refusal("\"a\\nb\": 1"), HasSubstr("key `a\\x0ab` has the control character U+000a"));
  EXPECT_THAT(refusal("a: \"\\0\""), HasSubstr("U+0000"));
  EXPECT_THAT(refusal("a: \"x\\u202Ey\""), HasSubstr("U+202e"));
  EXPECT_EQ(refusal("\"T [\\u00B0C]\": \"`x` $(y) <b> 'z'\""), "taken");
}

TEST(YamlBounds, ATextIsOneLineHoweverItIsFolded) {
  const auto yaml = Yaml::parse("a: |\n  one\n  two\nb: \"x\\ty\"\n", "f.yaml");
  EXPECT_EQ(yaml.root().text("a"), "one two");
  EXPECT_EQ(yaml.root().text("b"), "x y");
}

TEST(YamlBounds, AHundredThousandWrongEntriesAreTwentyLinesAndSoonTold) {
  std::string text = "a: [x";
  for (int i = 1; i < 100'000; ++i) text += ",x";
  const auto yaml = Yaml::parse(text + "]", "f.yaml");
  (void)yaml.root()["a"].as_numbers("m");
  EXPECT_EQ(yaml.fault_count(), 100'000u);
  const auto faults = yaml.faults();
  ASSERT_EQ(faults.size(), limits::faults_of_a_kind + 1);
  EXPECT_EQ(faults.back().what, "`x` is not a number (and 99979 more of the kind)");
}

TEST(YamlBounds, AHundredThousandUnknownKeysAreTwentyLines) {
  std::string text = "known: 1\n";
  for (int i = 0; i < 100'000; ++i) text += "k" + std::to_string(i) + ": 1\n";
  const auto yaml = Yaml::parse(text, "f.yaml");
  (void)yaml.root().integer("known", 1, 1);
  EXPECT_EQ(yaml.faults().size(), limits::faults_of_a_kind + 1);
  EXPECT_EQ(yaml.root().map().size(), 100'001u);
}

}  // namespace
}  // namespace invar::config

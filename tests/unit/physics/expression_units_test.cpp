// Units of formulas against dimensional analysis by hand.
#include "core/physics/expression_units.hpp"

#include <gmock/gmock.h>

namespace invar::physics {
namespace {

using ::testing::HasSubstr;

/// What clashes; "none".
std::string clash(const std::string& formula, const std::map<std::string, std::string>& units,
                  const std::string& result = "") {
  UnitsOfNames named;
  std::vector<std::string> names;
  for (const auto& [name, unit] : units) {
    names.push_back(name);
    if (!unit.empty()) named[name] = {unit, *parse_unit(unit)};
  }
  std::optional<NamedUnit> of_result;
  if (!result.empty()) of_result = NamedUnit{result, *parse_unit(result)};
  const auto found = clash_of_units(formula, named, names, of_result);
  return found ? (found->is_size ? "size: " : "kind: ") + found->what : "none";
}

TEST(UnitsOfFormulas, WhatGoesTogetherIsLeftAlone) {
  const std::map<std::string, std::string> motor{{"u", "V"},     {"i", "A"},     {"R", "ohm"}, {"L", "mH"},
                                                 {"k", "N m/A"}, {"w", "rad/s"}, {"e", "V s"}};
  EXPECT_EQ(clash("(u - R*i - e*w)/(L*1000)", motor), "none");
  EXPECT_EQ(clash("k*i*w", motor, "W"), "none");
  EXPECT_EQ(clash("if(u > 0, u, R*i)", motor, "V"), "none");
  EXPECT_EQ(clash("max(u, 0) + min(u, R*i, 3)", motor, "V"), "none");
  EXPECT_EQ(clash("u*abs(u)/R", motor, "W"), "none");
  EXPECT_EQ(clash("sqrt(u^2)", motor, "V"), "none");
  EXPECT_EQ(clash("sign(w)*u", motor, "V"), "none");
  EXPECT_EQ(clash("u^-1", motor, "1/V"), "none");
}

TEST(UnitsOfFormulas, ANumberMayHaveAnyUnit) {
  EXPECT_EQ(clash("9.81*sin(q)", {{"q", "rad"}}, "m/s2"), "none");
  EXPECT_EQ(clash("x + 3", {{"x", "mm"}}, "mm"), "none");
  EXPECT_EQ(clash("2*a + b", {{"a", "V"}, {"b", "N"}}), "none");
  EXPECT_EQ(clash("a*c + b", {{"a", "V"}, {"b", "N"}, {"c", ""}}), "none");
}

TEST(UnitsOfFormulas, ASetThatIsNotSiGoesTogetherToo) {
  const std::map<std::string, std::string> tank{{"q", "mL/s"}, {"A", "cm2"}, {"h", "cm"}, {"a", "cm^2.5/s"}};
  EXPECT_EQ(clash("(q - a*sqrt(h))/A", tank, "cm/s"), "none");
  EXPECT_THAT(clash("(q - a*sqrt(h))/A", tank, "m/s"), HasSubstr("counts in 0.01 of the unit of m/s"));
}

TEST(UnitsOfFormulas, SizesAndKindsThatClashAreTold) {
  EXPECT_EQ(clash("a + b", {{"a", "mm"}, {"b", "m"}}),
            "size: `a` [mm] counts in 0.001 of the unit of `b` [m], beside which it stands");
  EXPECT_THAT(clash("a*c - b", {{"a", "N"}, {"b", "W"}, {"c", "m"}}),
              HasSubstr("kind: the combination of `a` [N], `c` [m] measures something else than `b` [W]"));
  EXPECT_THAT(clash("sin(q)", {{"q", "deg"}}), HasSubstr("size: `q` [deg] counts in 0.0174533"));
  EXPECT_THAT(clash("exp(-t/tau)", {{"t", "s"}, {"tau", "min"}}), HasSubstr("size: "));
  EXPECT_THAT(clash("exp(-t/tau)", {{"t", "s"}, {"tau", "V"}}), HasSubstr("kind: "));
  EXPECT_THAT(clash("a < b", {{"a", "V"}, {"b", "mV"}}), HasSubstr("size: "));
  EXPECT_THAT(clash("if(c > 0, a, b)", {{"a", "V"}, {"b", "mV"}, {"c", "s"}}), HasSubstr("size: "));
  EXPECT_THAT(clash("2^a", {{"a", "V"}}), HasSubstr("an exponent"));
  EXPECT_THAT(clash("a*b", {{"a", "V"}, {"b", "A"}}, "N"), HasSubstr("kind: "));
}

TEST(UnitsOfFormulas, CountsAnglesAndTemperaturesAreToldFromNothing) {
  EXPECT_EQ(clash("n/t + f", {{"n", "count"}, {"t", "s"}, {"f", "Hz"}}), "none");
  EXPECT_EQ(clash("k*q + b*w", {{"k", "N m/rad"}, {"q", "rad"}, {"b", "N m s"}, {"w", "rad/s"}}, "N m"),
            "none");
  EXPECT_EQ(clash("g*(T - a)", {{"g", "W/K"}, {"T", "degC"}, {"a", "K"}}, "W"), "none");
}

}  // namespace
}  // namespace invar::physics

#include "core/base/unit.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace invar {
namespace {

double convert(std::string_view from, std::string_view to, double value) {
  const auto c = conversion(from, to);
  EXPECT_TRUE(c.has_value()) << from << " -> " << to;
  return c ? (*c)(value) : 0.0;
}

TEST(Unit, ConvertsBetweenUnitsOfOneQuantity) {
  EXPECT_DOUBLE_EQ(convert("mm", "m", 12.5), 0.0125);
  EXPECT_DOUBLE_EQ(convert("um", "m", 1.0), 1e-6);
  EXPECT_DOUBLE_EQ(convert("arcsec", "rad", 1.0), std::numbers::pi / 648000);
  EXPECT_DOUBLE_EQ(convert("kN", "N", 2.0), 2000.0);
  EXPECT_DOUBLE_EQ(convert("psi", "Pa", 1.0), 6894.757293168361);
  EXPECT_DOUBLE_EQ(convert("hPa", "Pa", 1.0), 100.0);
}

TEST(Unit, TemperaturesCarryTheirOffset) {
  EXPECT_NEAR(convert("K", "degC", 300.0), 26.85, 1e-12);
  EXPECT_NEAR(convert("degC", "K", 0.0), 273.15, 1e-12);
  EXPECT_NEAR(convert("degF", "degC", 212.0), 100.0, 1e-12);
  EXPECT_DOUBLE_EQ(convert("W/K", "W/degC", 3.0), 3.0);
}

TEST(Unit, ReadsTheSignsThatPeopleWrite) {
  EXPECT_NEAR(convert("\u00B0C", "K", 0.0), 273.15, 1e-12);
  EXPECT_NEAR(convert("\u2103", "K", 0.0), 273.15, 1e-12);
  EXPECT_NEAR(convert("\u00B0F", "degC", 212.0), 100.0, 1e-12);
  EXPECT_DOUBLE_EQ(convert("W/\u00B0C", "W/K", 3.0), 3.0);
  EXPECT_NEAR(convert("\u00B0", "rad", 180.0), std::numbers::pi, 1e-15);
  EXPECT_DOUBLE_EQ(convert("k\u03A9", "ohm", 2.0), 2e3);
  EXPECT_DOUBLE_EQ(convert("\u2126", "V/A", 2.0), 2.0);
  for (const char* micro : {"\u00B5m", "\u03BCm"}) EXPECT_DOUBLE_EQ(convert(micro, "m", 1.0), 1e-6);
}

TEST(Unit, ReadsProductsPowersAndQuotients) {
  EXPECT_DOUBLE_EQ(convert("N s2/m2", "kg/m", 1.0), 1.0);
  EXPECT_DOUBLE_EQ(convert("W s/(K m)", "N/K", 1.0), 1.0);
  EXPECT_DOUBLE_EQ(convert("J/K", "W s/K", 1.0), 1.0);
  EXPECT_DOUBLE_EQ(convert("1/hPa", "1/Pa", 1.0), 0.01);
  EXPECT_DOUBLE_EQ(convert("ppm/K", "1/K", 12.0), 12e-6);
  EXPECT_DOUBLE_EQ(convert("rpm", "rad/s", 60.0), 2.0 * std::numbers::pi);
  EXPECT_DOUBLE_EQ(convert("rad/s", "rpm", std::numbers::pi), 30.0);
  EXPECT_DOUBLE_EQ(convert("rpm", "deg/s", 1.0), 6.0);
  EXPECT_DOUBLE_EQ(convert("rpm", "Hz", 60.0), 1.0);
  EXPECT_TRUE(conversion("V^0.5/s", "V^0.5/s").has_value());
  EXPECT_TRUE(conversion("W/W", "1").has_value());
  EXPECT_TRUE(conversion("1/px2", "1/px2").has_value());
}

TEST(Unit, OfSiIsNamedSoThatItIsReadAsTheSame) {
  for (const auto& [text, si] : {std::pair{"mm", "m"},
                                 {"deg", "rad"},
                                 {"L/min", "m3/s"},
                                 {"mN m", "J"},
                                 {"rpm", "Hz"},
                                 {"degF", "degC"},
                                 {"W/(K cm)", "m kg/(s3 K)"},
                                 {"%", ""}}) {
    EXPECT_EQ(si_unit(*parse_unit(text)), si) << text;
    EXPECT_TRUE(parse_unit(si)->same_quantity(*parse_unit(text))) << text;
    EXPECT_EQ(parse_unit(si)->factor, 1.0) << text;
  }
}

TEST(Unit, RefusesWhatIsNoUnitOrAnotherQuantity) {
  for (const char* text : {"furlong", "m/", "/s", "m//s", "(m", "m)", "m^"})
    EXPECT_FALSE(parse_unit(text)) << text;
  EXPECT_FALSE(conversion("m", "s"));
  EXPECT_FALSE(conversion("V^0.5/s", "V/s"));
  EXPECT_FALSE(conversion("px", "m"));
}

}  // namespace
}  // namespace invar

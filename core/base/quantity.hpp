// Quantities in the words of reports: a number, its unit with the handiest prefix, its standard deviation.
#pragma once

#include <string>

namespace invar {

/// "12.3" with the given number of significant digits; "-" for NaN.
std::string number(double value, int digits = 3);
/// A value with its unit in the handiest prefix: si(4.1e-6, "m") is "4.1 um". Units that take none ("1", "kg", "1/A2",
/// "degC") stand as they are.
std::string si(double value, const std::string& unit, int digits = 3);
/// A value with its standard deviation, two digits of which are shown: "19.40 +- 0.78 s".
std::string with_sigma(double value, double sigma, const std::string& unit);

struct Prefix {
  double factor;
  const char* name;
};
/// The prefix that suits the value; none where the unit begins with a power, a gram, a degree or a pure number.
Prefix prefix_of(double value, const std::string& unit);

}  // namespace invar

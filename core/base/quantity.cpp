#include "core/base/quantity.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace invar {

std::string number(double value, int digits) {
  if (std::isnan(value)) return "-";
  std::array<char, 64> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.*g", digits, value);
  return {text.data(), static_cast<std::size_t>(length)};
}

namespace {

std::string with_unit(const std::string& text, const std::string& unit) {
  return unit.empty() || unit == "1" ? text : text + " " + unit;
}

std::string fixed(double value, int decimals) {
  std::array<char, 64> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return {text.data(), static_cast<std::size_t>(length)};
}

}  // namespace

Prefix prefix_of(double value, const std::string& unit) {
  static constexpr Prefix prefixes[] = {{1e-9, "n"}, {1e-6, "u"}, {1e-3, "m"},
                                        {1.0, ""},   {1e3, "k"},  {1e6, "M"}};
  static constexpr std::array symbols{"m", "s", "N", "A", "V", "K", "W", "J", "Hz", "Pa", "rad", "ohm"};
  const auto first = unit.substr(0, unit.find_first_of(" /("));
  const bool takes =
      std::any_of(symbols.begin(), symbols.end(), [&](const char* one) { return first == one; });
  Prefix best = prefixes[3];
  if (!takes || value == 0.0 || !std::isfinite(value)) return best;
  best = prefixes[0];
  for (const Prefix& prefix : prefixes)
    if (std::abs(value) >= 0.9995 * prefix.factor) best = prefix;
  return best;
}

std::string si(double value, const std::string& unit, int digits) {
  const auto prefix = prefix_of(value, unit);
  const double shown = value / prefix.factor;
  if (std::abs(shown) >= 10.0 && std::abs(shown) < 1e5)  // 780, not 7.8e+02
    digits = std::max(digits, static_cast<int>(std::log10(std::abs(shown))) + 1);
  return with_unit(number(shown, digits), prefix.name + unit);
}

std::string with_sigma(double value, double sigma, const std::string& unit) {
  if (!(sigma > 0.0) || !std::isfinite(sigma) || !std::isfinite(value)) return si(value, unit, 4);
  const auto prefix = prefix_of(std::max(std::abs(value), sigma), unit);
  double v = value / prefix.factor, s = sigma / prefix.factor;
  const double size = std::max(std::abs(v), s);
  std::string before, behind;
  if (size >= 1e5 || size < 1e-3) {
    const double exponent = std::floor(std::log10(size));
    v *= std::pow(10.0, -exponent), s *= std::pow(10.0, -exponent);
    before = "(", behind = ")e" + fixed(exponent, 0);
  }
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(s))), 0, 9);
  return with_unit(before + fixed(v, decimals) + " +- " + fixed(s, decimals) + behind, prefix.name + unit);
}

}  // namespace invar

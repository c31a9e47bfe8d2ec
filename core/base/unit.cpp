#include "core/base/unit.hpp"

#include <cctype>
#include <charconv>
#include <cmath>
#include <numbers>
#include <sstream>

#include "core/base/limits.hpp"

namespace invar {

namespace {

enum Base { metre, kilogram, second, ampere, kelvin, radian, pixel, count };

struct Named {
  std::string_view name;
  double factor;
  double m, kg, s, a, k, rad, px, n;
};

constexpr double pi = std::numbers::pi;
// name, factor to SI, exponents of m kg s A K rad px count
constexpr Named table[] = {
    {"1", 1, 0, 0, 0, 0, 0, 0, 0, 0},
    {"%", 1e-2, 0, 0, 0, 0, 0, 0, 0, 0},
    {"ppm", 1e-6, 0, 0, 0, 0, 0, 0, 0, 0},
    {"m", 1, 1, 0, 0, 0, 0, 0, 0, 0},
    {"g", 1e-3, 0, 1, 0, 0, 0, 0, 0, 0},
    {"s", 1, 0, 0, 1, 0, 0, 0, 0, 0},
    {"min", 60, 0, 0, 1, 0, 0, 0, 0, 0},
    {"h", 3600, 0, 0, 1, 0, 0, 0, 0, 0},
    {"A", 1, 0, 0, 0, 1, 0, 0, 0, 0},
    {"K", 1, 0, 0, 0, 0, 1, 0, 0, 0},
    {"degC", 1, 0, 0, 0, 0, 1, 0, 0, 0},
    {"\xC2\xB0\x43", 1, 0, 0, 0, 0, 1, 0, 0, 0},  // degree sign and C
    {"\xE2\x84\x83", 1, 0, 0, 0, 0, 1, 0, 0, 0},  // both in one sign
    {"rad", 1, 0, 0, 0, 0, 0, 1, 0, 0},
    {"deg", pi / 180, 0, 0, 0, 0, 0, 1, 0, 0},
    {"\xC2\xB0", pi / 180, 0, 0, 0, 0, 0, 1, 0, 0},
    {"arcmin", pi / 10800, 0, 0, 0, 0, 0, 1, 0, 0},
    {"arcsec", pi / 648000, 0, 0, 0, 0, 0, 1, 0, 0},
    {"px", 1, 0, 0, 0, 0, 0, 0, 1, 0},
    {"count", 1, 0, 0, 0, 0, 0, 0, 0, 1},
    {"Hz", 1, 0, 0, -1, 0, 0, 0, 0, 0},
    {"rpm", 1.0 / 60, 0, 0, -1, 0, 0, 0, 0, 0},
    {"N", 1, 1, 1, -2, 0, 0, 0, 0, 0},
    {"J", 1, 2, 1, -2, 0, 0, 0, 0, 0},
    {"W", 1, 2, 1, -3, 0, 0, 0, 0, 0},
    {"V", 1, 2, 1, -3, -1, 0, 0, 0, 0},
    {"ohm", 1, 2, 1, -3, -2, 0, 0, 0, 0},
    {"Ohm", 1, 2, 1, -3, -2, 0, 0, 0, 0},
    {"\xCE\xA9", 1, 2, 1, -3, -2, 0, 0, 0, 0},      // capital omega
    {"\xE2\x84\xA6", 1, 2, 1, -3, -2, 0, 0, 0, 0},  // the sign of the unit
    {"F", 1, -2, -1, 4, 2, 0, 0, 0, 0},
    {"H", 1, 2, 1, -2, -2, 0, 0, 0, 0},
    {"Pa", 1, -1, 1, -2, 0, 0, 0, 0, 0},
    {"bar", 1e5, -1, 1, -2, 0, 0, 0, 0, 0},
    {"psi", 6894.757293168361, -1, 1, -2, 0, 0, 0, 0, 0},
    {"L", 1e-3, 3, 0, 0, 0, 0, 0, 0, 0},
    {"inch", 0.0254, 1, 0, 0, 0, 0, 0, 0, 0},
    {"in", 0.0254, 1, 0, 0, 0, 0, 0, 0, 0},
};

struct Prefix {
  std::string_view name;
  double factor;
};
constexpr Prefix prefixes[] = {{"n", 1e-9}, {"u", 1e-6}, {"\xC2\xB5", 1e-6}, {"\xCE\xBC", 1e-6},
                               {"m", 1e-3}, {"c", 1e-2}, {"h", 1e2},         {"k", 1e3},
                               {"M", 1e6},  {"G", 1e9},  {"p", 1e-12}};

std::optional<Unit> exact(std::string_view name) {
  for (const Named& u : table)
    if (u.name == name) return Unit{{u.m, u.kg, u.s, u.a, u.k, u.rad, u.px, u.n}, u.factor, 0.0};
  return std::nullopt;
}

std::optional<Unit> named(std::string_view name) {
  if (auto unit = exact(name)) return unit;
  for (const Prefix& prefix : prefixes) {
    if (!name.starts_with(prefix.name)) continue;
    if (auto unit = exact(name.substr(prefix.name.size()))) {
      unit->factor *= prefix.factor;
      return unit;
    }
  }
  return std::nullopt;
}

void multiply(Unit& product, const Unit& by, double power) {
  for (std::size_t i = 0; i < product.dimension.size(); ++i) product.dimension[i] += power * by.dimension[i];
  product.factor *= std::pow(by.factor, power);
}

/// Recursive descent over the grammar in the header; at() is advanced past what was read.
class Parser {
 public:
  explicit Parser(std::string_view text) : rest_{text} {}

  std::optional<Unit> all() {
    auto unit = product();
    skip_spaces();
    return unit && rest_.empty() ? unit : std::nullopt;
  }

 private:
  void skip_spaces() {
    while (!rest_.empty() && (rest_.front() == ' ' || rest_.front() == '*')) rest_.remove_prefix(1);
  }

  std::optional<Unit> product() {
    Unit result;
    bool divide = false;
    bool any = false;
    for (;;) {
      skip_spaces();
      if (rest_.empty() || rest_.front() == ')') break;
      if (rest_.front() == '/') {
        if (!any || divide) return std::nullopt;
        divide = true;
        rest_.remove_prefix(1);
        continue;
      }
      const auto factor = power();
      if (!factor) return std::nullopt;
      multiply(result, *factor, divide ? -1.0 : 1.0);
      divide = false;
      any = true;
    }
    return any && !divide ? std::optional{result} : std::nullopt;
  }

  std::optional<Unit> power() {
    std::optional<Unit> unit;
    if (rest_.front() == '(') {
      rest_.remove_prefix(1);
      unit = product();
      if (rest_.empty() || rest_.front() != ')') return std::nullopt;
      rest_.remove_prefix(1);
    } else if (rest_.front() == '1') {
      rest_.remove_prefix(1);
      return Unit{};
    } else {
      std::size_t length = 0;
      while (length < rest_.size() && is_letter(rest_[length])) ++length;
      unit = named(rest_.substr(0, length));
      rest_.remove_prefix(length);
    }
    if (!unit) return std::nullopt;
    double exponent = 1.0;
    if (!rest_.empty() &&
        (rest_.front() == '^' || std::isdigit(static_cast<unsigned char>(rest_.front())) != 0)) {
      if (rest_.front() == '^') rest_.remove_prefix(1);
      const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), exponent);
      if (error != std::errc{}) return std::nullopt;
      rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    }
    Unit result;
    multiply(result, *unit, exponent);
    return result;
  }

  static bool is_letter(char c) {
    return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '%' ||
           static_cast<unsigned char>(c) >= 0x80;
  }

  std::string_view rest_;
};

}  // namespace

bool Unit::same_quantity(const Unit& other) const {
  for (std::size_t i = 0; i < dimension.size(); ++i)
    if (i != radian && std::abs(dimension[i] - other.dimension[i]) > 1e-9) return false;
  return true;
}

std::optional<Unit> parse_unit(std::string_view text) {
  if (text.size() > limits::unit) return std::nullopt;  // the parser below goes as deep as the brackets
  if (text.empty() || text == "-") return Unit{};
  if (text == "K") return Unit{{0, 0, 0, 0, 1, 0, 0, 0}, 1.0, -273.15};
  if (text == "degF" || text == "\xC2\xB0\x46")
    return Unit{{0, 0, 0, 0, 1, 0, 0, 0}, 5.0 / 9.0, -160.0 / 9.0};
  return Parser{text}.all();
}

std::string si_unit(const Unit& unit) {
  constexpr std::array<std::string_view, 8> bases{"m", "kg", "s", "A", "degC", "rad", "px", "count"};
  if (unit.dimension == std::array<double, 8>{}) return "";
  for (const auto& one : table)
    if (one.factor == 1.0 && one.name != "K" && exact(one.name)->dimension == unit.dimension)
      return std::string{one.name};
  std::string above, below;
  for (std::size_t i = 0; i < bases.size(); ++i) {
    const double power = unit.dimension[i];
    if (std::abs(power) < 1e-9) continue;
    std::ostringstream part;
    part << (i == kelvin ? "K" : bases[i]);
    if (std::abs(std::abs(power) - 1.0) > 1e-9) part << std::abs(power);
    auto& side = power > 0.0 ? above : below;
    side += (side.empty() ? "" : " ") + part.str();
  }
  const bool many = below.find(' ') != std::string::npos;
  return (above.empty() ? "1" : above) + (below.empty() ? "" : many ? "/(" + below + ")" : "/" + below);
}

std::optional<Conversion> conversion(std::string_view from, std::string_view to) {
  // Beside a temperature C and F are degrees; alone C is no unit here, and F a farad.
  const auto degrees = [](std::string_view text, std::string_view other) -> std::string_view {
    const auto beside = parse_unit(other);
    if (!beside || beside->dimension != parse_unit("degC")->dimension) return text;
    return text == "C" ? "degC" : text == "F" ? "degF" : text;
  };
  from = degrees(from, to), to = degrees(to, from);
  const auto source = parse_unit(from);
  const auto target = parse_unit(to);
  if (!source || !target || !source->same_quantity(*target)) return std::nullopt;
  // Turns, a minute or a second, are no pure numbers where the other side counts angles.
  const auto turns = [](std::string_view text, const Unit& unit, const Unit& other) {
    const auto holds = [&](const char* name) { return text.find(name) != std::string_view::npos; };
    const bool counts_turns = (holds("rpm") || holds("Hz")) && unit.dimension[radian] == 0.0;
    return counts_turns ? std::pow(2.0 * pi, other.dimension[radian]) : 1.0;
  };
  const double from_size = source->factor * turns(from, *source, *target),
               to_size = target->factor * turns(to, *target, *source);
  return Conversion{from_size / to_size, (source->offset - target->offset) / target->factor};
}

}  // namespace invar

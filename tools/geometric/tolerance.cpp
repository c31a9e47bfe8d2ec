#include "tools/geometric/tolerance.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/base/angle.hpp"
#include "core/base/fault.hpp"
#include "core/base/unit.hpp"
#include "core/metrology/geometric/error_motions.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

using metrology::iso230_names;

struct Limit {
  double value = 0.0;
  std::string unit;  // "m", "rad"; empty where none was written
};

std::optional<Limit> limit_of(const std::string& text) {
  double value = 0.0;
  const auto [end, flaw] = std::from_chars(text.data(), text.data() + text.size(), value);
  std::string unit{end, static_cast<std::size_t>(text.data() + text.size() - end)};
  unit.erase(0, unit.find_first_not_of(' '));
  if (flaw != std::errc{} || !(value > 0.0) || !std::isfinite(value)) return std::nullopt;
  if (unit.empty()) return Limit{value, ""};
  for (const char* si : {"m", "rad"})
    if (const auto carried = conversion(unit, si)) return Limit{(*carried)(value), si};
  return std::nullopt;
}

std::optional<metrology::Iso230Figure> figure_named(const std::string& name) {
  const auto found = std::find(iso230_names.begin(), iso230_names.end(), name);
  if (found == iso230_names.end()) return std::nullopt;
  return static_cast<metrology::Iso230Figure>(found - iso230_names.begin());
}

/// "rad" or "m"; empty where there is no such motion.
std::string unit_of_motion(const std::string& name) {
  for (int pair = 0; pair < metrology::squareness_count; ++pair)
    if (metrology::squareness_iso_name(pair) == name) return "rad";
  const auto motion = metrology::error_motion_named(name);
  if (!motion) return "";
  return metrology::is_rotation(*motion) ? "rad" : "m";
}

Tolerance read_tolerance(const std::string& text, bool rotary) {
  const auto equal = text.find('=');
  const std::string where = "--tolerance " + text;
  const std::string name = text.substr(0, equal);
  const auto colon = name.find(':');
  Tolerance result;
  result.text = text;
  result.figure = figure_named(colon == std::string::npos ? name : name.substr(colon + 1));
  if (colon != std::string::npos)
    result.motion = name.substr(0, colon);
  else if (!result.figure)
    result.motion = name;
  const std::string told = unit_of_motion(result.motion);
  if (equal == std::string::npos || (colon != std::string::npos && !result.figure) ||
      (!result.motion.empty() && (rotary || told.empty())))
    throw InputError{
        where, "names no figure of ISO 230-2",
        "write A, E, M, B, R, or one of a direction as R_forward: \"A=10 um\"; of one error motion "
        "\"ECX:A=8 arcsec\""};
  if (!result.figure && metrology::is_positioning(metrology::error_motion_named(result.motion).value_or(1)))
    throw InputError{where, "a positioning has several figures",
                     "write one: \"" + result.motion + ":A=10 um\""};
  const std::string wanted = !told.empty() ? told : (rotary ? "rad" : "");
  const auto limit = limit_of(text.substr(equal + 1));
  if (!limit || (!wanted.empty() && !limit->unit.empty() && limit->unit != wanted))
    throw InputError{where, "is no limit",
                     std::string{"write a number above 0 with a unit of "} +
                         (wanted == "rad" ? "an angle: \"8 arcsec\"" : "a length: \"10 um\"")};
  result.limit = limit->value;
  result.unit = !wanted.empty() ? wanted : (limit->unit.empty() ? "m" : limit->unit);
  return result;
}

}  // namespace

std::vector<Tolerance> read_tolerances(const std::vector<std::string>& texts, bool rotary) {
  std::vector<Tolerance> result;
  for (const std::string& text : texts) result.push_back(read_tolerance(text, rotary));
  return result;
}

Verdict verdict_of(double value, double uncertainty, double limit) {
  if (std::abs(value) + uncertainty <= limit) return Verdict::within;
  // A figure that is not there is open.
  return std::abs(value) - uncertainty > limit ? Verdict::beyond : Verdict::open;
}

std::string verdict_name(Verdict verdict) {
  return verdict == Verdict::within ? "pass" : (verdict == Verdict::beyond ? "fail" : "open");
}

std::string callout_of(Verdict verdict) {
  return verdict == Verdict::within ? "good" : (verdict == Verdict::beyond ? "bad" : "warn");
}

std::string micro_or_arcsec(double value, const std::string& unit, int digits) {
  return std::isnan(value) ? "-" : report::number(value / (unit == "rad" ? arcsec : 1e-6), digits);
}

std::string verdict_words(const std::string& name, double value, double uncertainty, double limit,
                          const std::string& unit) {
  const std::string small = unit == "rad" ? " arcsec" : " um";
  const std::string told =
      name + " = " + micro_or_arcsec(value, unit) + " +- " + micro_or_arcsec(uncertainty, unit, 2) + small;
  const std::string most = micro_or_arcsec(limit, unit) + small;
  switch (verdict_of(value, uncertainty, limit)) {
    case Verdict::within:
      return told + ": pass, within " + most;
    case Verdict::beyond:
      return told + ": fail, beyond " + most;
    default:
      return told + ": neither pass nor fail is shown, the limit is " + most;
  }
}

}  // namespace invar::tools

// Tolerances on figures of ISO 230: how they are written, whom they mean, pass and fail by ISO 14253-1.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/metrology/geometric/iso230.hpp"

namespace invar::tools {

/// Largest value that a figure may have [m or rad].
struct Tolerance {
  std::optional<metrology::Iso230Figure>
      figure;  // none: straightness, angle or squareness of `motion` by ISO 230-1
  double limit = 0.0;
  std::string unit = "m";  // or "rad"
  std::string motion{};    // "ECX"; empty: whatever has that figure in that unit
  std::string text{};      // as it was written
};

/// "A=10 um", "R_forward=4e-6", "E=8 arcsec"; where several motions are tested "ECX:A=8 arcsec" of one, and "EYX=3 um" of
/// its figure by ISO 230-1. `rotary`: the one axis tested turns. Throws InputError.
std::vector<Tolerance> read_tolerances(const std::vector<std::string>& texts, bool rotary);

/// Within the tolerance or beyond it counts as shown only where the expanded uncertainty leaves no doubt.
enum class Verdict { within, beyond, open };
Verdict verdict_of(double value, double uncertainty, double limit);
/// "pass", "fail", "open"; and the kind of callout that says so.
std::string verdict_name(Verdict verdict);
std::string callout_of(Verdict verdict);
/// "A = 8.2 +- 0.4 um: pass, within 10 um". `unit` is "m" or "rad".
std::string verdict_words(const std::string& name, double value, double uncertainty, double limit,
                          const std::string& unit);

/// In um or arcsec; "-" for what is not known.
std::string micro_or_arcsec(double value, const std::string& unit, int digits = 4);

}  // namespace invar::tools

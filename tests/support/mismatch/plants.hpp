// The machines plant by plant, before noise gets into their files.
#pragma once

#include <algorithm>

#include "tests/support/mismatch/machine.hpp"

namespace invar::test::mismatch {

/// What is asked of a plant's maker.
struct Wish {
  std::vector<std::string> effects;  // of the list of the plant
  double size = 1.0;
  Colour colour = Colour::white;
  std::size_t rows = 0;  // 0: drawn
  std::map<std::string, double> crowd;
  std::string muted;  // of this effect nothing, all else as with it

  [[nodiscard]] bool has(const std::string& name) const {
    return std::find(effects.begin(), effects.end(), name) != effects.end();
  }
  /// The memory of the noise: of a row, from low to high; of a hum, its turn a row.
  [[nodiscard]] double pole(Draw& draw, double low, double high) const {
    return colour == Colour::memory      ? draw.between(low, high)
           : colour == Colour::resonance ? draw.between(0.2, 2.0)
                                         : 0.0;
  }
  [[nodiscard]] double of(const std::string& name) const {
    if (has(name)) return name != muted ? size : 0.0;
    const auto at = crowd.find(name);
    return at == crowd.end() ? 0.0 : at->second;
  }
};

Machine make_axis(const Wish& wish, Draw& draw);
Machine make_thermal(const Wish& wish, Draw& draw);
Machine make_error_map(const Wish& wish, Draw& draw);
Machine make_droplet(const Wish& wish, Draw& draw);
Machine make_sensor(const Wish& wish, Draw& draw);
Machine make_equations(const Wish& wish, Draw& draw);

/// `{value: 3.2, unit: kg, sigma: 0.06}` of a true value: the user is off by some sigma.
std::string believed(double value, const char* unit, double sigma);
std::string text(double value);

/// A smooth motion: moves to drawn places at drawn speeds with pauses, sines, slow scans, or a sweep.
std::vector<double> motion(Draw& draw, int kind, std::size_t rows, double period, double travel);

/// Straight lines between drawn levels: powers, ambient temperatures, speeds.
std::vector<double> steps(Draw& draw, std::size_t rows, double period, double least, double most, double low,
                          double high, bool from_zero);

}  // namespace invar::test::mismatch

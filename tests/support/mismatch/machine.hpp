// Made machines: recordings whose missing physics is known, drawn at random and simulated by formulas of their own,
// apart from core/physics. What a diagnosis should say of them stands beside.
#pragma once

#include <map>
#include <random>
#include <string>
#include <vector>

#include "core/recording/table.hpp"

namespace invar::test::mismatch {

/// Draws; the same seed gives the same machine on every platform of one standard library.
class Draw {
 public:
  explicit Draw(unsigned seed) : engine_{seed} {}
  double between(double low, double high) {
    return low + (high - low) * std::generate_canonical<double, 53>(engine_);
  }
  double log_between(double low, double high);
  double normal(double sigma = 1.0) { return sigma * normal_(engine_); }
  double sign() { return between(0.0, 1.0) < 0.5 ? -1.0 : 1.0; }
  bool once_in(double n) { return between(0.0, n) < 1.0; }
  std::size_t index(std::size_t n) {
    return static_cast<std::size_t>(between(0.0, static_cast<double>(n))) % n;
  }

 private:
  std::mt19937 engine_;
  std::normal_distribution<double> normal_;
};

/// What noise may be like: a first-order memory, white that wanders, a hum about one frequency, or now and then far out.
enum class Colour { white, memory, wander, resonance, heavy };

/// Noise of one size in any colour.
class Noise {
 public:
  Noise(Draw& draw, double sigma, Colour colour, double pole)
      : draw_{&draw}, sigma_{sigma}, colour_{colour}, pole_{pole} {}
  double operator()();

 private:
  Draw* draw_;
  double sigma_;
  Colour colour_;
  double pole_, last_ = 0.0, before_ = 0.0;
};

/// A term that is missing, and the names that count for it: 1 the right one (or its indistinguishable twin), 0.5 a
/// relative.
struct TrueTerm {
  std::map<std::string, double> names;
  std::vector<std::string> sites;
  std::vector<std::string> depends_on;
};

struct Machine {
  std::string plant, effect;  // "axis", "coulomb_friction+dead_zone"
  double size =
      0.0;  // of the effect, 1: usual; an axis may have got less, so that its current stays within its limit
  std::string yaml;  // model.yaml: what its user believes
  std::vector<recording::Table> recordings;
  std::vector<recording::Table> quiet;               // the same without noise and faults
  std::map<std::string, std::vector<double>> noise;  // of the first recording, by column
  recording::Table test_inputs, test_outputs;        // another motion, outputs without noise
  std::vector<TrueTerm> missing;
  bool parameter_is_off = false;
  std::vector<std::string> crowd;               // the small effects beside the chief one
  std::vector<std::string> unlisted;            // these and their relatives: none of them is a false claim
  std::map<std::string, double> left_by_crowd;  // mean square on the test run that the crowd makes, by column
  std::map<std::string, double> verdicts;  // accepted where the effect is large enough to be seen, by credit
};

/// How a recording suffers on its way.
struct Trouble {
  Colour colour = Colour::white;
  std::size_t rows = 0;                 // of a recording of an axis or of heat; 0: drawn
  bool quantised = false;               // written in steps about as large as the noise
  bool faults = false;                  // gaps, empty cells, outliers, repeated and swapped rows
  bool renamed = false;                 // columns called c1, c2, ...
  std::map<std::string, double> crowd;  // further effects by their size, that no list tells
  std::string muted;                    // an effect of which the machine has nothing; all else is as with it
};

/// Mean square of the noise of an output, in the unit of its column.
double noise_power(const std::vector<double>& noise);

/// The effects that the machines of a plant can have: "none", "parameter", each term, "unknown:..." for what no term
/// describes.
std::vector<std::string> effects(const std::string& plant);

/// A machine of that plant with these effects (joined by +), the `size` times the usual one.
Machine make(const std::string& plant, const std::string& effect, double size, unsigned seed,
             const Trouble& trouble = {});

inline const std::vector<std::string> plants{"axis",    "thermal", "error_map",
                                             "droplet", "sensor",  "equations"};

}  // namespace invar::test::mismatch

// Candidates: which terms could act in this machine, where, and from which shapes a fit of them begins.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "tools/diagnose/fit.hpp"

namespace invar::diagnose {

/// A term to be tried from one shape. `columns` are the directions in which its strength may grow.
struct Start {
  physics::Term term;
  struct Direction {
    std::size_t amplitude =
        physics::most_parameters;  // most_parameters: the term as a whole, or a curve's value
    std::size_t knot = 0;
    bool quadrature = false;  // of a periodic term: the cosine
  };
  std::vector<Direction> directions;
  double step = 0.0;  // of a curve's values, for its slopes; 0: the plant's usual
};

/// All named terms that the signals of the case allow, on top of `fitted`, but those in `without`.
std::vector<Start> named_starts(const Case& data, const Weighing& weighing, const Fit& fitted,
                                const std::set<std::string, std::less<>>& without);
/// Curves over each variable, for what no name describes.
std::vector<Start> unmodelled_starts(const Case& data, const Fit& fitted);
/// Curves with memory, for hysteresis and what creeps.
std::vector<Start> memory_starts(const Case& data, const Fit& fitted);

/// Those of a model in the user's own equations.
std::vector<Start> equation_starts(const Case& data, const physics::Model& fitted);
/// Curves of each rate over each state, input and the time; `products`: of what it has in proportion to another of them, as a
/// number of the user's that changes, or two states that act together.
std::vector<Start> equation_curves(const Case& data, const physics::Model& fitted, bool products = false);
/// The knots of a curve with memory: thresholds as shares of `span`, or time constants as shares of `duration`.
void lay_memory(Start& start, std::size_t count, double span, double duration);
std::vector<Start> equation_memories(const Case& data, const physics::Model& fitted);
/// From where to where a state, input, output or the time goes in a model of equations.
std::pair<double, double> span_of(const Case& data, const physics::Model& model, const std::string& name);
/// How far apart the middle four fifths of its rows lie.
double inner_span_of(const Case& data, const physics::Model& model, const std::string& name);
/// Does it go both ways, up and down?
bool turns(const Case& data, const physics::Model& model, const std::string& name);
/// Does it stand at zero for some rows? A steady rate would move it.
bool rests(const Case& data, const physics::Model& model, const std::string& name);
/// Two terms that bend the same rate over the same variable: one law has room for one of them.
bool same_law(const physics::Term& one, const physics::Term& other);
/// The starts of one term: every value of its first shape (its own where none is given), the first value of further ones.
void add_starts(std::vector<Start>& starts, physics::Term term, const std::vector<double>& first_shapes = {});

/// Pitches or frequencies at which a periodic term would explain most, best first (axis: by the adjoint of the loop).
struct Periods {
  std::vector<double> force_pitch, motor_pitch, reading_pitch, force_frequency, mode_frequency;
  std::vector<std::pair<double, double>> squares;  // frequency, and phase at time zero
};
/// The waves along a variable that explain most, up to a hundred, by least squares: sums and weights of a residual in bins over
/// its span. The best four, best first, in its unit.
std::vector<double> long_pitches(const std::vector<double>& sums, const std::vector<double>& weights,
                                 double span);
/// Pitches of a sensor's residual along its position, best first.
std::vector<double> sensor_pitches(const Case& data, const Fit& fitted);
/// Waves that stand out of a series over time, of which `responses` are the answers to a push: sines best first by frequency
/// [Hz], and square waves by frequency and phase at time zero [rad].
struct Lines {
  std::vector<double> frequency;
  std::vector<std::pair<double, double>> squares;
};
Lines lines_of(const std::vector<double>& time, std::vector<double> series,
               const std::vector<std::vector<double>>& responses);
Periods axis_periods(const Case& data, const Weighing& weighing, const Fit& fitted);

/// Rows of one signal, as the model sees them (positions measured, velocities differentiated). `node`: whose temperature;
/// empty: of the first.
std::vector<double> variable_values(const Case& data, std::size_t recording, const std::string& name,
                                    const std::string& node = "");

}  // namespace invar::diagnose

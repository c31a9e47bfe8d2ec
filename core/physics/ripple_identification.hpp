// Force ripple from what a servo had to do: current and position of runs at constant velocity, both ways.
#pragma once

#include <vector>

#include "core/base/range.hpp"
#include "core/physics/simulation.hpp"

namespace invar::physics {

/// Samples of runs at constant velocity, so that the current tells the force alone. `run` numbers the passes.
struct RippleSamples {           // of a rotary axis in rad, rad/s
  std::vector<double> position;  // [m]
  std::vector<double> velocity;  // wanted [m/s]
  std::vector<double> current;   // [A]
  std::vector<int> run;
  std::size_t rows = 0;  // of the recording that these are averages of
  [[nodiscard]] std::size_t size() const { return position.size(); }
};

/// The parts of a recording (signals `reference`, `position`, `current`) in which the reference moves at constant velocity.
/// Each lasts half a second or more and counts from a quarter of a second after its beginning; rows averaged to about 6000.
RippleSamples constant_velocity_runs(const Record& record);

struct RippleHarmonic {
  int order = 1;
  double amplitude = 0.0;  // [N]
  double phase = 0.0;      // [rad], at position zero
  double sigma = 0.0;      // of the amplitude [N]
};

/// Harmonics of one pitch: of the magnets, of a screw, of a gear's teeth.
struct RippleFamily {
  double pitch = 0.0;                     // [m]
  double pitch_sigma = 0.0;               // [m]
  std::vector<RippleHarmonic> harmonics;  // those that stand out by 3.5 sigmas
};

/// Lengths and forces; of a rotary axis [rad] and [N m].
struct RippleFit {
  std::vector<RippleFamily> families;     // the one that explains most first; empty: no ripple
  double pitch = 0.0;                     // of the first family, or what the scan took for one [m]
  double pitch_sigma = 0.0;               // [m]
  std::vector<RippleHarmonic> harmonics;  // of the first family
  double not_noise = 1.0;  // probability that what is left is noise: neighbours do not deviate alike
  double friction = 0.0;   // what is left of dry friction at these speeds [N]
  double constant = 0.0;   // [N]
  double before = 0.0;     // RMS of the force left over on runs held out, without ripple [N]
  double after = 0.0;      // ... with it
};

/// motor_constant u = damping v + friction sign(v) - constant - ripple(x), by least squares. Each pitch comes from a scan of
/// `pitches` and Newton steps. Further families come from the residual, as long as one stands out by 5.5 sigmas
/// and runs held out are met better with it. Mass does not matter at constant velocity. Preconditions: the model is of an
/// axis; at least two runs, 50 samples.
RippleFit identify_ripple(const Model& axis, const RippleSamples& samples, Range pitches,
                          int most_harmonics = 6);
/// With pitches from 4 to 100 mm, or of a rotary axis from a two-hundredth of a turn to a turn.
RippleFit identify_ripple(const Model& axis, const RippleSamples& samples);

/// The ripple as terms of an axis, one `force_ripple` a harmonic of each family.
std::vector<Term> ripple_terms(const RippleFit& fit);

/// Ripple of the first family as a position sensor: the start position in [0, pitch) of the ways `travelled` since then [m], if
/// `force` [N] was the ripple met on them. Force alone knows no more: places one pitch apart feel alike.
/// `misfit` (may be null) gets the RMS of what the ripple does not explain [N].
double position_from_ripple(const RippleFit& fit, const std::vector<double>& travelled,
                            const std::vector<double>& force, double* misfit = nullptr);

}  // namespace invar::physics

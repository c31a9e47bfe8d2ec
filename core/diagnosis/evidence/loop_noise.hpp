// Noise of the readings in a loop with friction, play or a dead zone. It shakes the carriage across them, so
// that they act more softly than in a run without noise.
#pragma once

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// The readings of a case, as they were recorded and without what their own noise makes of a model's bends. A plant without a
/// loop keeps its readings.
class LoopNoise {
 public:
  using Readings = std::vector<std::vector<std::vector<double>>>;  // by recording, output, row

  explicit LoopNoise(Case& data);
  /// Does a loop feed the noise of the readings back?
  [[nodiscard]] bool is_fed_back() const;
  /// Takes off the recorded readings what noise makes of this model, where that brings the two nearer. Leaves out
  /// the rows in which noise decides when the carriage sticks and slips; returns their share.
  double take_off(const physics::Model& model);
  /// The readings as recorded; what was in their place.
  Readings put_back();
  void put(Readings readings);
  [[nodiscard]] Readings now() const;
  /// Rows that are left out now since chance decides in them.
  [[nodiscard]] std::size_t left_to_chance() const;
  enum class Runs { few, two };
  /// The mean of runs of a model that the noise shakes which it leaves itself.
  [[nodiscard]] std::vector<physics::Outputs> shaken_mean(const physics::Model& model,
                                                          Runs runs = Runs::few) const;
  /// Does `with` lie nearer than `without`, by this ratio of the residual of any output, when it is shaken too? Play that is
  /// finer than the noise shows in a run without noise alone.
  [[nodiscard]] bool shows(const physics::Model& with, const physics::Model& without, double ratio) const;
  /// By how much log likelihood does it then, under this weighing? Infinite where no loop feeds noise back.
  [[nodiscard]] double gain(const physics::Model& with, const physics::Model& without,
                            const Weighing& weighing) const;
  /// Log likelihood by which `with` explains more than `without`, against what noise alone would do. Measured along the
  /// difference of the two: how far the readings lie from runs of `without` with noise, against the scatter of these runs.
  /// Where a carriage sticks and slips noise goes far, and a fit follows it. Infinite where no loop feeds noise back.
  [[nodiscard]] double beyond(const physics::Model& with, const physics::Model& without,
                              const Weighing& weighing) const;

 private:
  Case& data_;
  Readings recorded_;
};

}  // namespace invar::diagnosis

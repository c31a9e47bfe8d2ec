// What the noise of the readings does to a loop with friction, play or a dead zone: it shakes the carriage across them, so
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
  /// Leaves in the case what is recorded less what noise makes of this model, where that brings the two nearer, and without
  /// the rows in which noise decides when the carriage sticks and slips. The share of these.
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
  /// What `with` explains beyond `without`, in log likelihood by what noise itself makes of it: along their difference the
  /// readings lie so far from runs of `without` that noise shakes, against the scatter of these. Where a carriage sticks and
  /// slips noise goes far, and a fit follows it. Infinite where no loop feeds noise back.
  [[nodiscard]] double beyond(const physics::Model& with, const physics::Model& without,
                              const Weighing& weighing) const;

 private:
  Case& data_;
  Readings recorded_;
};

}  // namespace invar::diagnosis

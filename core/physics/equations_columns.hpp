// Terms at the inputs and outputs of a model in the user's own equations, applied to their values.
#pragma once

#include <string>
#include <vector>

#include "core/physics/equations_hooks.hpp"
#include "core/physics/model.hpp"

namespace invar::physics {

/// The place `on` of a term at an output: the output's name, or `output.NAME` where a state has that name too.
std::string place_of_output(const Equations& equations, const std::string& output);

/// Dry friction that names its own state under `with` acts against the rate of it, not against its sign. A state that is no
/// speed sticks until its rate would pass the level, as a valve does, and then moves so much slower.
bool sticks(const Term& term);

/// A delay, a lag or a dead zone: what others feel of a signal is no longer what it is.
bool is_felt_otherwise(const Term& term);
/// True for a delay, lag or dead zone with `with: others`. The derivatives of the other states see the transformed value, the
/// state's own derivative sees the true one. Example: transport delay in the pipe between two tanks.
bool is_felt_by_others_alone(const Term& term);
/// Is it added to what it acts on: to a state's rate, or at an output to its value by what goes with another variable? Nothing
/// of a signal's own past or size bends it.
bool is_added(const Term& term);
/// The variable that a term without a curve goes over: what it names under `with`, or what it acts on.
const std::string& goes_over(const Term& term);

/// The surplus of one column beyond a limit goes, in part, to another. `names` are those of the columns.
void run_over(const Model& model, const std::vector<std::string>& names,
              std::vector<std::vector<double>>& columns);

/// Course of an input from its row to the next: `value` + `rate` t + `fading` exp(-t / `time_constant`).
struct InputCourse {
  double value = 0.0, rate = 0.0, fading = 0.0, time_constant = 1.0;
};

/// A term at an input or output, value by value in order of time: what a controller decides is only known as it comes.
class Bending {
 public:
  /// `held`: from row to row, as an input is. `has_changes`: there is a row at every instant at which a held value changes
  /// late. Without such rows a value that comes late by a part of a step counts with the mean over it.
  Bending(const Term& term, bool held, bool has_changes);
  /// Transformed value at `now` [s]; `step` [s] from the row before or, where it is held, to the next. `arch`: height of a value
  /// that is not held, halfway from the row before, above the straight line.
  double operator()(double now, double step, double value, double arch = 0.0);

  /// Does it ask for what was between the rows?
  [[nodiscard]] bool looks_back() const {
    return course_ == nullptr && (is_store() || (kind_ == EquationsMemory::delay && first_ > 0.0));
  }

  /// Does a share arrive by way of a first-order store?
  [[nodiscard]] bool is_store() const { return share() > 0.0; }
  /// The course of a store from a value `felt` at a row, when its input goes from `value` straight on by `rate`.
  [[nodiscard]] InputCourse course(double value, double rate, double felt) const {
    const double aim = value - share() * rate * time_constant();
    return {aim, rate, felt - aim, time_constant()};
  }
  /// A store gives what is felt at each row; else what is held counts with the mean over its step.
  void give_rows() { at_rows_ = true; }

 private:
  [[nodiscard]] double time_constant() const { return kind_ == EquationsMemory::lag ? first_ : second_; }
  [[nodiscard]] double share() const {
    if (!(time_constant() > 0.0)) return 0.0;
    return kind_ == EquationsMemory::lag ? 1.0 : kind_ == EquationsMemory::hidden_state ? first_ : 0.0;
  }
  /// A share arrives by way of a first-order store, in balance at the start. A held value counts with the mean over its step,
  /// as a machine feels it; a smooth one goes by a parabola from row to row.
  double through_store(double step, double value, double arch);
  double late(double now, double value, double arch);

  EquationsMemory kind_;
  const Curve* course_;  // added to the value, over itself or over t; null: none
  bool goes_with_time_;
  double first_, second_;
  bool held_, has_changes_, at_rows_ = false, begun_ = false;
  double store_ = 0.0, last_ = 0.0;
  std::vector<double> times_, values_, arches_;
  std::size_t place_ = 0;
};

/// The terms `on` this signal, one after another.
std::vector<Bending> bendings(const Model& model, const std::string& on, bool held, bool has_changes);

/// The `step` of a row.
double step_about(const std::vector<double>& time, std::size_t row, bool held);

/// Terms `on` this signal bend its column. `held`: from row to row, as an input is; then with rows where it changes late.
/// `arches`: of what is not held, by how much it lies above the straight line halfway from the row before; empty: nowhere.
void bend(const Model& model, const std::string& on, const std::vector<double>& time,
          std::vector<double>& values, bool held, const std::vector<double>& arches = {});
/// The same for an input whose last bend is a store. Values become those felt at the rows; returned is their course by row
/// until the next one. Empty, and nothing bent, where the last bend is none.
std::vector<InputCourse> bend_by_store(const Model& model, const std::string& on,
                                       const std::vector<double>& time, std::vector<double>& values,
                                       bool held);
/// Does a term at an output ask for what was between the rows?
bool looks_back(const Model& model);

}  // namespace invar::physics

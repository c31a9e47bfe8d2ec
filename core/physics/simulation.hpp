// Simulation: a model on one recording's inputs; prepared once, run for any values of its parameters.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/physics/model.hpp"

namespace invar::physics {

/// Signals of one recording by name, in SI, one value a row; NaN where one is missing. Temperatures in degC.
struct Record {
  std::vector<double> time;
  std::map<std::string, std::vector<double>, std::less<>> signals;
  /// Rows at which the states of a model (`states_of`) are set anew, the k-th to what the model's parameters
  /// "<state>.start<first_restart + k>" say: an integrating model drifts without that.
  std::vector<std::size_t> restarts{};
  std::size_t first_restart = 0;
  /// [rad] Own equations: how far the fastest of a model may turn in a step, what dies away counted half.
  double turn = 0.25;

  [[nodiscard]] std::size_t rows() const { return time.size(); }
  [[nodiscard]] const std::vector<double>* find(std::string_view name) const {
    const auto at = signals.find(name);
    return at == signals.end() ? nullptr : &at->second;
  }
};

/// By output, in the order of Model::outputs(), one value a row of the record.
using Outputs = std::vector<std::vector<double>>;

/// Reads from the record: the time, the inputs, and of each output the first row alone, where it is filled:
/// the initial state. Rows must be in order of time. Inputs are held from one row to the next; missing ones
/// are bridged. Implementations are const and without shared state: any number of threads may run one.
class Simulation {
 public:
  virtual ~Simulation() = default;
  virtual void run(const Model& model, Outputs& outputs) const = 0;
  /// The same of several models. Where they differ in numbers alone some plants step through them together, with steps as
  /// short as the fastest of them asks for.
  virtual void run_all(const std::vector<const Model*>& models, std::vector<Outputs>& outputs) const {
    outputs.resize(models.size());
    for (std::size_t i = 0; i < models.size(); ++i) run(*models[i], outputs[i]);
  }
};

/// `structure` may later be run with other values and other terms, but with the same signals.
std::unique_ptr<Simulation> prepare(const Model& structure, const Record& inputs);

/// The row from which on an output is no number, or one beyond 1e30, to the end: the model ran away. The number of rows where it did not.
std::size_t ran_away_at(const std::vector<double>& output);

/// Linear bridges over missing values, constant at the ends; zeros where all are missing.
std::vector<double> bridged(const std::vector<double>& time, const std::vector<double>& values);

}  // namespace invar::physics

#include "core/diagnosis/checks/own_units.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/fault.hpp"
#include "core/base/quantity.hpp"
#include "core/diagnosis/estimate/fit_comparison.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

/// The recordings with this input in the unit of its column.
Case as_it_stands(const Case& data, const TakenInSi& input) {
  Case changed = data;
  changed.remembered = std::make_shared<Remembered>();
  for (auto& recording : changed.recordings) {
    for (double& value : recording.inputs.signals.at(input.signal))
      value = (value - input.offset) / input.factor;
    recording.simulation = physics::prepare(changed.model, recording.inputs);
  }
  return changed;
}

/// The input that the column gives; nothing where it is an output or what the controller decides.
const physics::Equations::Input* input_of(const physics::Model& model, const std::string& signal) {
  for (const auto& input : model.equations.inputs)
    if (input.signal == signal && input.symbol != model.equations.controlled_input) return &input;
  return nullptr;
}

}  // namespace

void check_own_units(const Case& data, const Fit& retuned) {
  for (const auto& one : data.taken_in_si) {
    const auto* input = input_of(data.model, one.signal);
    if (input == nullptr) continue;
    const auto changed = as_it_stands(data, one);
    const auto weighing = weigh(changed, simulate(changed, changed.model), Colour::white);
    const auto found = fit(changed, weighing, changed.model, changed.model, Effort::follow(8));
    const auto in_si = squares_left(data, retuned.model), as_written = squares_left(changed, found.model);
    double farther = 1e300;
    for (std::size_t o = 0; o < in_si.size(); ++o)
      if (as_written[o] > 0.0) farther = std::min(farther, std::sqrt(in_si[o] / as_written[o]));
    if (!(farther > thresholds::far_worse_in_si)) continue;
    throw InputError{data.recordings.front().name + ": column `" + one.column + "`",
                     "is in `" + one.unit + "` and taken in SI, times " + number(one.factor, 4) +
                         ", which leaves " + number(farther, 2) + " times as much as the column as it stands",
                     "say what the equations count it in, `inputs: {" + input->symbol +
                         ": {column: " + one.column + ", unit: " + one.unit + "}}`, or mend its header"};
  }
}

}  // namespace invar::diagnosis

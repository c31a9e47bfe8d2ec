// Freedoms: the numbers of a model that a fit may move, each with its prior.
#pragma once

#include <cstddef>
#include <vector>

#include "core/base/range.hpp"
#include "core/physics/model.hpp"

namespace invar::diagnosis {

/// One number that a fit may move.
struct Freedom {
  enum class Where { parameter, term, curve };
  Where where = Where::parameter;
  std::size_t term = 0;   // of terms and curves
  std::size_t index = 0;  // of the parameter, the term's parameter or the curve's value
  double scale = 1.0;     // a typical change; finite differences take a thousandth of it
  double center = 0.0;    // prior
  double sigma = 0.0;     // of the prior; not positive: none
  Range bounds;
};

double get(const physics::Model& model, const Freedom& freedom);
/// Sets it, and terms that share a nominal parameter with it.
void set(physics::Model& model, const Freedom& freedom, double value);

/// All that may move: parameters whose sigma is not 0, and the terms' amplitudes and shapes. `believed` holds the
/// priors of the nominal numbers.
std::vector<Freedom> freedoms(const physics::Model& model, const physics::Model& believed);

}  // namespace invar::diagnosis

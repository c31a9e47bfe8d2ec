// Start: a term to be tried, from one shape.
#pragma once

#include <vector>

#include "core/physics/model.hpp"

namespace invar::diagnosis {

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

/// The starts of one term: every value of its first shape (its own where none is given), the first value of further ones.
void add_starts(std::vector<Start>& starts, physics::Term term, const std::vector<double>& first_shapes = {});
/// The knots of a curve with memory: thresholds as shares of `span`, or time constants as shares of `duration`.
void lay_memory(Start& start, std::size_t count, double span, double duration);

}  // namespace invar::diagnosis

// Excerpt: some stretches of long recordings of a model in the user's own equations, on which candidates are ranked.
#pragma once

#include <optional>

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// A few stretches spread over the recordings, each from states of its own: those that the base has there, free to move.
struct Excerpt {
  Case data;
  Weighing weighing;
  Fit base;            // the same model, fitted to the stretches
  double share = 1.0;  // of the rows
};

/// Nothing where so many runs of all rows cost little enough, where the recordings begin anew within, and of other plants.
std::optional<Excerpt> excerpt(const Case& whole, const Weighing& weighing, const Fit& base,
                               std::size_t runs);

/// A fit to the excerpt taken to all rows: `base` is the one that the excerpt was made of.
Fit on_all(const Case& whole, const Weighing& weighing, const Fit& base, const Fit& of_excerpt);

}  // namespace invar::diagnosis

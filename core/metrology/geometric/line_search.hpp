// The search for displacement lines better than the recipe's: which end points tell most about the whole field.
#pragma once

#include <functional>
#include <vector>

#include "core/metrology/geometric/line_plan.hpp"

namespace invar::metrology {

/// Lines whose ends lie on a grid over the travels (3 nodes an axis, 5 for a table of two axes). They are chosen so that the
/// expected volumetric error under `prior` is least. From `start`, one line at a time is exchanged for the best of all
/// candidates, until none helps. The result is never worse than the start, by the same expectation. The axes themselves
/// stay: they tell positioning and lost motion directly. Some seconds; `progress` [0..1] may be empty.
std::vector<PlannedLine> search_lines(const Machine& machine, std::vector<PlannedLine> start,
                                      const Effort& effort, const GeometricPrior& prior, double misfit = 5e-8,
                                      const std::function<void(double)>& progress = {});

}  // namespace invar::metrology

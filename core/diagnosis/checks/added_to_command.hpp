// Effects on the current between controller and drive. Where the current is recorded behind them, they
// stand in the recording beside the controller's law, and no model of the plant is needed to see them.
#pragma once

#include <optional>
#include <vector>

#include "core/diagnosis/checks/late_command.hpp"

namespace invar::diagnosis {

/// The term that explains most of the recorded current beside the law, if that is more than half of the part beyond noise.
/// Tried are a wave in time, an offset, a limit, steps, a dead zone and a delay. Nothing where the rest goes with the motion by another law.
std::optional<Added> added_to_command(const Case& data, const std::vector<LawRows>& law);

/// The share of the current beyond the law that the carriage feels: 1 where it acts, 0 where only the reading of the
/// current is off. By projection of what the model leaves of the position on what such a current would do to it.
double felt_by_carriage(const Case& data, const std::vector<LawRows>& law);

/// Where the current beyond the law is of such a kind and the carriage feels it, the current is recorded behind what acts on it.
/// The model says so from then on (`current: applied`), with a clause in `data.doubts`, and the term is in `data.beside_law`.
void settle_recorded_current(Case& data);

}  // namespace invar::diagnosis

// What is added to the current, or changed in it, between controller and drive: where the current is recorded behind that, it
// stands in the recording beside the controller's law, and no model of the plant is needed to see it.
#pragma once

#include <optional>
#include <vector>

#include "core/diagnosis/checks/late_command.hpp"

namespace invar::diagnosis {

/// A wave in time, an offset, a limit, steps, a dead zone or a delay: the one that explains most of what the law leaves of the
/// recorded current, if that is more than half of what is beyond noise. Nothing where what is left goes with the motion by
/// another law.
std::optional<Added> added_to_command(const Case& data, const std::vector<LawRows>& law);

/// What the carriage feels of what the recorded current is beyond the law: 1 where it acts, 0 where only the reading of the
/// current is off. By projection of what the model leaves of the position on what such a current would do to it.
double felt_by_carriage(const Case& data, const std::vector<LawRows>& law);

/// Where what the recorded current is beyond the law is of such a kind and is felt by the carriage, the current is recorded
/// behind what acts on it: the model says so from then on (`current: applied`), with a clause in `data.doubts`, and the term is
/// in `data.beside_law`.
void settle_recorded_current(Case& data);

}  // namespace invar::diagnosis

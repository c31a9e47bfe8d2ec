// Recordings of a machine as tables: a CSV as it stands, an MCAP of the cell by what the model's columns say.
#pragma once

#include <filesystem>
#include <vector>

#include "core/physics/model.hpp"
#include "core/recording/table.hpp"

namespace invar::model {

/// The columns of a recording that the model names.
std::vector<std::string> columns_of(const physics::Model& model);

/// A `.csv` or `.csv.gz`, or any other name than .mcap, is one table in whatever form `Table::read` knows. Columns that the
/// model does not name may hold anything.
///
/// In an `.mcap` a column of the model is `component.port.field`, a field's path in the topic of that output
/// (`stage_x.state.position`); `component.port[axis=1].field` where one topic carries several instances. `a.b.c + d` adds
/// another field of the same message (setpoint plus correction). The column of `time` names the topic's
/// stamp (`stage_x.state.at`): its cycles are the rows, one a period of the loop. A row holds the newest values of other
/// topics at that time.
///
/// Where the model's column of `feedforward` is `remainder`, in a CSV too, it is made here. It is the part of the recorded
/// current that the law of the controller does not explain.
///
/// Rows in which that topic says that its axis is not enabled are left out. Each stretch between is a table of its own,
/// the longest first, and stretches under a twentieth of it are dropped. A stretch that was enabled before the recording
/// began starts where the axis stands still. Half a second of the standstill behind the last motion is kept. The tables
/// count the rows that this costs.
///
/// Throws InputError: no such topic or field, no stamp, more than `most_lost` of the cycles missing, each n-th cycle alone
/// recorded, a loop of another rate than the model's controller.
std::vector<recording::Table> read_recording(const std::filesystem::path& file, const physics::Model& model);

inline constexpr double most_lost = 0.05;

}  // namespace invar::model

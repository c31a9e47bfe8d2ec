// Recordings in, simulations out: tables of columns as the model names them, in SI.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"

namespace invar::model {

/// How a signal stood in its file: value = (si - offset) / factor.
struct ColumnUnit {
  std::string unit;
  double factor = 1.0;
  double offset = 0.0;
};

struct RecordFile {
  physics::Record record;
  std::map<std::string, ColumnUnit, std::less<>> units;  // by signal
  std::vector<std::string> doubts;  // own expressions that add what measures two things: a clause each
};

/// The model's signals out of a table, in SI; rows as they stand. Throws InputError where a column that the
/// model needs is missing or measures something else; outputs may be missing when `outputs_needed` is false.
RecordFile to_record(const recording::Table& table, const physics::Model& model, bool outputs_needed);

/// Throws InputError where a time is missing or goes back: a simulation takes rows in order.
void check_order(const physics::Model& model, const physics::Record& record,
                 const std::filesystem::path& file);

/// Time and outputs under the recording's column names, in the units that the inputs had, otherwise in SI.
recording::Table to_table(const physics::Model& model, const RecordFile& inputs,
                          const physics::Outputs& outputs);

}  // namespace invar::model

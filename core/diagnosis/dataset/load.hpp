// Loading: recordings put in order, with what cannot be used marked and counted.
#pragma once

#include <filesystem>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"
#include "core/model/record_file.hpp"

namespace invar::diagnosis {

/// Throws InputError, naming the model's file, where the user's own equations give no numbers from some row to the end.
/// The rows without numbers must be more than this share of a recording.
void check_runs(const Case& data, const physics::Model& model, double most,
                const std::filesystem::path& file);
/// Reads and cleans. Throws InputError for what is unusable.
Case load_case(const physics::Model& model, const std::vector<std::filesystem::path>& files);
/// The same of tables that are read already.
Case make_case(const physics::Model& model, const std::vector<recording::Table>& tables);

}  // namespace invar::diagnosis

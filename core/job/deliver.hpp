// deliver: a model of a job, brought to where the component that shall use it finds it.
#pragma once

#include <filesystem>
#include <string>

#include "core/component/port.hpp"
#include "core/job/task.hpp"

namespace invar::job {

/// `found`: the path for a command on `output`. Throws std::runtime_error where the file could not be brought. In simulated
/// time all within one step, so that runs repeat.
Task deliver(const Component& owner, const Port& output, std::filesystem::path file, std::string& found);

}  // namespace invar::job

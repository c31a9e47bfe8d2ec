// A recording as files that any program reads: one CSV table with units a topic, or one JSON object a message.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/recording/recording_reader.hpp"

namespace invar::recording {

struct ExportOptions {
  Selection selection{};
  bool json = false;         // a .jsonl file a topic instead of .csv
  std::size_t longest = 64;  // elements of an array or sequence that get columns
};

struct ExportedTopic {
  std::string topic, type;
  std::filesystem::path file;  // empty when nothing could be written
  std::uint64_t rows = 0;
  std::uint64_t undecodable = 0;       // messages whose payload does not fit their type
  std::vector<std::string> shortened;  // arrays and sequences of which elements are left out
  std::string problem;                 // why the topic was left out, or the first undecodable message's fault
};

struct ExportReport {
  std::vector<ExportedTopic> topics;
  std::size_t damaged_chunks = 0;
};

/// Writes into `folder` (made where it is missing). A CSV begins with `time [s]`: the stamp `at` of the sample, or the time of
/// sending where its type has none or nobody filled it. `received [s]` is the time of arrival at the recorder. Both count from
/// the recording's first message (stamps of simulated time that was recorded from outside: from the start of the
/// cell). Then come `log_time [ns]` and `publish_time [ns]` in full, `sequence`, and the fields (see Columns). A name of those
/// five that a field has too gets `recording.` before it. Files are complete or absent. Throws InputError when the folder
/// cannot be written or the selection names a topic that is not in the recording.
ExportReport export_recording(const Recording& recording, const std::filesystem::path& folder,
                              const ExportOptions& options = {});

}  // namespace invar::recording

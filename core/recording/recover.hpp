// Makes a whole file of a cut or damaged recording: everything that can be read, with indexes, summary and a new ledger.
#pragma once

#include <filesystem>

#include "core/recording/mcap_file_writer.hpp"
#include "core/recording/recording_reader.hpp"

namespace invar::recording {

struct Recovery {
  std::uint64_t messages = 0;
  std::size_t damaged_chunks = 0;  // left out
  LossLedger ledger;  // gaps and missing by the sequence numbers; lost as last noted before the cut
};

/// Writes to `target` through a temporary file beside it. Throws InputError when that cannot be written.
Recovery recover(const Recording& recording, const std::filesystem::path& target,
                 const ChunkOptions& options = {});

}  // namespace invar::recording

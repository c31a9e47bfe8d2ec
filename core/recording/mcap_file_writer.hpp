// Writes an MCAP file record by record: messages into packed chunks with their indexes, the rest between
// them, and the summary at the end. Whatever is on disk is readable if the program ends here.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "core/recording/mcap_records.hpp"

namespace invar::recording {

struct ChunkOptions {
  Compression compression = Compression::zstd;
  int level = 1;                  // Zstandard's; higher is smaller and slower
  std::size_t bytes = 1U << 20U;  // a chunk is closed when it holds this much before packing
};

/// One thread at a time. Set-up may throw; from then on a failed disk is a value (failed()), and everything
/// given after it is not written.
class McapFileWriter {
 public:
  /// Creates or empties the file. Throws InputError when that cannot be done.
  explicit McapFileWriter(const std::filesystem::path& file, const ChunkOptions& options = {});
  /// Closes the file without a summary when close() was not called.
  ~McapFileWriter();
  McapFileWriter(const McapFileWriter&) = delete;
  McapFileWriter& operator=(const McapFileWriter&) = delete;

  /// Takes one whole record: a schema, channel (each once, the schema first), message, attachment or metadata
  /// record. False when it was not written: the disk failed, or the record is of another kind.
  bool write(const mcap::Record& record);
  /// The same for a record that is still a struct.
  template <class T>
  bool write(const T& record) {
    scratch_.clear();
    mcap::append(scratch_, record);
    return write(*mcap::first_record(scratch_));
  }

  /// Closes the chunk that is being filled, so that its messages are on disk.
  bool flush();
  /// Writes the summary and the footer. False when the disk failed. No call may follow.
  bool close();

  [[nodiscard]] bool failed() const { return failed_; }
  /// On its disk, for who is not root; very many where nobody knows.
  [[nodiscard]] std::uint64_t free_bytes() const;
  [[nodiscard]] std::uint64_t bytes_written() const { return position_; }
  /// True when messages wait in the chunk being filled.
  [[nodiscard]] bool has_open_chunk() const { return !chunk_.empty(); }
  /// Messages on disk, by channel id (those of the open chunk are not yet among them); may be shorter than
  /// the ids.
  [[nodiscard]] const std::vector<std::uint64_t>& messages_on_disk() const { return on_disk_; }

 private:
  using Entries = std::vector<std::pair<Instant, std::uint64_t>>;

  bool add_message(const mcap::Record& record);
  bool put_on_disk(ByteView bytes);

  ChunkOptions options_;
  Packer packer_;
  int descriptor_ = -1;
  bool failed_ = false;
  std::uint64_t position_ = 0;

  Bytes chunk_;  // records of the chunk being filled
  Instant chunk_start_, chunk_end_;
  std::vector<Entries> chunk_entries_;  // by channel id
  Bytes out_, scratch_;

  mcap::Statistics statistics_;
  std::vector<std::uint64_t> on_disk_;  // messages by channel id
  Bytes schemas_, channels_;            // records to repeat in the summary
  std::vector<mcap::ChunkIndex> chunk_indexes_;
  std::vector<mcap::AttachmentIndex> attachment_indexes_;
  std::vector<mcap::MetadataIndex> metadata_indexes_;
};

}  // namespace invar::recording

// Reads a recording: whole, still being written, or cut off anywhere; messages come in the order of their log
// time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/recording/loss_ledger.hpp"
#include "core/recording/mcap_records.hpp"

namespace invar::recording {

/// Messages to read: log times from `from` (included) to `to` (excluded); all topics when `topics` is empty.
struct Selection {
  std::optional<Instant> from{}, to{};
  std::set<std::string> topics{};
};

/// A stretch of the file that holds messages: one chunk, or messages that stand in the file unpacked.
struct Segment {
  std::uint64_t offset = 0, length = 0;  // of the packed records in the file
  std::uint64_t size = 0;                // unpacked
  std::uint32_t crc = 0;
  Compression compression = Compression::none;
  Instant start, end;
  std::set<std::uint16_t> channels;
  bool cut = false;  // the file ends inside it
};

class MessageStream;
struct RecordingContents;

/// A file open for reading. Copies share it. It may grow meanwhile; only what was there at opening is read.
class Recording {
 public:
  /// Throws InputError when the file cannot be read, is no MCAP file, or uses a compression we do not know. A
  /// cut or partly damaged file opens; see complete() and damage().
  static Recording open(const std::filesystem::path& file);

  [[nodiscard]] const std::map<std::uint16_t, mcap::Schema>& schemas() const;
  [[nodiscard]] const std::map<std::uint16_t, mcap::Channel>& channels() const;
  /// Messages by channel, first and last log time. Counted from the messages themselves where the file has no
  /// summary.
  [[nodiscard]] const mcap::Statistics& statistics() const;
  /// Their data point into the file and live as long as a copy of this.
  [[nodiscard]] const std::vector<mcap::Attachment>& attachments() const;
  [[nodiscard]] const std::vector<mcap::Metadata>& metadata() const;
  /// The ledger that was written last; nothing when the file has none.
  [[nodiscard]] std::optional<LossLedger> ledger() const;

  /// True when the file was closed properly: summary and footer are there.
  [[nodiscard]] bool complete() const;
  /// Damage of the file, one sentence each: where it is cut, which chunks fail their CRC.
  [[nodiscard]] const std::vector<std::string>& damage() const;
  /// False where some of its data cannot be read.
  [[nodiscard]] bool has_all_data() const;
  [[nodiscard]] std::uint64_t bytes() const;

  [[nodiscard]] MessageStream messages(Selection selection = {}) const;

 private:
  explicit Recording(std::shared_ptr<const RecordingContents> contents) : contents_{std::move(contents)} {}
  std::shared_ptr<const RecordingContents> contents_;
};

/// One message as it stands in the file. `channel` lives as long as the recording, `data` until the next
/// next().
struct RecordedMessage {
  const mcap::Channel* channel = nullptr;
  std::uint32_t sequence = 0;
  Instant log_time, publish_time;
  ByteView data;
};

/// Messages of one selection in order of log time; equal times in file order. Holds a few unpacked chunks at
/// a time, at most 512 MiB of them.
class MessageStream {
 public:
  /// Nothing when there are no more. Throws InputError where more of them overlap in time.
  std::optional<RecordedMessage> next();
  /// Chunks passed over so far because their bytes are damaged.
  [[nodiscard]] std::size_t damaged_chunks() const { return damaged_; }

 private:
  friend class Recording;
  MessageStream(std::shared_ptr<const RecordingContents> contents, Selection selection);

  struct Loaded;
  void load(const Segment& segment);

  std::shared_ptr<const RecordingContents> contents_;
  Selection selection_;
  std::set<std::uint16_t> wanted_;
  std::vector<const Segment*> waiting_;          // by start time, latest first: the next one is at the back
  std::vector<std::shared_ptr<Loaded>> loaded_;  // a heap by the time of the next message
  std::shared_ptr<Loaded> handed_out_;           // where the message handed out last stands
  std::uint64_t loaded_bytes_ = 0;
  std::size_t damaged_ = 0;
};

}  // namespace invar::recording

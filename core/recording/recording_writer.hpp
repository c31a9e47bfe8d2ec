// Records messages from any thread: callers hand over bytes by a bounded queue, and an own thread packs and
// writes them. Messages that do not fit are counted in the loss ledger.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/recording/loss_ledger.hpp"
#include "core/recording/mcap_file_writer.hpp"

namespace invar::recording {

/// An earlier file of that name is never overwritten, be it of a run before or of a killed recorder. It is called
/// `name-1.mcap`, or the next free number, from now on. Returns that name; empty: there was none, or it is a device or a pipe.
std::filesystem::path keep_earlier(const std::filesystem::path& file);

/// One stream of samples: a topic as one writer sends it. Two writers of one topic are two channels, so that
/// each has its own sequence numbers.
struct ChannelInfo {
  std::string topic;
  std::string type;        // a::b::T
  std::string idl;         // self-contained IDL text that defines it
  std::string qos;         // of the writer, as text
  std::string partitions;  // comma separated
  mcap::Texts more{};      // further metadata, for example the writer's GUID
};

struct RecordingOptions {
  ChunkOptions chunks{};
  std::size_t queue_bytes = 64U << 20U;  // twice this is reserved: one half fills while the other empties
  Duration chunk_age =
      Duration::milliseconds(500);  // a chunk older than this goes to disk though it is not full
  std::uint64_t reserve_bytes =
      0;  // of the disk: what is left free, and what it is left for is the caller's to say
};

struct RecordingStatus {
  std::uint64_t bytes_written = 0;  // on disk
  std::uint64_t queue_peak = 0;     // most bytes that waited at once
  bool failed = false;              // the disk refused; everything since counts as lost
  bool at_reserve = false;  // the disk has its reserve left and no more; everything since counts as lost
};

/// Thread-safe. write() copies under a short lock and neither allocates nor touches the disk. It is not for the
/// real-time loop, which never locks: the publishing thread hands over its samples.
class RecordingWriter {
 public:
  /// Throws InputError when the file cannot be created.
  explicit RecordingWriter(const std::filesystem::path& file, const RecordingOptions& options = {});
  /// Closes, if close() was not called.
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// Set-up only. The number by which write() knows the channel. Precondition: fewer than 65,535 of them.
  std::uint16_t add_channel(const ChannelInfo& info);
  /// Hands over one sample: `payload` is CDR with its 4-byte encapsulation; `sequence` is the source's own
  /// counter (0: it has none). False when the queue is full or the disk failed; the ledger counts it.
  bool write(std::uint16_t channel, std::uint32_t sequence, Instant log_time, Instant publish_time,
             ByteView payload) noexcept;
  /// Set-up only: a file that belongs to the recording (cell file, model, map).
  void attach(const std::string& name, const std::string& media_type, ByteView content, Instant time);
  /// Set-up only: a metadata record.
  void note(const mcap::Metadata& record);

  /// As of now; what still waits in the queue counts neither as written nor as lost.
  [[nodiscard]] LossLedger ledger() const;
  [[nodiscard]] RecordingStatus status() const;

  /// Writes what waits, the ledger and the summary. False when the disk failed. A write() that comes later is
  /// lost.
  bool close();

 private:
  struct Known {
    ChannelLedger ledger;
    SequenceFollower follower;
  };

  void put_record(const auto& record);
  void run();
  bool is_at_reserve(std::size_t more);
  void write_all(ByteView batch);
  void settle_accounts();

  const RecordingOptions options_;
  McapFileWriter file_;  // the thread's own, once it runs

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  Bytes filling_;
  std::vector<Known> channels_;  // index is the channel id less one
  std::map<std::pair<std::string, std::string>, std::uint16_t> schemas_;
  RecordingStatus status_;
  bool closing_ = false;

  std::thread thread_;
};

}  // namespace invar::recording

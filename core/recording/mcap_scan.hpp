// Content of an MCAP file, found by its summary or, where there is none, by walking over it up to the cut.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/limits.hpp"
#include "core/recording/recording_reader.hpp"

namespace invar::recording {

struct RecordingContents {
  std::filesystem::path file;
  ByteView bytes;  // the whole file
  std::shared_ptr<const void> keeper;

  std::map<std::uint16_t, mcap::Schema> schemas;
  std::map<std::uint16_t, mcap::Channel> channels;
  mcap::Statistics statistics;
  std::vector<mcap::Attachment> attachments;
  std::vector<mcap::Metadata> metadata;
  std::vector<Segment> segments;
  std::vector<std::string> damage;  // the first of them
  std::size_t more_damage = 0;      // sentences that are only counted
  std::uint64_t unpacked = 0;       // [bytes] of all chunks so far
  std::uint64_t definitions = 0;    // [bytes] of schemas, channels and metadata so far
  bool complete = false;
  bool loses_data = false;  // by one of them

  void add_damage(std::string sentence) {
    loses_data = true;
    if (damage.size() < limits::mcap_damage)
      damage.push_back(std::move(sentence));
    else
      ++more_damage;
  }
  /// How much its chunks may hold together: what is packed may not grow without end.
  [[nodiscard]] std::uint64_t most_unpacked() const {
    return limits::mcap_unpacked_free + limits::mcap_unpacked_times * bytes.size();
  }
};

/// Fills the contents from the summary at the file's end. False (contents in any state) when there is none,
/// its CRC is wrong, or it does not index every message.
bool read_summary(RecordingContents& contents);

/// Fills the contents by walking over the records; unpacks every chunk, checks its CRC and counts its
/// messages.
void scan(RecordingContents& contents);

/// The records of a segment: fewer where the file is cut inside it, nothing at all where its bytes are
/// damaged.
std::optional<Bytes> records_of(const Segment& segment, ByteView file);

}  // namespace invar::recording

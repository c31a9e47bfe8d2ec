// Recordings that tests make: a folder that vanishes, messages whose content follows from their number.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "core/recording/recording_reader.hpp"
#include "core/recording/recording_writer.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::recording {

using testing::TemporaryFolder;

inline Bytes bytes_of(const std::filesystem::path& file) {
  std::ifstream in{file, std::ios::binary};
  const std::string text{std::istreambuf_iterator<char>{in}, {}};
  return {text.begin(), text.end()};
}

inline void write_bytes(const std::filesystem::path& file, ByteView bytes) {
  std::ofstream{file, std::ios::binary}.write(reinterpret_cast<const char*>(bytes.data()),
                                              static_cast<std::streamsize>(bytes.size()));
}

/// `size` bytes that only this channel and sequence have.
inline Bytes payload(std::uint16_t channel, std::uint32_t sequence, std::size_t size) {
  Bytes bytes(size);
  std::uint32_t state = channel * 2654435761U + sequence * 40503U + 1U;
  for (auto& byte : bytes) {
    state = state * 1664525U + 1013904223U;
    byte = static_cast<std::uint8_t>((state >> 24U) & 0x1FU);  // packs by a third
  }
  return bytes;
}

inline ChannelInfo channel_info(const std::string& topic) {
  return {topic,
          "test::Sample",
          "module test { @final struct Sample { octet bytes[8]; }; };",
          "reliability: reliable",
          "line-1",
          {}};
}

/// A copy of a message that outlives its chunk.
struct Kept {
  std::string topic;
  std::uint32_t sequence = 0;
  Instant log_time;
  Bytes data;
  bool operator==(const Kept&) const = default;
};

inline std::vector<Kept> all_messages(const Recording& recording, const Selection& selection = {}) {
  std::vector<Kept> all;
  auto stream = recording.messages(selection);
  while (const auto message = stream.next())
    all.push_back({message->channel->topic,
                   message->sequence,
                   message->log_time,
                   {message->data.begin(), message->data.end()}});
  return all;
}

}  // namespace invar::recording

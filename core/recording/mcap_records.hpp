// The records of an MCAP file as plain structs, their bytes, and their reading back (mcap.dev specification,
// version 0).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/time.hpp"
#include "core/recording/bytes.hpp"
#include "core/recording/compression.hpp"

namespace invar::recording::mcap {

inline constexpr std::array<std::uint8_t, 8> magic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

enum class Opcode : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  attachment = 0x09,
  attachment_index = 0x0A,
  statistics = 0x0B,
  metadata = 0x0C,
  metadata_index = 0x0D,
  summary_offset = 0x0E,
  data_end = 0x0F,
};

/// Every record is: opcode (1 byte), length of what follows (8 bytes), content.
inline constexpr std::size_t record_head = 9;

using Texts = std::map<std::string, std::string>;

struct Header {
  std::string profile, library;
};
struct Footer {
  std::uint64_t summary_start = 0, summary_offset_start = 0;
  std::uint32_t summary_crc = 0;
};
struct Schema {
  std::uint16_t id = 0;  // 0 is no schema
  std::string name, encoding, data;
};
struct Channel {
  std::uint16_t id = 0, schema_id = 0;
  std::string topic, message_encoding;
  Texts metadata;
};
/// `data` points into the buffer it was read from.
struct Message {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  Instant log_time, publish_time;
  ByteView data;
};
struct Chunk {
  Instant start, end;
  std::uint64_t size = 0;  // unpacked
  std::uint32_t crc = 0;   // of the unpacked bytes; 0 is none
  std::string compression;
  ByteView records;  // packed
};
struct ChunkIndex {
  Instant start, end;
  std::uint64_t chunk_start = 0, chunk_length = 0;
  std::map<std::uint16_t, std::uint64_t> message_indexes;  // channel to offset of its MessageIndex record
  std::uint64_t message_index_length = 0;
  std::string compression;
  std::uint64_t packed_size = 0, size = 0;
};
struct MessageIndex {
  std::uint16_t channel_id = 0;
  std::vector<std::pair<Instant, std::uint64_t>> entries;  // log time, offset within the unpacked chunk
};
struct Attachment {
  Instant log_time, create_time;
  std::string name, media_type;
  ByteView data;
  bool intact = true;  // false when the CRC says otherwise
};
struct AttachmentIndex {
  std::uint64_t offset = 0, length = 0;
  Instant log_time, create_time;
  std::uint64_t data_size = 0;
  std::string name, media_type;
};
struct Metadata {
  std::string name;
  Texts values;
};
struct MetadataIndex {
  std::uint64_t offset = 0, length = 0;
  std::string name;
};
struct Statistics {
  std::uint64_t messages = 0;
  std::uint16_t schemas = 0;
  std::uint32_t channels = 0, attachments = 0, metadata = 0, chunks = 0;
  Instant start, end;  // log times of the first and the last message; 0 when there is none
  std::map<std::uint16_t, std::uint64_t> by_channel;
};
struct SummaryOffset {
  Opcode group{};
  std::uint64_t start = 0, length = 0;
};

/// Append the whole record (head and content).
void append(Bytes& out, const Header& record);
void append(Bytes& out, const Schema& record);
void append(Bytes& out, const Channel& record);
void append(Bytes& out, const Message& record);
void append(Bytes& out, const MessageIndex& record);
void append(Bytes& out, const ChunkIndex& record);
void append(Bytes& out, const Attachment& record);
void append(Bytes& out, const AttachmentIndex& record);
void append(Bytes& out, const Metadata& record);
void append(Bytes& out, const MetadataIndex& record);
void append(Bytes& out, const Statistics& record);
void append(Bytes& out, const SummaryOffset& record);
/// The data section ends; no CRC over it, since every chunk and attachment has its own.
void append_data_end(Bytes& out);
/// The footer, whose CRC covers `out` from `summary_begin` on; then the closing magic.
void append_footer(Bytes& out, std::size_t summary_begin, Footer footer);
/// Packs `records` into a chunk record.
void append_chunk(Bytes& out, Instant start, Instant end, ByteView records, Compression compression,
                  Packer& packer);

/// Each reads a record's content (without its head); nothing when the content is shorter than it says.
std::optional<Header> parse_header(ByteView content);
std::optional<Footer> parse_footer(ByteView content);
std::optional<Schema> parse_schema(ByteView content);
std::optional<Channel> parse_channel(ByteView content);
std::optional<Message> parse_message(ByteView content);
/// `records` is what there is of it, where the file was cut inside the chunk.
std::optional<Chunk> parse_chunk(ByteView content);
std::optional<ChunkIndex> parse_chunk_index(ByteView content);
std::optional<MessageIndex> parse_message_index(ByteView content);
std::optional<Attachment> parse_attachment(ByteView content);
std::optional<AttachmentIndex> parse_attachment_index(ByteView content);
std::optional<Metadata> parse_metadata(ByteView content);
std::optional<MetadataIndex> parse_metadata_index(ByteView content);
std::optional<Statistics> parse_statistics(ByteView content);

/// One record in a row of them.
struct Record {
  Opcode opcode{};
  ByteView content;
  ByteView whole;  // with its head
};
/// The record at the front of `bytes`; nothing when it is not all there.
std::optional<Record> first_record(ByteView bytes);

}  // namespace invar::recording::mcap

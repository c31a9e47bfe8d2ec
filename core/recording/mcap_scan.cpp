#include "core/recording/mcap_scan.hpp"

#include <algorithm>
#include <string>

#include "core/base/name.hpp"
#include "core/base/shown.hpp"

namespace invar::recording {

using mcap::Opcode;

namespace {

constexpr std::size_t footer_size = mcap::record_head + 8 + 8 + 4;

std::optional<Segment> segment_of(const mcap::Chunk& chunk, ByteView file) {
  const auto compression = compression_named(chunk.compression);
  if (!compression) return std::nullopt;
  Segment segment;
  segment.offset = static_cast<std::uint64_t>(chunk.records.data() - file.data());
  segment.length = chunk.records.size();
  segment.size = chunk.size;
  segment.crc = chunk.crc;
  segment.compression = *compression;
  segment.start = chunk.start;
  segment.end = chunk.end;
  return segment;
}

/// Counts a message into the statistics and into the segment that it stands in.
void count(const mcap::Message& message, mcap::Statistics& statistics, Segment& segment) {
  const Instant time = message.log_time;
  statistics.start = statistics.messages == 0 ? time : std::min(statistics.start, time);
  statistics.end = statistics.messages == 0 ? time : std::max(statistics.end, time);
  ++statistics.messages;
  ++statistics.by_channel[message.channel_id];
  segment.start = segment.channels.empty() ? time : std::min(segment.start, time);
  segment.end = segment.channels.empty() ? time : std::max(segment.end, time);
  segment.channels.insert(message.channel_id);
}

/// Texts are copied out of the file, several times what they have there: together they are bounded.
bool has_room(RecordingContents& contents, std::size_t bytes) {
  const bool before = contents.definitions <= limits::mcap_definitions;
  contents.definitions += bytes;
  if (contents.definitions <= limits::mcap_definitions) return true;
  if (before)
    contents.add_damage("its schemas, channels and metadata have more than " +
                        std::to_string(limits::mcap_definitions / limits::mib) +
                        " MiB; those beyond are left out");
  return false;
}

void add_definition(RecordingContents& contents, const mcap::Record& record) {
  if (record.opcode != Opcode::schema && record.opcode != Opcode::channel) return;
  if (!has_room(contents, record.content.size())) return;
  if (record.opcode == Opcode::schema) {
    if (auto schema = mcap::parse_schema(record.content))
      contents.schemas.emplace(schema->id, std::move(*schema));
  } else if (record.opcode == Opcode::channel) {
    auto channel = mcap::parse_channel(record.content);
    if (!channel) return;
    if (const auto flaw = flaw_of_label(channel->topic, longest_topic))
      contents.add_damage("the name of channel " + std::to_string(channel->id) + ", `" +
                          clipped(printable(channel->topic)) + "`, " + flaw->what + "; it is left out");
    else
      contents.channels.emplace(channel->id, std::move(*channel));
  }
}

void scan_chunk(RecordingContents& contents, const mcap::Chunk& chunk, bool cut) {
  const std::string where =
      "the chunk at byte " + std::to_string(chunk.records.data() - contents.bytes.data());
  auto segment = segment_of(chunk, contents.bytes);
  if (!segment) {
    contents.add_damage(where + " is packed by `" + clipped(printable(chunk.compression)) +
                        "`, which is not known here");
    return;
  }
  if (chunk.size > limits::mcap_chunk || contents.unpacked + chunk.size > contents.most_unpacked()) {
    contents.add_damage(where + " unpacks to " + std::to_string(chunk.size / limits::mib) + " MiB, " +
                        (chunk.size > limits::mcap_chunk ? "more than one chunk may"
                                                         : "with those before more than its size allows") +
                        "; its messages are left out");
    return;
  }
  contents.unpacked += chunk.size;
  segment->cut = cut;
  const auto records = records_of(*segment, contents.bytes);
  if (!records) {
    contents.add_damage(where + " is damaged (its CRC does not match); its messages are left out");
    return;
  }
  ++contents.statistics.chunks;
  ByteView rest = *records;
  while (const auto record = mcap::first_record(rest)) {
    rest = rest.subspan(record->whole.size());
    add_definition(contents, *record);
    if (record->opcode != Opcode::message) continue;
    if (const auto message = mcap::parse_message(record->content))
      count(*message, contents.statistics, *segment);
  }
  if (!segment->channels.empty()) contents.segments.push_back(std::move(*segment));
}

/// The chunk that the file ends in, as far as it goes.
void scan_cut_chunk(RecordingContents& contents, ByteView rest) {
  if (rest.size() < mcap::record_head || rest[0] != static_cast<std::uint8_t>(Opcode::chunk)) return;
  if (const auto chunk = mcap::parse_chunk(rest.subspan(mcap::record_head)))
    scan_chunk(contents, *chunk, true);
}

bool add_attachment(RecordingContents& contents, ByteView content, std::uint64_t offset) {
  auto attachment = mcap::parse_attachment(content);
  if (!attachment) return false;
  if (!attachment->intact)
    contents.add_damage("the attachment `" + clipped(printable(attachment->name)) + "` at byte " +
                        std::to_string(offset) + " is damaged (its CRC does not match)");
  contents.attachments.push_back(std::move(*attachment));
  return true;
}

/// The record that an index entry points at; nothing when it is not one of that kind.
std::optional<mcap::Record> record_at(ByteView file, std::uint64_t offset, Opcode opcode) {
  if (offset > file.size()) return std::nullopt;
  const auto record = mcap::first_record(file.subspan(offset));
  return record && record->opcode == opcode ? record : std::nullopt;
}

/// Messages that a chunk's indexes list, by the indexes' size: 15 bytes each and 16 an entry.
std::uint64_t indexed_messages(const mcap::ChunkIndex& index) {
  const std::uint64_t heads = 15 * index.message_indexes.size();
  return index.message_index_length >= heads ? (index.message_index_length - heads) / 16 : 0;
}

bool add_from_summary(RecordingContents& contents, const mcap::Record& record, std::uint64_t& indexed) {
  switch (record.opcode) {
    case Opcode::statistics: {
      auto statistics = mcap::parse_statistics(record.content);
      if (!statistics) return false;
      contents.statistics = std::move(*statistics);
      return true;
    }
    case Opcode::chunk_index: {
      const auto index = mcap::parse_chunk_index(record.content);
      if (!index) return false;
      const auto at = record_at(contents.bytes, index->chunk_start, Opcode::chunk);
      const auto chunk = at ? mcap::parse_chunk(at->content) : std::nullopt;
      auto segment = chunk ? segment_of(*chunk, contents.bytes) : std::nullopt;
      if (!segment || segment->size > limits::mcap_chunk) return false;
      contents.unpacked += segment->size;
      if (contents.unpacked > contents.most_unpacked()) return false;
      for (const auto& [channel, offset] : index->message_indexes) segment->channels.insert(channel);
      contents.segments.push_back(std::move(*segment));
      indexed += indexed_messages(*index);
      return true;
    }
    case Opcode::attachment_index: {
      const auto index = mcap::parse_attachment_index(record.content);
      const auto at = index ? record_at(contents.bytes, index->offset, Opcode::attachment) : std::nullopt;
      return at && add_attachment(contents, at->content, index->offset);
    }
    case Opcode::metadata_index: {
      const auto index = mcap::parse_metadata_index(record.content);
      const auto at = index ? record_at(contents.bytes, index->offset, Opcode::metadata) : std::nullopt;
      const bool kept = at && has_room(contents, at->content.size());
      auto metadata = kept ? mcap::parse_metadata(at->content) : std::nullopt;
      if (!metadata) return false;
      contents.metadata.push_back(std::move(*metadata));
      return true;
    }
    default:
      add_definition(contents, record);
      return true;
  }
}

}  // namespace

std::optional<Bytes> records_of(const Segment& segment, ByteView file) {
  const ByteView packed =
      file.subspan(static_cast<std::size_t>(segment.offset), static_cast<std::size_t>(segment.length));
  Bytes records = unpack(segment.compression, packed, segment.size);
  if (segment.cut) return records;
  if (records.size() != segment.size) return std::nullopt;
  if (segment.crc != 0 && crc32_of(records) != segment.crc) return std::nullopt;
  return records;
}

bool read_summary(RecordingContents& contents) {
  const ByteView file = contents.bytes;
  if (file.size() < 2 * mcap::magic.size() + footer_size) return false;
  const std::size_t footer_at = file.size() - mcap::magic.size() - footer_size;
  if (!std::equal(mcap::magic.begin(), mcap::magic.end(), file.end() - mcap::magic.size())) return false;
  const auto record = mcap::first_record(file.subspan(footer_at));
  if (!record || record->opcode != Opcode::footer) return false;
  const auto footer = mcap::parse_footer(record->content);
  if (!footer) return false;
  contents.complete = true;
  if (footer->summary_start == 0 || footer->summary_start > footer_at) return false;
  const auto begin = static_cast<std::size_t>(footer->summary_start);
  const std::size_t covered = footer_at + footer_size - sizeof(std::uint32_t) - begin;
  if (footer->summary_crc != 0 && footer->summary_crc != crc32_of(file.subspan(begin, covered))) return false;
  ByteView rest = file.subspan(begin, footer_at - begin);
  std::uint64_t indexed = 0;
  while (const auto next = mcap::first_record(rest)) {
    rest = rest.subspan(next->whole.size());
    if (!add_from_summary(contents, *next, indexed)) return false;
  }
  return rest.empty() && indexed == contents.statistics.messages;
}

void scan(RecordingContents& contents) {
  ByteView rest = contents.bytes.subspan(std::min(mcap::magic.size(), contents.bytes.size()));
  const auto offset = [&] { return contents.bytes.size() - rest.size(); };
  Segment loose;  // a run of messages outside of any chunk
  const auto end_run = [&] {
    if (loose.length == 0) return;
    loose.size = loose.length;
    contents.segments.push_back(std::move(loose));
    loose = {};
  };
  bool ended = false;
  while (!ended) {
    const auto record = mcap::first_record(rest);
    if (!record) break;
    if (record->opcode != Opcode::message) end_run();
    switch (record->opcode) {
      case Opcode::message:
        if (const auto message = mcap::parse_message(record->content)) {
          if (loose.length == 0) loose.offset = offset();
          loose.length += record->whole.size();
          count(*message, contents.statistics, loose);
        }
        break;
      case Opcode::chunk:
        if (const auto chunk = mcap::parse_chunk(record->content)) scan_chunk(contents, *chunk, false);
        break;
      case Opcode::attachment:
        if (add_attachment(contents, record->content, offset())) ++contents.statistics.attachments;
        break;
      case Opcode::metadata:
        if (!has_room(contents, record->content.size())) break;
        if (auto metadata = mcap::parse_metadata(record->content)) {
          contents.metadata.push_back(std::move(*metadata));
          ++contents.statistics.metadata;
        }
        break;
      case Opcode::data_end:
        ended = true;
        break;
      default:
        add_definition(contents, *record);
        break;
    }
    rest = rest.subspan(record->whole.size());
  }
  end_run();
  if (!ended) scan_cut_chunk(contents, rest);
  contents.statistics.schemas = static_cast<std::uint16_t>(contents.schemas.size());
  contents.statistics.channels = static_cast<std::uint32_t>(contents.channels.size());
  if (!ended)
    contents.add_damage("the file ends at byte " + std::to_string(contents.bytes.size()) +
                        " without its end; it is read up to there");
  else if (!contents.complete)
    contents.damage.push_back("the file's summary is missing; all its data are there");
  if (contents.more_damage > 0)
    contents.damage.back() += " (and " + std::to_string(contents.more_damage) + " more of such faults)";
}

}  // namespace invar::recording

#include "core/recording/mcap_records.hpp"

#include <algorithm>

namespace invar::recording::mcap {

namespace {

/// Writes the head with a length to be filled in, and fills it in when it goes out of scope.
class Open {
 public:
  Open(Bytes& out, Opcode opcode) : out_{out}, begin_{out.size()} {
    out_.push_back(static_cast<std::uint8_t>(opcode));
    put(out_, std::uint64_t{0});
  }
  ~Open() { store(out_.data() + begin_ + 1, std::uint64_t{out_.size() - begin_ - record_head}); }
  Open(const Open&) = delete;
  Open& operator=(const Open&) = delete;

 private:
  Bytes& out_;
  std::size_t begin_;
};

void put_time(Bytes& out, Instant time) { put(out, static_cast<std::uint64_t>(time.ns)); }
Instant take_time(Cursor& in) { return {static_cast<std::int64_t>(in.take<std::uint64_t>())}; }

/// A map or array as MCAP writes it: length in bytes (32 bit), then the entries.
template <class Entries, class PutEntry>
void put_entries(Bytes& out, const Entries& entries, PutEntry put_entry) {
  const std::size_t begin = out.size();
  put(out, std::uint32_t{0});
  for (const auto& entry : entries) put_entry(entry);
  store(out.data() + begin, static_cast<std::uint32_t>(out.size() - begin - sizeof(std::uint32_t)));
}

void put_texts(Bytes& out, const Texts& texts) {
  put_entries(out, texts, [&](const auto& entry) {
    put_text(out, entry.first);
    put_text(out, entry.second);
  });
}

void put_counts(Bytes& out, const std::map<std::uint16_t, std::uint64_t>& counts) {
  put_entries(out, counts, [&](const auto& entry) {
    put(out, entry.first);
    put(out, entry.second);
  });
}

/// Calls `take_entry` until the entries' bytes are used up; false when they end within an entry.
template <class TakeEntry>
bool take_entries(Cursor& in, TakeEntry take_entry) {
  Cursor entries{in.bytes(in.take<std::uint32_t>())};
  while (entries.ok() && !entries.empty()) take_entry(entries);
  return in.ok() && entries.ok();
}

bool take_texts(Cursor& in, Texts& texts) {
  return take_entries(in, [&](Cursor& entry) {
    std::string key{entry.text()};
    texts[std::move(key)] = std::string{entry.text()};
  });
}

bool take_counts(Cursor& in, std::map<std::uint16_t, std::uint64_t>& counts) {
  return take_entries(in, [&](Cursor& entry) {
    const auto key = entry.take<std::uint16_t>();
    counts[key] = entry.take<std::uint64_t>();
  });
}

template <class T>
std::optional<T> complete(const Cursor& in, T record) {
  return in.ok() ? std::optional<T>{std::move(record)} : std::nullopt;
}

}  // namespace

void append(Bytes& out, const Header& record) {
  const Open open{out, Opcode::header};
  put_text(out, record.profile);
  put_text(out, record.library);
}

void append(Bytes& out, const Schema& record) {
  const Open open{out, Opcode::schema};
  put(out, record.id);
  put_text(out, record.name);
  put_text(out, record.encoding);
  put_text(out, record.data);
}

void append(Bytes& out, const Channel& record) {
  const Open open{out, Opcode::channel};
  put(out, record.id);
  put(out, record.schema_id);
  put_text(out, record.topic);
  put_text(out, record.message_encoding);
  put_texts(out, record.metadata);
}

void append(Bytes& out, const Message& record) {
  constexpr std::size_t fields = 2 + 4 + 8 + 8;
  std::array<std::uint8_t, record_head + fields> head;
  head[0] = static_cast<std::uint8_t>(Opcode::message);
  store(&head[1], std::uint64_t{fields + record.data.size()});
  store(&head[9], record.channel_id);
  store(&head[11], record.sequence);
  store(&head[15], static_cast<std::uint64_t>(record.log_time.ns));
  store(&head[23], static_cast<std::uint64_t>(record.publish_time.ns));
  out.insert(out.end(), head.begin(), head.end());
  put(out, record.data);
}

void append(Bytes& out, const MessageIndex& record) {
  const Open open{out, Opcode::message_index};
  put(out, record.channel_id);
  put_entries(out, record.entries, [&](const auto& entry) {
    put_time(out, entry.first);
    put(out, entry.second);
  });
}

void append(Bytes& out, const ChunkIndex& record) {
  const Open open{out, Opcode::chunk_index};
  put_time(out, record.start);
  put_time(out, record.end);
  put(out, record.chunk_start);
  put(out, record.chunk_length);
  put_counts(out, record.message_indexes);
  put(out, record.message_index_length);
  put_text(out, record.compression);
  put(out, record.packed_size);
  put(out, record.size);
}

void append(Bytes& out, const Attachment& record) {
  const Open open{out, Opcode::attachment};
  const std::size_t begin = out.size();
  put_time(out, record.log_time);
  put_time(out, record.create_time);
  put_text(out, record.name);
  put_text(out, record.media_type);
  put(out, std::uint64_t{record.data.size()});
  put(out, record.data);
  put(out, crc32_of(ByteView{out}.subspan(begin)));
}

void append(Bytes& out, const AttachmentIndex& record) {
  const Open open{out, Opcode::attachment_index};
  put(out, record.offset);
  put(out, record.length);
  put_time(out, record.log_time);
  put_time(out, record.create_time);
  put(out, record.data_size);
  put_text(out, record.name);
  put_text(out, record.media_type);
}

void append(Bytes& out, const Metadata& record) {
  const Open open{out, Opcode::metadata};
  put_text(out, record.name);
  put_texts(out, record.values);
}

void append(Bytes& out, const MetadataIndex& record) {
  const Open open{out, Opcode::metadata_index};
  put(out, record.offset);
  put(out, record.length);
  put_text(out, record.name);
}

void append(Bytes& out, const Statistics& record) {
  const Open open{out, Opcode::statistics};
  put(out, record.messages);
  put(out, record.schemas);
  put(out, record.channels);
  put(out, record.attachments);
  put(out, record.metadata);
  put(out, record.chunks);
  put_time(out, record.start);
  put_time(out, record.end);
  put_counts(out, record.by_channel);
}

void append(Bytes& out, const SummaryOffset& record) {
  const Open open{out, Opcode::summary_offset};
  out.push_back(static_cast<std::uint8_t>(record.group));
  put(out, record.start);
  put(out, record.length);
}

void append_data_end(Bytes& out) {
  const Open open{out, Opcode::data_end};
  put(out, std::uint32_t{0});
}

void append_footer(Bytes& out, std::size_t summary_begin, Footer footer) {
  {
    const Open open{out, Opcode::footer};
    put(out, footer.summary_start);
    put(out, footer.summary_offset_start);
    put(out, std::uint32_t{0});
  }
  // The CRC covers the footer's own head and offsets too: everything but the CRC itself.
  const std::size_t at = out.size() - sizeof(std::uint32_t);
  store(out.data() + at, crc32_of(ByteView{out}.subspan(summary_begin, at - summary_begin)));
  put(out, ByteView{magic});
}

void append_chunk(Bytes& out, Instant start, Instant end, ByteView records, Compression compression,
                  Packer& packer) {
  const Open open{out, Opcode::chunk};
  put_time(out, start);
  put_time(out, end);
  put(out, std::uint64_t{records.size()});
  put(out, crc32_of(records));
  put_text(out, name_of(compression));
  const std::size_t length_at = out.size();
  put(out, std::uint64_t{0});
  packer.pack(records, out);
  store(out.data() + length_at, std::uint64_t{out.size() - length_at - sizeof(std::uint64_t)});
}

std::optional<Header> parse_header(ByteView content) {
  Cursor in{content};
  Header record;
  record.profile = in.text();
  record.library = in.text();
  return complete(in, std::move(record));
}

std::optional<Footer> parse_footer(ByteView content) {
  Cursor in{content};
  Footer record;
  record.summary_start = in.take<std::uint64_t>();
  record.summary_offset_start = in.take<std::uint64_t>();
  record.summary_crc = in.take<std::uint32_t>();
  return complete(in, record);
}

std::optional<Schema> parse_schema(ByteView content) {
  Cursor in{content};
  Schema record;
  record.id = in.take<std::uint16_t>();
  record.name = in.text();
  record.encoding = in.text();
  record.data = in.text();
  return complete(in, std::move(record));
}

std::optional<Channel> parse_channel(ByteView content) {
  Cursor in{content};
  Channel record;
  record.id = in.take<std::uint16_t>();
  record.schema_id = in.take<std::uint16_t>();
  record.topic = in.text();
  record.message_encoding = in.text();
  if (!take_texts(in, record.metadata)) return std::nullopt;
  return complete(in, std::move(record));
}

std::optional<Message> parse_message(ByteView content) {
  Cursor in{content};
  Message record;
  record.channel_id = in.take<std::uint16_t>();
  record.sequence = in.take<std::uint32_t>();
  record.log_time = take_time(in);
  record.publish_time = take_time(in);
  record.data = in.rest();
  return complete(in, record);
}

std::optional<Chunk> parse_chunk(ByteView content) {
  Cursor in{content};
  Chunk record;
  record.start = take_time(in);
  record.end = take_time(in);
  record.size = in.take<std::uint64_t>();
  record.crc = in.take<std::uint32_t>();
  record.compression = in.text();
  const auto length = in.take<std::uint64_t>();
  record.records = in.rest();
  if (record.records.size() > length) record.records = record.records.first(static_cast<std::size_t>(length));
  return complete(in, std::move(record));
}

std::optional<ChunkIndex> parse_chunk_index(ByteView content) {
  Cursor in{content};
  ChunkIndex record;
  record.start = take_time(in);
  record.end = take_time(in);
  record.chunk_start = in.take<std::uint64_t>();
  record.chunk_length = in.take<std::uint64_t>();
  if (!take_counts(in, record.message_indexes)) return std::nullopt;
  record.message_index_length = in.take<std::uint64_t>();
  record.compression = in.text();
  record.packed_size = in.take<std::uint64_t>();
  record.size = in.take<std::uint64_t>();
  return complete(in, std::move(record));
}

std::optional<MessageIndex> parse_message_index(ByteView content) {
  Cursor in{content};
  MessageIndex record;
  record.channel_id = in.take<std::uint16_t>();
  const bool whole = take_entries(in, [&](Cursor& entry) {
    const Instant time = take_time(entry);
    record.entries.emplace_back(time, entry.take<std::uint64_t>());
  });
  if (!whole) return std::nullopt;
  return complete(in, std::move(record));
}

std::optional<Attachment> parse_attachment(ByteView content) {
  Cursor in{content};
  Attachment record;
  record.log_time = take_time(in);
  record.create_time = take_time(in);
  record.name = in.text();
  record.media_type = in.text();
  record.data = in.bytes(in.take<std::uint64_t>());
  const std::size_t covered = content.size() - in.rest().size();
  const auto crc = in.take<std::uint32_t>();
  if (!in.ok()) return std::nullopt;
  record.intact = crc == 0 || crc == crc32_of(content.first(covered));
  return record;
}

std::optional<AttachmentIndex> parse_attachment_index(ByteView content) {
  Cursor in{content};
  AttachmentIndex record;
  record.offset = in.take<std::uint64_t>();
  record.length = in.take<std::uint64_t>();
  record.log_time = take_time(in);
  record.create_time = take_time(in);
  record.data_size = in.take<std::uint64_t>();
  record.name = in.text();
  record.media_type = in.text();
  return complete(in, std::move(record));
}

std::optional<Metadata> parse_metadata(ByteView content) {
  Cursor in{content};
  Metadata record;
  record.name = in.text();
  if (!take_texts(in, record.values)) return std::nullopt;
  return complete(in, std::move(record));
}

std::optional<MetadataIndex> parse_metadata_index(ByteView content) {
  Cursor in{content};
  MetadataIndex record;
  record.offset = in.take<std::uint64_t>();
  record.length = in.take<std::uint64_t>();
  record.name = in.text();
  return complete(in, std::move(record));
}

std::optional<Statistics> parse_statistics(ByteView content) {
  Cursor in{content};
  Statistics record;
  record.messages = in.take<std::uint64_t>();
  record.schemas = in.take<std::uint16_t>();
  record.channels = in.take<std::uint32_t>();
  record.attachments = in.take<std::uint32_t>();
  record.metadata = in.take<std::uint32_t>();
  record.chunks = in.take<std::uint32_t>();
  record.start = take_time(in);
  record.end = take_time(in);
  if (!take_counts(in, record.by_channel)) return std::nullopt;
  return complete(in, std::move(record));
}

std::optional<Record> first_record(ByteView bytes) {
  Cursor in{bytes};
  Record record;
  record.opcode = static_cast<Opcode>(in.take<std::uint8_t>());
  record.content = in.bytes(in.take<std::uint64_t>());
  if (!in.ok()) return std::nullopt;
  record.whole = bytes.first(record_head + record.content.size());
  return record;
}

}  // namespace invar::recording::mcap

#include "core/recording/mcap_file_writer.hpp"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/base/contract.hpp"
#include "core/base/fault.hpp"
#include "core/base/new_file.hpp"

namespace invar::recording {

using mcap::Opcode;

McapFileWriter::McapFileWriter(const std::filesystem::path& file, const ChunkOptions& options)
    : options_{options}, packer_{options.compression, options.level} {
  descriptor_ = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, new_file_mode);
  if (descriptor_ < 0)
    throw InputError{file.string(), std::string{"cannot be created: "} + std::strerror(errno),
                     "check the folder, its permissions and the space left"};
  chunk_.reserve(options_.bytes + options_.bytes / 4);
  put(out_, ByteView{mcap::magic});
  mcap::append(out_, mcap::Header{"", "invar"});
  put_on_disk(out_);
}

std::uint64_t McapFileWriter::free_bytes() const {
  struct statvfs disk {};
  if (fstatvfs(descriptor_, &disk) != 0) return UINT64_MAX;
  return std::uint64_t{disk.f_bavail} * disk.f_frsize;
}

McapFileWriter::~McapFileWriter() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

bool McapFileWriter::put_on_disk(ByteView bytes) {
  while (!failed_ && !bytes.empty()) {
    const ssize_t done = ::write(descriptor_, bytes.data(), bytes.size());
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) {
      failed_ = true;
      break;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(done));
    position_ += static_cast<std::uint64_t>(done);
  }
  return !failed_;
}

bool McapFileWriter::write(const mcap::Record& record) {
  if (failed_) return false;
  const std::uint64_t offset = position_;
  const std::uint64_t length = record.whole.size();
  switch (record.opcode) {
    case Opcode::message:
      return add_message(record);
    case Opcode::schema:
      put(schemas_, record.whole);
      ++statistics_.schemas;
      return put_on_disk(record.whole);
    case Opcode::channel:
      put(channels_, record.whole);
      ++statistics_.channels;
      return put_on_disk(record.whole);
    case Opcode::attachment: {
      const auto it = mcap::parse_attachment(record.content);
      if (!it || !put_on_disk(record.whole)) return false;
      attachment_indexes_.push_back(
          {offset, length, it->log_time, it->create_time, it->data.size(), it->name, it->media_type});
      ++statistics_.attachments;
      return true;
    }
    case Opcode::metadata: {
      const auto it = mcap::parse_metadata(record.content);
      if (!it || !put_on_disk(record.whole)) return false;
      metadata_indexes_.push_back({offset, length, it->name});
      ++statistics_.metadata;
      return true;
    }
    default:
      return false;
  }
}

bool McapFileWriter::add_message(const mcap::Record& record) {
  const auto message = mcap::parse_message(record.content);
  if (!message) return false;
  const std::size_t channel = message->channel_id;
  if (channel >= chunk_entries_.size()) chunk_entries_.resize(channel + 1);
  const Instant time = message->log_time;
  chunk_start_ = chunk_.empty() ? time : std::min(chunk_start_, time);
  chunk_end_ = chunk_.empty() ? time : std::max(chunk_end_, time);
  statistics_.start = statistics_.messages == 0 ? time : std::min(statistics_.start, time);
  statistics_.end = statistics_.messages == 0 ? time : std::max(statistics_.end, time);
  chunk_entries_[channel].emplace_back(time, chunk_.size());
  put(chunk_, record.whole);
  ++statistics_.messages;
  return chunk_.size() < options_.bytes || flush();
}

bool McapFileWriter::flush() {
  if (failed_) return false;
  if (chunk_.empty()) return true;
  mcap::ChunkIndex index;
  index.start = chunk_start_;
  index.end = chunk_end_;
  index.chunk_start = position_;
  index.compression = name_of(options_.compression);
  index.size = chunk_.size();
  out_.clear();
  mcap::append_chunk(out_, chunk_start_, chunk_end_, chunk_, options_.compression, packer_);
  index.chunk_length = out_.size();
  // Head, two times, size, CRC, name of the compression, length: what stands before the packed records.
  index.packed_size = out_.size() - (mcap::record_head + 8 + 8 + 8 + 4 + 4 + index.compression.size() + 8);
  for (std::size_t channel = 0; channel < chunk_entries_.size(); ++channel) {
    Entries& entries = chunk_entries_[channel];
    if (entries.empty()) continue;
    const auto id = static_cast<std::uint16_t>(channel);
    std::stable_sort(entries.begin(), entries.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    index.message_indexes[id] = index.chunk_start + out_.size();
    mcap::MessageIndex record{id, std::move(entries)};
    mcap::append(out_, record);
    entries = std::move(record.entries);  // keeps its memory for the next chunk
  }
  index.message_index_length = out_.size() - index.chunk_length;
  chunk_.clear();
  if (!put_on_disk(out_)) return false;
  on_disk_.resize(chunk_entries_.size());
  for (std::size_t channel = 0; channel < chunk_entries_.size(); ++channel) {
    on_disk_[channel] += chunk_entries_[channel].size();
    chunk_entries_[channel].clear();
  }
  chunk_indexes_.push_back(std::move(index));
  ++statistics_.chunks;
  return true;
}

bool McapFileWriter::close() {
  INVAR_EXPECTS(descriptor_ >= 0);
  flush();
  out_.clear();
  mcap::append_data_end(out_);
  const std::size_t summary_begin = out_.size();
  std::vector<mcap::SummaryOffset> groups;
  const auto group = [&](Opcode opcode, auto&& put_records) {
    const std::size_t begin = out_.size();
    put_records();
    if (out_.size() > begin) groups.push_back({opcode, position_ + begin, out_.size() - begin});
  };
  for (std::size_t channel = 0; channel < on_disk_.size(); ++channel)
    if (on_disk_[channel] > 0)
      statistics_.by_channel[static_cast<std::uint16_t>(channel)] = on_disk_[channel];
  const auto put_all = [&](const auto& records) {
    for (const auto& record : records) mcap::append(out_, record);
  };
  group(Opcode::schema, [&] { put(out_, schemas_); });
  group(Opcode::channel, [&] { put(out_, channels_); });
  group(Opcode::statistics, [&] { mcap::append(out_, statistics_); });
  group(Opcode::chunk_index, [&] { put_all(chunk_indexes_); });
  group(Opcode::attachment_index, [&] { put_all(attachment_indexes_); });
  group(Opcode::metadata_index, [&] { put_all(metadata_indexes_); });
  const std::size_t offsets_begin = out_.size();
  put_all(groups);
  mcap::append_footer(out_, summary_begin, {position_ + summary_begin, position_ + offsets_begin, 0});
  put_on_disk(out_);
  if (::fsync(descriptor_) != 0 && errno != EINVAL && errno != EROFS) failed_ = true;
  if (::close(descriptor_) != 0) failed_ = true;
  descriptor_ = -1;
  return !failed_;
}

}  // namespace invar::recording

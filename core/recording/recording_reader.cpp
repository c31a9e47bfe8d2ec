#include "core/recording/recording_reader.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "core/base/fault.hpp"
#include "core/base/input_file.hpp"
#include "core/base/limits.hpp"
#include "core/recording/mcap_scan.hpp"

namespace invar::recording {

namespace {

/// Maps the file. It may grow while it is mapped; it must not be shortened by others meanwhile.
void map_file(const std::filesystem::path& file, RecordingContents& contents) {
  const auto refuse = [&](int error) {
    return InputError{file.string(), std::string{"cannot be read: "} + std::strerror(error),
                      "name a recording (.mcap)"};
  };
  note_input(file);
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe is not waited for
  if (descriptor < 0) throw refuse(errno);
  struct stat about {};
  int error = ::fstat(descriptor, &about) != 0 ? errno
              : S_ISREG(about.st_mode)         ? 0
              : S_ISDIR(about.st_mode)         ? EISDIR
                                               : ESPIPE;
  const auto size = static_cast<std::size_t>(error == 0 ? about.st_size : 0);
  void* begin = nullptr;
  if (error == 0 && size > 0) {
    begin = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
    if (begin == MAP_FAILED) error = errno;
  }
  ::close(descriptor);
  if (error != 0) throw refuse(error);
  if (begin == nullptr) return;
  contents.bytes = {static_cast<const std::uint8_t*>(begin), size};
  contents.keeper = std::shared_ptr<const void>{begin, [begin, size](const void*) { ::munmap(begin, size); }};
}

}  // namespace

Recording Recording::open(const std::filesystem::path& file) {
  auto contents = std::make_shared<RecordingContents>();
  contents->file = file;
  map_file(file, *contents);
  const std::size_t head = std::min(contents->bytes.size(), mcap::magic.size());
  if (!std::equal(contents->bytes.begin(), contents->bytes.begin() + static_cast<std::ptrdiff_t>(head),
                  mcap::magic.begin()))
    throw InputError{file.string(), "is no MCAP file", "name a recording (.mcap)"};
  if (!read_summary(*contents)) {
    auto anew = std::make_shared<RecordingContents>();
    anew->file = file;
    anew->bytes = contents->bytes;
    anew->keeper = contents->keeper;
    anew->complete = contents->complete;
    contents = std::move(anew);
    scan(*contents);
  }
  return Recording{std::move(contents)};
}

const std::map<std::uint16_t, mcap::Schema>& Recording::schemas() const { return contents_->schemas; }
const std::map<std::uint16_t, mcap::Channel>& Recording::channels() const { return contents_->channels; }
const mcap::Statistics& Recording::statistics() const { return contents_->statistics; }
const std::vector<mcap::Attachment>& Recording::attachments() const { return contents_->attachments; }
const std::vector<mcap::Metadata>& Recording::metadata() const { return contents_->metadata; }
bool Recording::complete() const { return contents_->complete; }
const std::vector<std::string>& Recording::damage() const { return contents_->damage; }
bool Recording::has_all_data() const { return !contents_->loses_data; }
std::uint64_t Recording::bytes() const { return contents_->bytes.size(); }

std::optional<LossLedger> Recording::ledger() const {
  const auto& all = metadata();
  const auto last = std::find_if(all.rbegin(), all.rend(),
                                 [](const auto& record) { return record.name == LossLedger::name; });
  return last == all.rend() ? std::nullopt : std::optional{LossLedger::from(*last)};
}

MessageStream Recording::messages(Selection selection) const {
  return MessageStream{contents_, std::move(selection)};
}

struct MessageStream::Loaded {
  struct Entry {
    Instant time;
    ByteView content;
  };
  const Segment* segment = nullptr;
  Bytes records;
  std::vector<Entry> entries;  // by time
  std::size_t next = 0;

  /// By the time of its next message, equal ones in file order: the latest first, as a heap wants it.
  static bool is_later(const std::shared_ptr<Loaded>& a, const std::shared_ptr<Loaded>& b) {
    const auto key = [](const Loaded& it) { return std::pair{it.entries[it.next].time, it.segment->offset}; };
    return key(*a) > key(*b);
  }
};

MessageStream::MessageStream(std::shared_ptr<const RecordingContents> contents, Selection selection)
    : contents_{std::move(contents)}, selection_{std::move(selection)} {
  for (const auto& [id, channel] : contents_->channels)
    if (selection_.topics.empty() || selection_.topics.contains(channel.topic)) wanted_.insert(id);
  for (const Segment& segment : contents_->segments) {
    if (selection_.from && segment.end < *selection_.from) continue;
    if (selection_.to && segment.start >= *selection_.to) continue;
    const auto is_wanted = [&](std::uint16_t id) { return wanted_.contains(id); };
    if (std::any_of(segment.channels.begin(), segment.channels.end(), is_wanted))
      waiting_.push_back(&segment);
  }
  std::sort(waiting_.begin(), waiting_.end(), [](const Segment* a, const Segment* b) {
    return std::pair{a->start, a->offset} > std::pair{b->start, b->offset};
  });
}

void MessageStream::load(const Segment& segment) {
  if (loaded_bytes_ + segment.size > limits::mcap_loaded && !loaded_.empty())
    throw InputError{contents_->file.string(),
                     "its chunks overlap in time, more than " +
                         std::to_string(limits::mcap_loaded / limits::mib) + " MiB of them at once",
                     "record again, or write it anew by a program that orders its messages"};
  auto records = records_of(segment, contents_->bytes);
  if (!records) {
    ++damaged_;
    return;
  }
  auto loaded = std::make_shared<Loaded>();
  loaded->segment = &segment;
  loaded->records = std::move(*records);
  ByteView rest = loaded->records;
  while (const auto record = mcap::first_record(rest)) {
    rest = rest.subspan(record->whole.size());
    if (record->opcode != mcap::Opcode::message) continue;
    const auto message = mcap::parse_message(record->content);
    if (!message || !wanted_.contains(message->channel_id)) continue;
    if (selection_.from && message->log_time < *selection_.from) continue;
    if (selection_.to && message->log_time >= *selection_.to) continue;
    loaded->entries.push_back({message->log_time, record->content});
  }
  std::stable_sort(loaded->entries.begin(), loaded->entries.end(),
                   [](const auto& a, const auto& b) { return a.time < b.time; });
  if (loaded->entries.empty()) return;
  loaded_bytes_ += loaded->records.size();
  loaded_.push_back(std::move(loaded));
  std::push_heap(loaded_.begin(), loaded_.end(), Loaded::is_later);
}

std::optional<RecordedMessage> MessageStream::next() {
  handed_out_.reset();  // the message of before may point into a chunk that is used up
  for (;;) {
    const auto earliest = [&] { return loaded_.front()->entries[loaded_.front()->next].time; };
    if (!waiting_.empty() && (loaded_.empty() || waiting_.back()->start <= earliest())) {
      const Segment& segment = *waiting_.back();
      waiting_.pop_back();
      load(segment);
      continue;
    }
    if (loaded_.empty()) return std::nullopt;
    std::pop_heap(loaded_.begin(), loaded_.end(), Loaded::is_later);
    handed_out_ = std::move(loaded_.back());
    loaded_.pop_back();
    const auto message = mcap::parse_message(handed_out_->entries[handed_out_->next++].content);
    if (handed_out_->next < handed_out_->entries.size()) {
      loaded_.push_back(handed_out_);
      std::push_heap(loaded_.begin(), loaded_.end(), Loaded::is_later);
    } else {
      loaded_bytes_ -= handed_out_->records.size();
    }
    return RecordedMessage{&contents_->channels.at(message->channel_id), message->sequence, message->log_time,
                           message->publish_time, message->data};
  }
}

}  // namespace invar::recording

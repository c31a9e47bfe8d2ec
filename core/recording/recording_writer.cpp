#include "core/recording/recording_writer.hpp"

#include <algorithm>
#include <chrono>

#include "core/base/contract.hpp"

namespace invar::recording {

std::filesystem::path keep_earlier(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) return {};
  std::filesystem::path kept;
  int number = 1;
  do {
    kept = file.parent_path() /
           (file.stem().string() + "-" + std::to_string(number++) + file.extension().string());
  } while (std::filesystem::exists(kept));
  std::filesystem::rename(file, kept);
  return kept;
}

namespace {
// The thread looks into the queue this often by itself; callers wake it only when the queue is half full, so
// that a write costs no system call.
constexpr auto look_every = std::chrono::milliseconds{10};
}  // namespace

RecordingWriter::RecordingWriter(const std::filesystem::path& file, const RecordingOptions& options)
    : options_{options}, file_{file, options.chunks} {
  filling_.reserve(options_.queue_bytes);
  thread_ = std::thread{[this] { run(); }};
}

RecordingWriter::~RecordingWriter() {
  if (thread_.joinable()) close();
}

void RecordingWriter::put_record(const auto& record) { mcap::append(filling_, record); }

std::uint16_t RecordingWriter::add_channel(const ChannelInfo& info) {
  const std::lock_guard lock{mutex_};
  INVAR_EXPECTS(channels_.size() < 65'534 && !closing_, channels_.size(), closing_);
  std::uint16_t& schema = schemas_[{info.type, info.idl}];
  if (schema == 0) {
    schema = static_cast<std::uint16_t>(schemas_.size());
    put_record(mcap::Schema{schema, info.type, "omgidl", info.idl});
  }
  const auto id = static_cast<std::uint16_t>(channels_.size() + 1);
  mcap::Texts metadata = info.more;
  metadata["qos"] = info.qos;
  metadata["partitions"] = info.partitions;
  put_record(mcap::Channel{id, schema, info.topic, "cdr", std::move(metadata)});
  channels_.emplace_back().ledger.topic = info.topic;
  return id;
}

bool RecordingWriter::write(std::uint16_t channel, std::uint32_t sequence, Instant log_time,
                            Instant publish_time, ByteView payload) noexcept {
  bool half_full = false;
  {
    const std::lock_guard lock{mutex_};
    INVAR_EXPECTS(channel >= 1 && channel <= channels_.size(), channel);
    Known& known = channels_[channel - 1U];
    ++known.ledger.arrived;
    known.follower.observe(sequence, known.ledger);
    const std::size_t before = filling_.size();
    const std::size_t after = before + mcap::record_head + 22 + payload.size();
    if (after > options_.queue_bytes || status_.failed || status_.at_reserve || closing_) {
      ++known.ledger.lost;
      return false;
    }
    mcap::append(filling_, mcap::Message{channel, sequence, log_time, publish_time, payload});
    half_full = before < options_.queue_bytes / 2 && after >= options_.queue_bytes / 2;
  }
  if (half_full) wake_.notify_one();
  return true;
}

void RecordingWriter::attach(const std::string& name, const std::string& media_type, ByteView content,
                             Instant time) {
  const std::lock_guard lock{mutex_};
  INVAR_EXPECTS(!closing_);
  put_record(mcap::Attachment{time, time, name, media_type, content});
}

void RecordingWriter::note(const mcap::Metadata& record) {
  const std::lock_guard lock{mutex_};
  INVAR_EXPECTS(!closing_);
  put_record(record);
}

LossLedger RecordingWriter::ledger() const {
  const std::lock_guard lock{mutex_};
  LossLedger ledger;
  for (std::size_t i = 0; i < channels_.size(); ++i)
    ledger.channels[static_cast<std::uint16_t>(i + 1)] = channels_[i].ledger;
  return ledger;
}

RecordingStatus RecordingWriter::status() const {
  const std::lock_guard lock{mutex_};
  return status_;
}

void RecordingWriter::run() {
  using Clock = std::chrono::steady_clock;
  Bytes emptying;
  emptying.reserve(options_.queue_bytes);
  auto chunk_began = Clock::now();
  auto noted_at = Clock::now();
  std::uint64_t noted_losses = 0;
  bool closing = false;
  while (!closing) {
    {
      std::unique_lock lock{mutex_};
      wake_.wait_for(lock, look_every,
                     [&] { return closing_ || filling_.size() >= options_.queue_bytes / 2; });
      closing = closing_;
      std::swap(filling_, emptying);
      status_.queue_peak = std::max<std::uint64_t>(status_.queue_peak, emptying.size());
    }
    const auto now = Clock::now();
    if (!file_.has_open_chunk()) chunk_began = now;
    if (is_at_reserve(emptying.size())) emptying.clear();
    write_all(emptying);
    emptying.clear();
    if (file_.has_open_chunk() && now - chunk_began > std::chrono::nanoseconds{options_.chunk_age.ns}) {
      file_.flush();
      chunk_began = now;
    }
    settle_accounts();
    // A file that is cut off later shall tell of its losses too.
    if (now - noted_at < std::chrono::seconds{1}) continue;
    const LossLedger so_far = ledger();
    const auto losses = so_far.total().lost + so_far.total().missing;
    if (losses != noted_losses) file_.write(so_far.record());
    noted_losses = losses;
    noted_at = now;
  }
}

/// Once there, for ever: room that comes back would leave a hole in the recording.
bool RecordingWriter::is_at_reserve(std::size_t more) {
  const std::lock_guard lock{mutex_};
  if (options_.reserve_bytes > 0 && more > 0 && !status_.at_reserve)
    status_.at_reserve = file_.free_bytes() < options_.reserve_bytes + more;
  return status_.at_reserve;
}

void RecordingWriter::write_all(ByteView batch) {
  while (const auto record = mcap::first_record(batch)) {
    file_.write(*record);
    batch = batch.subspan(record->whole.size());
  }
}

void RecordingWriter::settle_accounts() {
  const std::lock_guard lock{mutex_};
  const auto& on_disk = file_.messages_on_disk();
  for (std::size_t i = 0; i < channels_.size() && i + 1 < on_disk.size(); ++i)
    channels_[i].ledger.written = on_disk[i + 1];
  status_.failed = file_.failed();
  status_.bytes_written = file_.bytes_written();
}

bool RecordingWriter::close() {
  {
    const std::lock_guard lock{mutex_};
    closing_ = true;
  }
  wake_.notify_one();
  thread_.join();
  file_.flush();
  settle_accounts();
  {
    // Nothing waits any more: what arrived and is not on disk is lost, be it by a full queue or a failed
    // disk.
    const std::lock_guard lock{mutex_};
    for (Known& known : channels_) known.ledger.lost = known.ledger.arrived - known.ledger.written;
  }
  file_.write(ledger().record());
  file_.close();
  settle_accounts();
  return !file_.failed();
}

}  // namespace invar::recording

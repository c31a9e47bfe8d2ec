#include "components/recorder/recorder.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

namespace invar::recorder {

namespace {
constexpr std::uint64_t megabyte = 1'000'000;
constexpr std::size_t most_early_bytes = 16'000'000;
}  // namespace

void Recorder::configure() {
  make_folder(parameters_.out);
  recording::keep_earlier(file());
  const std::scoped_lock lock{mutex_};
  writer_ = std::make_unique<recording::RecordingWriter>(
      file(), recording::RecordingOptions{.reserve_bytes =
                                              megabyte * static_cast<std::uint64_t>(parameters_.reserve_mb)});
  channels_.clear();
  for (const Early& one : std::exchange(early_, {}))
    write({one.source, one.writer, one.sequence, one.sent, one.received}, one.cdr);
  was_open_ = true;
}

/// Writes what waits, the ledger and the summary.
void Recorder::cleanup() noexcept {
  const std::scoped_lock lock{mutex_};
  if (writer_ && !writer_->close())
    notices_.say(event::SEVERITY_FAULT,
                 ("the recording ends early, since the disk takes no more: " + file().string()).c_str());
  writer_.reset();
}

void Recorder::activate() {
  look_at_ = status_at_ = now();
  told_lost_ = 0;
}

void Recorder::step(const Tick& tick) noexcept {
  const std::scoped_lock lock{mutex_};
  if (!writer_) return;
  if (writer_->status().failed)
    return fail(
        "the disk takes no more: the recording has ended; make room, then reset, configure and activate");
  if (writer_->status().at_reserve) {
    writer_->close();  // a whole file, at once: who comes for it finds what was recorded
    writer_.reset();
    return fail(
        "the disk has its reserve for black boxes left and no more: the recording has ended; make room, "
        "then reset, configure and activate");
  }
  if (tick.now >= status_at_ && !simulated_time) {
    status_at_ = tick.now + Duration::seconds(1.0);
    say_status();
  }
  if (tick.now < look_at_) return;
  look_at_ = tick.now + Duration::seconds(10.0);
  say_lost();
}

void Recorder::say_status() noexcept {
  const recording::ChannelLedger total = writer_->ledger().total();
  std::error_code none;
  const auto disk = std::filesystem::space(parameters_.out, none);
  RecorderStatus status;
  stamp(status);
  status.component_id(id);
  status.file_bytes(writer_->status().bytes_written);
  status.free_bytes(none ? 0 : disk.available);
  status.reserve_bytes(megabyte * static_cast<std::uint64_t>(parameters_.reserve_mb));
  status.samples(total.written);
  status.lost(total.lost);
  status_.write(status);
}

void Recorder::say_lost() noexcept {
  const std::uint64_t lost = writer_->ledger().total().lost;
  if (lost > told_lost_)
    notices_.say(event::SEVERITY_FAULT, (std::to_string(lost - told_lost_) +
                                         " samples are lost: the disk is slower than the cell; name fewer "
                                         "`topics`, or lower their rates by `publish`")
                                            .c_str());
  told_lost_ = lost;
}

bool Recorder::is_wanted(const std::string& topic) const {
  return parameters_.topics.empty() ||
         std::any_of(parameters_.topics.begin(), parameters_.topics.end(),
                     [&](const std::string& part) { return topic.find(part) != std::string::npos; });
}

void Recorder::record(const Source& source, const std::string& writer, std::uint64_t sequence, Instant sent,
                      Instant received, std::span<const std::byte> cdr) {
  const std::scoped_lock lock{mutex_};
  if (writer_) return write({source, writer, sequence, sent, received}, cdr);
  const std::size_t size = sizeof(Early) + source.idl.size() + cdr.size();
  if (was_open_ || early_bytes_ + size > most_early_bytes) return;
  early_bytes_ += size;
  early_.push_back({source, writer, sequence, sent, received, {cdr.begin(), cdr.end()}});
}

void Recorder::write(const Origin& origin, std::span<const std::byte> cdr) {
  newest_ = std::max(newest_, origin.received);  // of two threads the later may come first
  auto [channel, is_new] = channels_.try_emplace({origin.source.topic, origin.writer}, std::uint16_t{0});
  if (is_new)
    channel->second = writer_->add_channel({.topic = origin.source.topic,
                                            .type = origin.source.type,
                                            .idl = origin.source.idl,
                                            .qos = origin.source.profile,
                                            .partitions = "",
                                            .more = {{"writer", origin.writer}}});
  writer_->write(channel->second, static_cast<std::uint32_t>(origin.sequence), newest_, origin.sent,
                 {reinterpret_cast<const std::uint8_t*>(cdr.data()), cdr.size()});
}

void Recorder::attach(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  const std::vector<char> content{std::istreambuf_iterator<char>{stream}, {}};
  const std::scoped_lock lock{mutex_};
  if (writer_)
    writer_->attach(file.filename().string(), "application/yaml",
                    {reinterpret_cast<const std::uint8_t*>(content.data()), content.size()}, Instant{0});
}

}  // namespace invar::recorder

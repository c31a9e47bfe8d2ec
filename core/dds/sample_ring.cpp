#include "core/dds/sample_ring.hpp"

#include <algorithm>
#include <cstring>
#include <new>

namespace invar::dds {

namespace {

constexpr std::uint64_t version = 0x31474E4952564E49;  // "INVRING1"

enum Place : std::uint32_t { empty, claimed, taken };

struct ReaderPlace {
  std::atomic<std::uint32_t> state{empty};
  std::array<std::atomic<std::uint32_t>, 4> id{};
};

using Words = std::array<std::uint32_t, 4>;
Words words(const EndpointId& id) {
  Words w;
  std::memcpy(w.data(), id.data(), id.size());
  return w;
}

bool holds(const ReaderPlace& place, const Words& id) noexcept {
  if (place.state.load(std::memory_order_acquire) != taken) return false;
  for (std::size_t i = 0; i < id.size(); ++i)
    if (place.id[i].load(std::memory_order_relaxed) != id[i]) return false;
  return true;
}

}  // namespace

struct SampleRing::Header {
  std::uint64_t version = 0;
  std::uint64_t sample_size = 0;
  std::atomic<std::uint64_t> changes{0};
  std::atomic<std::uint32_t> readers{0};
  std::array<ReaderPlace, most_readers> places{};
  alignas(64) std::atomic<std::uint64_t> end{0};  // samples written
};

/// A sequence lock: `turn` is 2 n + 1 while sample n is written, then 2 n + 2.
struct SampleRing::Entry {
  std::atomic<std::uint64_t> turn{0};
  std::atomic<std::uint64_t> size{0};
  [[nodiscard]] std::byte* bytes() noexcept { return reinterpret_cast<std::byte*>(this + 1); }
};

namespace {
std::size_t rounded(std::size_t size) { return (size + 63) / 64 * 64; }
std::string file_name(const EndpointId& id) {
  constexpr const char* digits = "0123456789abcdef";
  std::string text = "ring_";
  for (const std::uint8_t byte : id) text.append({digits[byte >> 4U], digits[byte & 15U]});
  return text;
}
}  // namespace

std::unique_ptr<SampleRing> SampleRing::make(const EndpointId& writer, std::size_t sample_size) {
  if (sample_size > largest_sample) return nullptr;
  const std::size_t stride = rounded(sizeof(Entry) + sample_size);
  auto file = SharedFile::make(file_name(writer), rounded(sizeof(Header)) + depth * stride);
  if (!file) return nullptr;
  auto* header = new (file->data()) Header;
  header->sample_size = sample_size;
  for (std::uint64_t i = 0; i < depth; ++i) new (file->data() + rounded(sizeof(Header)) + i * stride) Entry;
  std::atomic_thread_fence(std::memory_order_release);
  header->version = version;
  return std::unique_ptr<SampleRing>{new SampleRing{std::move(file)}};  // NOLINT
}

std::unique_ptr<SampleRing> SampleRing::open(const EndpointId& writer) {
  auto file = SharedFile::open(file_name(writer));
  if (!file || file->size() < sizeof(Header)) return nullptr;
  const auto* header = reinterpret_cast<const Header*>(file->data());
  if (header->version != version || header->sample_size > largest_sample) return nullptr;
  const std::size_t stride = rounded(sizeof(Entry) + header->sample_size);
  if (file->size() != rounded(sizeof(Header)) + depth * stride) return nullptr;
  return std::unique_ptr<SampleRing>{new SampleRing{std::move(file)}};  // NOLINT
}

SampleRing::SampleRing(std::unique_ptr<SharedFile> file)
    : file_{std::move(file)}, sample_size_{header().sample_size}, copy_(sample_size_) {}

SampleRing::Header& SampleRing::header() const noexcept {
  return *std::launder(reinterpret_cast<Header*>(file_->data()));
}

SampleRing::Entry& SampleRing::entry(std::uint64_t number) const noexcept {
  const std::size_t stride = rounded(sizeof(Entry) + sample_size_);
  return *std::launder(
      reinterpret_cast<Entry*>(file_->data() + rounded(sizeof(Header)) + number % depth * stride));
}

bool SampleRing::has_readers() const noexcept {
  return header().readers.load(std::memory_order_relaxed) != 0;
}

std::span<std::byte> SampleRing::begin() noexcept {
  const std::uint64_t number = header().end.load(std::memory_order_relaxed);
  Entry& next = entry(number);
  next.turn.store(2 * number + 1, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);
  return {next.bytes(), sample_size_};
}

void SampleRing::commit(std::size_t size) noexcept {
  const std::uint64_t number = header().end.load(std::memory_order_relaxed);
  Entry& next = entry(number);
  next.size.store(size, std::memory_order_relaxed);
  next.turn.store(2 * number + 2, std::memory_order_release);
  header().end.store(number + 1, std::memory_order_release);
}

std::uint64_t SampleRing::changes() const noexcept {
  return header().changes.load(std::memory_order_acquire);
}

bool SampleRing::is_attached(const EndpointId& reader) const noexcept {
  const auto& places = header().places;
  return std::any_of(places.begin(), places.end(),
                     [id = words(reader)](const auto& place) { return holds(place, id); });
}

bool SampleRing::attach(const EndpointId& reader) noexcept {
  const Words id = words(reader);
  for (ReaderPlace& place : header().places) {
    std::uint32_t expected = empty;
    if (!place.state.compare_exchange_strong(expected, claimed, std::memory_order_acq_rel)) continue;
    for (std::size_t i = 0; i < id.size(); ++i) place.id[i].store(id[i], std::memory_order_relaxed);
    place.state.store(taken, std::memory_order_release);
    next_ = header().end.load(std::memory_order_acquire);
    header().readers.fetch_add(1, std::memory_order_acq_rel);
    header().changes.fetch_add(1, std::memory_order_acq_rel);
    return true;
  }
  return false;
}

void SampleRing::detach(const EndpointId& reader) noexcept {
  const Words id = words(reader);
  for (ReaderPlace& place : header().places) {
    if (!holds(place, id)) continue;
    std::uint32_t expected = taken;
    if (!place.state.compare_exchange_strong(expected, empty, std::memory_order_acq_rel)) continue;
    header().readers.fetch_sub(1, std::memory_order_acq_rel);
    header().changes.fetch_add(1, std::memory_order_acq_rel);
  }
}

bool SampleRing::skip() noexcept {
  const std::uint64_t end = header().end.load(std::memory_order_acquire);
  const bool any = next_ != end;
  next_ = end;
  return any;
}

std::uint64_t SampleRing::read(const std::function<void(std::span<const std::byte>)>& take) {
  std::uint64_t lost = 0;
  for (std::uint64_t end = header().end.load(std::memory_order_acquire); next_ != end;
       end = header().end.load(std::memory_order_acquire)) {
    if (end - next_ > depth) {
      lost += end - depth - next_;
      next_ = end - depth;
    }
    Entry& from = entry(next_);
    const std::uint64_t whole = 2 * next_ + 2;
    const bool begun = from.turn.load(std::memory_order_acquire) == whole;
    const std::size_t size = std::min<std::size_t>(from.size.load(std::memory_order_relaxed), sample_size_);
    std::memcpy(copy_.data(), from.bytes(), size);
    std::atomic_thread_fence(std::memory_order_acquire);
    const bool is_whole = begun && from.turn.load(std::memory_order_relaxed) == whole;
    ++next_;
    if (is_whole)
      take({copy_.data(), size});
    else
      ++lost;
  }
  return lost;
}

}  // namespace invar::dds

// Snapshot: one thread publishes a value, any number of threads read it, and the writer never notices them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace invar {

/// A sequence lock. The writer is wait-free; a reader that was overtaken reads again. The content is held in
/// atomic words, so that overlapping is defined behaviour. One writer at a time.
template <class T>
requires std::is_trivially_copyable_v<T>
class Snapshot {
 public:
  Snapshot() { write(T{}); }

  /// Real-time.
  void write(const T& value) noexcept {
    std::array<std::uint64_t, words> raw{};
    std::memcpy(raw.data(), &value, sizeof(T));
    const std::uint32_t turn = turn_.load(std::memory_order_relaxed);
    turn_.store(turn + 1, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
    for (std::size_t i = 0; i < words; ++i) content_[i].store(raw[i], std::memory_order_relaxed);
    turn_.store(turn + 2, std::memory_order_release);
  }

  /// Any thread. Never call it from a thread that could keep the writer from running.
  [[nodiscard]] T read() const noexcept {
    std::array<std::uint64_t, words> raw;
    for (;;) {
      const std::uint32_t before = turn_.load(std::memory_order_acquire);
      if ((before & 1U) != 0) continue;
      for (std::size_t i = 0; i < words; ++i) raw[i] = content_[i].load(std::memory_order_relaxed);
      std::atomic_thread_fence(std::memory_order_acquire);
      if (turn_.load(std::memory_order_relaxed) == before) break;
    }
    T value;
    std::memcpy(static_cast<void*>(&value), raw.data(), sizeof(T));
    return value;
  }

 private:
  static constexpr std::size_t words = (sizeof(T) + 7) / 8;
  alignas(64) std::atomic<std::uint32_t> turn_{0};
  std::array<std::atomic<std::uint64_t>, words> content_{};
};

}  // namespace invar

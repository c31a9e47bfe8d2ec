// How one thread hands samples to another without waiting: the latest value, or all of them in order.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace invar {

/// The latest value: one writer thread, one reader thread, both wait-free. There are three slots. The writer fills its own and swaps
/// it with the middle one. The reader swaps the middle one with its own when it is newer.
/// *Real-time* where copying a T is.
template <class T>
class Latest {
 public:
  void write(const T& value) noexcept {
    slots_[writing_] = value;
    writing_ = middle_.exchange(writing_ | fresh, std::memory_order_acq_rel) & index;
  }

  /// The newest value, or nullptr when none was ever written. Valid until the next call by the reader.
  const T* read() noexcept {
    if ((middle_.load(std::memory_order_acquire) & fresh) != 0) {
      reading_ = middle_.exchange(reading_, std::memory_order_acq_rel) & index;
      any_ = true;
    }
    return held();
  }
  /// By the reader: once more what the last `read` gave.
  [[nodiscard]] const T* held() const noexcept { return any_ ? &slots_[reading_] : nullptr; }

 private:
  static constexpr unsigned fresh = 4;
  static constexpr unsigned index = 3;
  std::array<T, 3> slots_{};
  alignas(64) std::atomic<unsigned> middle_{1};
  alignas(64) unsigned writing_ = 0;
  alignas(64) unsigned reading_ = 2;
  bool any_ = false;
};

/// All values in order: one writer thread, one reader thread, wait-free; what does not fit is refused and
/// counted.
template <class T>
class Ring {
 public:
  /// Set-up only: allocates room for `capacity` samples (rounded up to a power of two).
  explicit Ring(std::size_t capacity) {
    std::size_t size = 2;
    while (size < capacity) size *= 2;
    slots_.resize(size);
  }

  bool push(const T& value) noexcept {
    const auto end = end_.load(std::memory_order_relaxed);
    if (end - begin_.load(std::memory_order_acquire) == slots_.size()) {
      lost_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    slots_[end & (slots_.size() - 1)] = value;
    end_.store(end + 1, std::memory_order_release);
    return true;
  }

  bool pop(T& value) noexcept {
    const auto begin = begin_.load(std::memory_order_relaxed);
    if (begin == end_.load(std::memory_order_acquire)) return false;
    value = slots_[begin & (slots_.size() - 1)];
    begin_.store(begin + 1, std::memory_order_release);
    return true;
  }

  /// How many samples were refused because the reader did not keep up. Any thread.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::size_t size() const noexcept {
    return end_.load(std::memory_order_acquire) - begin_.load(std::memory_order_acquire);
  }

 private:
  std::vector<T> slots_;
  alignas(64) std::atomic<std::size_t> begin_{0};
  alignas(64) std::atomic<std::size_t> end_{0};
  std::atomic<std::uint64_t> lost_{0};
};

}  // namespace invar

#include "core/executor/black_box.hpp"

#include <chrono>

namespace invar {

void BlackBox::watch(std::string name, std::string unit, std::function<double()> value) {
  signals_.push_back({std::move(name), std::move(unit)});
  values_.push_back(std::move(value));
}

void BlackBox::start(std::string process, std::vector<std::string> components, bool threaded) {
  process_ = std::move(process);
  components_ = std::move(components);
  ring_.assign(capacity_, {});
  samples_.assign(capacity_ * values_.size(), 0.0);
  if (!threaded || !callback_ || thread_.joinable()) return;
  stopping_ = false;
  thread_ = std::thread{[this] {
    std::unique_lock lock{mutex_};
    // Looks instead of being told: telling would be a system call of the loop.
    while (!wake_.wait_for(lock, std::chrono::milliseconds{20}, [this] { return stopping_; })) {
      lock.unlock();
      deliver();
      lock.lock();
    }
  }};
}

void BlackBox::stop() {
  if (thread_.joinable()) {
    {
      const std::lock_guard lock{mutex_};
      stopping_ = true;
    }
    wake_.notify_all();
    thread_.join();
  }
  deliver(true);
}

void BlackBox::add(const CycleRecord& record) noexcept {
  if (ring_.empty() || frozen_.load(std::memory_order_acquire)) return;
  const std::size_t at = written_ % capacity_;
  ring_[at] = record;
  for (std::size_t i = 0; i < values_.size(); ++i) samples_[at * values_.size() + i] = values_[i]();
  ++written_;
  if (tripped_ && left_-- == 0) frozen_.store(true, std::memory_order_release);
}

void BlackBox::trip(std::string_view prefix, std::string_view why, Instant now,
                    std::uint64_t cycle) noexcept {
  if (ring_.empty() || frozen_.load(std::memory_order_acquire) || tripped_) return;
  reason_ = {};
  std::size_t end = 0;
  for (const std::string_view part : {prefix, why})
    for (const char c : part)
      if (end + 1 < reason_.size()) reason_[end++] = c;
  tripped_at_ = now;
  tripped_cycle_ = cycle;
  left_ = capacity_ / 8;
  tripped_ = true;
}

void BlackBox::deliver(bool loop_ended) {
  const std::lock_guard turn{delivering_};
  if (!frozen_.load(std::memory_order_acquire) && !(loop_ended && tripped_)) return;
  BlackBoxRecord record;
  record.process = process_;
  record.reason = reason_.data();
  record.tripped_at = tripped_at_;
  record.tripped_cycle = tripped_cycle_;
  record.components = components_;
  record.signals = signals_;
  const std::uint64_t count = written_ < capacity_ ? written_ : capacity_;
  for (std::uint64_t i = written_ - count; i < written_; ++i) {
    const std::size_t at = i % capacity_;
    record.cycles.push_back(ring_[at]);
    const auto row = samples_.begin() + static_cast<std::ptrdiff_t>(at * values_.size());
    record.samples.insert(record.samples.end(), row, row + static_cast<std::ptrdiff_t>(values_.size()));
  }
  written_ = 0;
  tripped_ = false;
  frozen_.store(false, std::memory_order_release);
  if (callback_) callback_(record);
}

}  // namespace invar

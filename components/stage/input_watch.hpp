// InputWatch: tells when an input that came periodically has stayed away for two of its periods.
#pragma once

#include <algorithm>
#include <cstdint>

namespace invar::stage {

/// Counts steps of its owner, not time: a loop that stood still itself has missed nothing. Real-time.
class InputWatch {
 public:
  /// Once a step: the samples received so far, and steps that are forgiven in any case. True while the input is lost.
  bool lost(std::uint64_t received, double patience) noexcept {
    const bool was_lost = is_lost(patience);
    if (received == received_) return ++since_, is_lost(patience);
    if (arrivals_ > 0 && !was_lost) longest_ = std::max(longest_, since_ + 1);
    arrivals_ = std::min(arrivals_ + 1, known);
    received_ = received;
    since_ = 0;
    return false;
  }
  /// Forgets the past: earlier samples say nothing of later ones.
  void reset(std::uint64_t received) noexcept {
    *this = {};
    received_ = received;
  }

 private:
  static constexpr int known = 3;  // arrivals make a period
  [[nodiscard]] bool is_lost(double patience) const noexcept {
    return arrivals_ >= known && since_ >= 2 * longest_ && static_cast<double>(since_) >= patience;
  }
  std::uint64_t received_ = 0;
  int arrivals_ = 0;
  int since_ = 0;    // steps without a sample
  int longest_ = 1;  // period seen [steps]
};

}  // namespace invar::stage

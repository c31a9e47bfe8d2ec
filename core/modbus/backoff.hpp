// When to try again: at once after the first failure, then ever later, up to a limit; the first success
// resets.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/base/time.hpp"

namespace invar::modbus {

class Backoff {
 public:
  /// Precondition: 0 < first <= longest.
  Backoff(Duration first, Duration longest) : first_{first}, longest_{longest}, next_wait_{first} {}

  [[nodiscard]] bool may_try(Instant now) const { return now >= retry_at_; }
  [[nodiscard]] Instant retry_at() const { return retry_at_; }
  void failed(Instant now) {
    retry_at_ = now + next_wait_;
    next_wait_ = std::min(next_wait_ * 2, longest_);
  }
  void succeeded() {
    next_wait_ = first_;
    retry_at_ = {INT64_MIN};
  }

 private:
  Duration first_, longest_, next_wait_;
  Instant retry_at_{INT64_MIN};
};

}  // namespace invar::modbus

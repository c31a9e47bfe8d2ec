// When each message of a recording is due again, at any speed; it tells the time and never sleeps.
#pragma once

#include <limits>
#include <optional>
#include <utility>

#include "core/recording/recording_reader.hpp"

namespace invar::recording {

/// Hands out messages as their time comes. The caller brings the clock (steady or simulated), waits until due(), and
/// publishes what next() gives. One thread.
class Replayer {
 public:
  static constexpr double as_fast_as_possible = std::numeric_limits<double>::infinity();

  /// The first message is due at `start`; one logged dt later at start + dt / speed. Precondition: speed > 0.
  Replayer(MessageStream stream, Instant start, double speed = 1.0);

  /// When the next message is due; nothing when there are no more.
  [[nodiscard]] std::optional<Instant> due() const;
  /// The next message if it is due by `now`. Its data hold until the next call.
  std::optional<RecordedMessage> next(Instant now);
  /// From `now` on at another speed; what is not yet due stays as far ahead in the recording as it was.
  void set_speed(double speed, Instant now);
  /// The time in the recording that `now` stands for.
  [[nodiscard]] Instant log_time_at(Instant now) const;

 private:
  MessageStream stream_;
  std::optional<RecordedMessage> pending_;
  Bytes data_;
  Instant origin_;      // on the caller's clock
  Instant log_origin_;  // in the recording
  double speed_;
};

}  // namespace invar::recording

#include "core/recording/replayer.hpp"

#include <cmath>

#include "core/base/contract.hpp"

namespace invar::recording {

namespace {

Duration scaled(Duration span, double factor) {
  return {static_cast<std::int64_t>(std::llround(static_cast<double>(span.ns) * factor))};
}

}  // namespace

Replayer::Replayer(MessageStream stream, Instant start, double speed)
    : stream_{std::move(stream)}, pending_{stream_.next()}, origin_{start}, speed_{speed} {
  INVAR_EXPECTS(speed > 0.0, speed);
  if (pending_) log_origin_ = pending_->log_time;
}

std::optional<Instant> Replayer::due() const {
  if (!pending_) return std::nullopt;
  if (std::isinf(speed_)) return origin_;
  return origin_ + scaled(pending_->log_time - log_origin_, 1.0 / speed_);
}

std::optional<RecordedMessage> Replayer::next(Instant now) {
  const auto at = due();
  if (!at || *at > now) return std::nullopt;
  auto message = pending_;
  data_.assign(message->data.begin(),
               message->data.end());  // the stream's own go when it is asked for the next
  message->data = data_;
  pending_ = stream_.next();
  return message;
}

Instant Replayer::log_time_at(Instant now) const {
  if (std::isinf(speed_)) return pending_ ? pending_->log_time : log_origin_;
  return log_origin_ + scaled(now - origin_, speed_);
}

void Replayer::set_speed(double speed, Instant now) {
  INVAR_EXPECTS(speed > 0.0, speed);
  log_origin_ = log_time_at(now);
  origin_ = now;
  speed_ = speed;
}

}  // namespace invar::recording

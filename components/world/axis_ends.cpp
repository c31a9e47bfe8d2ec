#include "components/world/axis_ends.hpp"

#include <cmath>

namespace invar::world {

AxisEnds::AxisEnds(const AxisEndsParameters& parameters, Range travel)
    : parameters_{parameters},
      travel_{travel},
      stops_{travel.lower - parameters.stops, travel.upper + parameters.stops} {}

void AxisEnds::reset(double position) noexcept {
  position_ = position;
  home_ = home_shown_ = home_closed();
  chatters_until_.reset();
  pulses_ = 0;
  pulse_at_ = 0.0;
}

bool AxisEnds::home_closed() const noexcept {
  if (parameters_.home == "open" || parameters_.home == "closed") return parameters_.home == "closed";
  const double outwards =
      parameters_.home_end == "low" ? travel_.lower - position_ : position_ - travel_.upper;
  const double beyond = outwards - parameters_.home_at;
  return (beyond > 0.0 && beyond < parameters_.home_width) != (parameters_.home == "inverted");
}

bool AxisEnds::limit_low() const noexcept {
  if (parameters_.limit != "works") return parameters_.limit == "closed";
  return position_ < travel_.lower - parameters_.limits;
}

bool AxisEnds::limit_high() const noexcept {
  if (parameters_.limit != "works") return parameters_.limit == "closed";
  return position_ > travel_.upper + parameters_.limits;
}

void AxisEnds::update(double position, Instant now, std::uint64_t cycle) noexcept {
  if (has_index()) {
    const double pitch = parameters_.index_pitch;
    const double before = std::floor((position_ - parameters_.index_at) / pitch);
    const double after = std::floor((position - parameters_.index_at) / pitch);
    if (before != after) {
      ++pulses_;
      pulse_at_ = parameters_.index_at + pitch * std::max(before, after);
    }
  }
  position_ = position;
  const bool closed = home_closed();
  if (closed != home_ && parameters_.bounce > 0.0)
    chatters_until_ = now + Duration::seconds(parameters_.bounce);
  home_ = closed;
  const bool chatters = chatters_until_ && now < *chatters_until_;
  home_shown_ = chatters ? cycle % 3 == 0 : closed;
}

}  // namespace invar::world

#include "components/interferometer/interferometer.hpp"

#include <cmath>

namespace invar::interferometer {

void Interferometer::activate() {
  random_.seed(static_cast<std::uint64_t>(parameters_.seed));
  normal_.reset();
  zeroed_ = false;
}

double Interferometer::length(const sensing::ToolPosition& tool) noexcept {
  double along = parameters_.noise * normal_(random_);
  for (std::size_t i = 0; i < 3; ++i) along += direction_[i] * tool.position()[i];
  if (const double count = parameters_.resolution; count > 0.0) along = count * std::round(along / count);
  return along;
}

void Interferometer::step(const Tick&) noexcept {
  const auto* tool = tool_.latest();
  sensing::BeamCommand command;
  while (beam_.take(command)) {
    if (tool == nullptr) continue;
    const auto& d = command.beam_direction();
    const double norm = std::hypot(d[0], d[1], d[2]);
    if (!(norm > 0.0) || !std::isfinite(norm)) continue;  // no direction, no beam: the reading stays as it is
    for (std::size_t i = 0; i < 3; ++i) direction_[i] = d[i] / norm;
    start_ = command.beam_start();
    zero_ = length(*tool);
    zeroed_ = true;
  }
  if (tool == nullptr) return;
  sensing::DisplacementReading reading;
  stamp(reading);
  reading.sensor(id);
  reading.displacement(length(*tool) - zero_);
  reading.valid(zeroed_);
  reading.beam_start(start_);
  reading.beam_direction(direction_);
  reading_.write(reading);
}

}  // namespace invar::interferometer

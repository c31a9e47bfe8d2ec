#include "components/compensation/temperatures.hpp"

#include <algorithm>
#include <cmath>

namespace invar::compensation {

Temperatures::Temperatures(Component& owner, const std::vector<std::string>& zones, double rate_filter)
    : slide_{owner, "temperature"}, trace_{rate_filter} {
  for (const std::string& zone : zones)
    zones_.push_back(std::make_unique<Zone>(owner, "temperature_" + zone));
}

void Temperatures::forget() noexcept {
  trace_.forget();
  slide_.sound_at = {INT64_MIN};
  for (auto& zone : zones_) zone->sound_at = {INT64_MIN};
}

bool Temperatures::Zone::update(Instant now) noexcept {
  if (input.received() == received) return false;
  received = input.received();
  const auto* sample = input.latest();
  if (sample == nullptr || sample->stale() || !std::isfinite(sample->temperature())) return false;
  temperature = sample->temperature();
  sound_at = now;
  return true;
}

bool Temperatures::update(Instant now) noexcept {
  bool news = slide_.update(now);
  if (news) trace_.add(now.in_seconds(), slide_.temperature);
  for (auto& zone : zones_) news = zone->update(now) || news;
  return news;
}

Duration Temperatures::age(Instant now, unsigned needed) const noexcept {
  Instant oldest = slide_.sound_at;
  for (std::size_t z = 0; z < zones_.size(); ++z)
    if (((needed >> z) & 1U) != 0U) oldest = std::min(oldest, zones_[z]->sound_at);
  return oldest.ns == INT64_MIN ? Duration{INT64_MAX} : now - oldest;
}

}  // namespace invar::compensation

#include "core/metrology/thermal/heat_trace.hpp"

#include "core/base/contract.hpp"
#include "core/metrology/thermal/thermal_error.hpp"

namespace invar::metrology {

HeatTrace::HeatTrace(double rate_filter, double memory, double spacing)
    : rate_filter_{rate_filter}, spacing_{spacing} {
  INVAR_EXPECTS(rate_filter > 0.0 && spacing > 0.0 && memory > spacing, rate_filter, memory, spacing);
  points_.resize(static_cast<std::size_t>(memory / spacing) + 1);
}

void HeatTrace::forget() noexcept { begin_ = count_ = 0; }

void HeatTrace::add(double time, double temperature) noexcept {
  if (empty()) {
    points_[0] = {time, temperature};
    begin_ = 0;
    count_ = 1;
    slow_ = slower_ = temperature;
  } else if (!(time > time_)) {
    return;
  } else {
    const double before = slow_;
    slow_ = lag_step(slow_, temperature_, temperature, time - time_, rate_filter_);
    slower_ = lag_step(slower_, before, slow_, time - time_, rate_filter_);
    const Point& last = points_[(begin_ + count_ - 1) % points_.size()];
    if (time - last.time >= spacing_) {
      if (count_ == points_.size()) {
        begin_ = (begin_ + 1) % points_.size();
        --count_;
      }
      points_[(begin_ + count_++) % points_.size()] = {time, temperature};
    }
  }
  time_ = time;
  temperature_ = temperature;
}

double HeatTrace::lagged(double tau) const noexcept {
  if (empty()) return temperature_;
  Point from = points_[begin_];
  double lagged = from.temperature;
  for (std::size_t i = 1; i < count_; ++i) {
    const Point& to = points_[(begin_ + i) % points_.size()];
    lagged = lag_step(lagged, from.temperature, to.temperature, to.time - from.time, tau);
    from = to;
  }
  return lag_step(lagged, from.temperature, temperature_, time_ - from.time, tau);
}

double HeatTrace::known() const noexcept { return empty() ? 0.0 : time_ - points_[begin_].time; }

}  // namespace invar::metrology

// Temperatures: what the loop knows of the slide's temperature and of further zones, and how old it is.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/metrology/thermal/heat_trace.hpp"
#include "core/metrology/thermal/thermal_error.hpp"
#include "idl/thermal.h"

namespace invar::compensation {

/// The port `temperature`, and a port `temperature_ZONE` a zone. A sample that says it is stale counts as none. All but the
/// constructor is real-time.
class Temperatures {
 public:
  Temperatures(Component& owner, const std::vector<std::string>& zones, double rate_filter);

  void forget() noexcept;
  /// Takes what arrived; true when there is a new temperature.
  bool update(Instant now) noexcept;

  [[nodiscard]] const metrology::HeatTrace& trace() const noexcept { return trace_; }
  [[nodiscard]] double zone(std::size_t number) const noexcept { return zones_[number]->temperature; }
  /// How old the slide's newest sound reading is, or that of a zone in `needed` (bit by number) if older; a very long
  /// time before the first.
  [[nodiscard]] Duration age(Instant now, unsigned needed) const noexcept;

 private:
  struct Zone {
    Zone(Component& owner, const std::string& port)
        : input{owner, port, {.optional = true, .profile = "state"}} {}
    /// True when a sound reading arrived.
    bool update(Instant now) noexcept;
    Input<thermal::NodeTemperature> input;
    std::uint64_t received = 0;
    double temperature = 0.0;
    Instant sound_at{INT64_MIN};
  };
  Zone slide_;
  std::vector<std::unique_ptr<Zone>> zones_;
  metrology::HeatTrace trace_;
};

}  // namespace invar::compensation

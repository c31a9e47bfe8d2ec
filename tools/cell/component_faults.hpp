// Faults of components that go on all the same: an axis in fault, a latched heater, a device that does not answer, a
// refused model. Read from published samples, so a component of a plug-in counts like one of ours.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "core/component/port.hpp"
#include "idl/compensation.h"
#include "idl/dispensing.h"
#include "idl/stage.h"
#include "idl/thermal.h"

namespace invar::tools {

class ComponentFaults {
 public:
  /// Set-up: follows this output where its type tells of faults.
  void watch(std::size_t component, Port& port);
  /// "the axis is in fault; ..."; empty: nothing is wrong. `now`: on the clock of the component's cycles. Any thread.
  [[nodiscard]] std::string of(std::size_t component, Instant now) const;

 private:
  struct Sign {
    const char* fault = nullptr;  // a literal; nothing is wrong: null
    Duration patience{};          // it counts when it lasts longer: a device takes its time to answer first
  };
  struct Watched {
    std::size_t component;
    std::atomic<const char*> fault{nullptr};  // the writer's thread sets all three
    std::atomic<std::int64_t> since_ns{0}, patience_ns{0};
  };
  template <class Sample>
  bool watch(std::size_t component, Port& port, Sign (*sign_of)(const Sample&));
  static Sign sign_of(const stage::AxisState& state);
  static Sign sign_of(const thermal::NodeTemperature& node);
  static Sign sign_of(const dispensing::PressureState& state);
  static Sign sign_of(const compensation::ModelStatus& status);

  std::deque<Watched> watched_;  // addresses stay
};

}  // namespace invar::tools

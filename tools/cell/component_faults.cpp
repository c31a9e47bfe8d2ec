#include "tools/cell/component_faults.hpp"

namespace invar::tools {

namespace {
// A device is connected and read within a second; a link that is down for a moment comes back as fast.
constexpr Duration answer_patience = Duration::seconds(3.0);
}  // namespace

ComponentFaults::Sign ComponentFaults::sign_of(const stage::AxisState& state) {
  if (state.mode() == stage::AXIS_MODE_FAULT)
    return {"the axis is in fault: mend the cause, then clear the fault"};
  return {};
}

ComponentFaults::Sign ComponentFaults::sign_of(const thermal::NodeTemperature& node) {
  if (node.over_temperature())
    return {"the heater is latched off: mend the cause, then `invar lifecycle CELL COMPONENT reset`"};
  if (node.watchdog_tripped())
    return {"the controller's watchdog has switched the heater off", answer_patience};
  if (node.stale())
    return {"no temperature comes: look at the device, its link and its sensor", answer_patience};
  return {};
}

ComponentFaults::Sign ComponentFaults::sign_of(const dispensing::PressureState& state) {
  if (state.over_pressure())
    return {"the pressure is latched off: mend the cause, then `invar lifecycle CELL COMPONENT reset`"};
  if (state.sensor_fault()) return {"the pressure sensor is at fault"};
  if (state.comm_lost())
    return {"the pressure controller missed its heartbeat and switched off", answer_patience};
  if (state.stale()) return {"the pressure controller does not answer", answer_patience};
  return {};
}

ComponentFaults::Sign ComponentFaults::sign_of(const compensation::ModelStatus& status) {
  if (status.state() == compensation::MODEL_REFUSED) return {"the last model was refused; a notice says why"};
  if (status.command_id() == 0 && status.text().size() > 0)
    return {"the models kept of an earlier run were refused; a notice says why"};
  if (status.condition() == compensation::TEMPERATURE_REFUSED)
    return {"the temperature that the model needs was lost: its layer is out of use"};
  return {};
}

template <class Sample>
bool ComponentFaults::watch(std::size_t component, Port& port, Sign (*look)(const Sample&)) {
  auto* output = dynamic_cast<Output<Sample>*>(&port);
  if (output == nullptr) return false;
  Watched& watched = watched_.emplace_back(component);
  output->add_sink([&watched, look](const Sample& sample, Instant now) {
    const Sign sign = look(sample);
    if (watched.fault.load(std::memory_order_relaxed) == sign.fault) return;
    watched.since_ns.store(now.ns, std::memory_order_relaxed);
    watched.patience_ns.store(sign.patience.ns, std::memory_order_relaxed);
    watched.fault.store(sign.fault, std::memory_order_release);
  });
  return true;
}

void ComponentFaults::watch(std::size_t component, Port& port) {
  (void)(watch<stage::AxisState>(component, port, &sign_of) ||
         watch<thermal::NodeTemperature>(component, port, &sign_of) ||
         watch<dispensing::PressureState>(component, port, &sign_of) ||
         watch<compensation::ModelStatus>(component, port, &sign_of));
}

std::string ComponentFaults::of(std::size_t component, Instant now) const {
  std::string text;
  for (const Watched& watched : watched_) {
    const char* fault = watched.fault.load(std::memory_order_acquire);
    if (watched.component != component || fault == nullptr) continue;
    const std::int64_t lasted = now.ns - watched.since_ns.load(std::memory_order_relaxed);
    if (lasted < watched.patience_ns.load(std::memory_order_relaxed)) continue;
    text += (text.empty() ? "" : "; ") + std::string{fault};
  }
  return text;
}

}  // namespace invar::tools

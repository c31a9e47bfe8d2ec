#include "tools/cell/axis_black_box.hpp"

#include <exception>
#include <utility>

#include "tools/cell/black_box_file.hpp"
#include "tools/cell/each_port.hpp"

namespace invar::tools {

void AxisBlackBox::fill(Executor& executor, Say say) {
  BlackBox& box = executor.black_box();
  each_port(executor, [&](std::size_t index, Port& port) {
    auto* state = dynamic_cast<Output<stage::AxisState>*>(&port);
    if (state == nullptr) return;
    stage::AxisState& last = axes_.emplace_back();
    state->add_sink([&executor, &last](const stage::AxisState& sample, Instant) {
      if (sample.mode() == stage::AXIS_MODE_FAULT && last.mode() != stage::AXIS_MODE_FAULT)
        executor.freeze_black_box();
      last = sample;
    });
    const std::string prefix = executor.component(index).name + ".";
    box.watch(prefix + "setpoint_position", "m", [&last] { return last.setpoint_position(); });
    box.watch(prefix + "position", "m", [&last] { return last.position(); });
    box.watch(prefix + "following_error", "m", [&last] { return last.following_error(); });
    box.watch(prefix + "current", "A", [&last] { return last.current(); });
    box.watch(prefix + "correction", "m", [&last] { return last.correction(); });
    box.watch(prefix + "mode", "1", [&last] { return static_cast<double>(last.mode()); });
  });
  box.on_trip([say = std::move(say)](const BlackBoxRecord& record) {
    try {
      say(event::SEVERITY_WARNING,
          record.reason + "; the last cycles are in " + write_black_box(record, "out").string());
    } catch (const std::exception& error) {
      say(event::SEVERITY_FAULT, std::string{"the black box cannot be written: "} + error.what());
    }
  });
}

}  // namespace invar::tools

#include "tools/cell/process_node.hpp"

#include <algorithm>
#include <typeindex>
#include <vector>

#include "components/supervisor/supervisor.hpp"
#include "core/dds/host_clocks.hpp"
#include "core/dds/segment_size.hpp"
#include "tools/host/own_host.hpp"

namespace invar::tools {

namespace {

std::vector<std::type_index> outputs_of(const LoadedProcess& process) {
  std::vector<std::type_index> types;
  for (const LoadedComponent& member : process.components)
    for (const Port* port : member.component->ports())
      if (port->direction() == Port::Direction::output) types.push_back(port->type());
  return types;
}

bool asks_others(const LoadedProcess& process) {
  return std::any_of(process.components.begin(), process.components.end(), [](const LoadedComponent& member) {
    return dynamic_cast<const supervisor::Supervisor*>(member.component.get()) != nullptr;
  });
}

}  // namespace

dds::NodeOptions node_options(const LoadedCell& loaded, const LoadedProcess& of, bool simulated) {
  const config::CellProcess& process = *of.file;
  dds::NodeOptions options = node_on(*loaded.cell, process.name, process.host);
  options.processes =
      static_cast<std::size_t>(std::count_if(loaded.cell->processes.begin(), loaded.cell->processes.end(),
                                             [&](const auto& other) { return other.host == process.host; }));
  if (options.identity) options.identity->may_command = asks_others(of);
  if (!simulated) options.clocks = clocks_on(*loaded.cell, process.host);
  if (process.realtime) {
    options.realtime_priority = std::max(0, process.realtime->priority - 10);
    options.realtime_cpu = process.realtime->cpu;  // samples leave the moment the loop sleeps
  }
  // In simulated time samples travel in bundles, those of a window in one.
  if (!simulated) options.segment_size = dds::segment_size_for(outputs_of(of));
  return options;
}

}  // namespace invar::tools

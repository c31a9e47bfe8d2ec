// Joins the ports of a cell: gives every port its topic and profile and finds what cannot be joined.
#pragma once

#include <string>

#include "core/component/port.hpp"
#include "core/config/yaml.hpp"

namespace invar::tools {

struct LoadedCell;

/// An input is fed by the output (or plant topic) that `connect` names. An inbox has a topic of its own, to which
/// outputs are connected; it may also be fed by an output that `connect` names. Any other output has the topic
/// cell/<cell>/<component>/<port>. Faults go to the document.
void connect_ports(LoadedCell& loaded);

/// The port that "component.port" names; a fault at `at` when there is none. nullptr too where its component has faults of its own.
[[nodiscard]] Port* named_port(const LoadedCell& loaded, const std::string& connection,
                               const config::Node& at);

}  // namespace invar::tools

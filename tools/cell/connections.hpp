// Joins the ports of a cell: gives every port its topic and profile and finds what cannot be joined.
#pragma once

namespace invar::tools {

struct LoadedCell;

/// An input is fed by the output (or plant topic) that `connect` names. An inbox has a topic of its own, to which
/// outputs are connected; it may also be fed by an output that `connect` names. Any other output has the topic
/// cell/<cell>/<component>/<port>. Faults go to the document.
void connect_ports(LoadedCell& loaded);

}  // namespace invar::tools

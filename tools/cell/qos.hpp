// QoS of a cell: every port's profile must exist, and every writer and reader of a topic must be able to meet.
#pragma once

namespace invar::tools {

struct LoadedCell;

/// After connect_ports. Faults name both ends and the policy. Ports of one process are joined directly and are not
/// compared.
void check_qos(LoadedCell& loaded);

}  // namespace invar::tools

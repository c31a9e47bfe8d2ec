#include "tools/cell/partner_ends.hpp"

#include "core/dds/cell_client.hpp"
#include "core/dds/live_process.hpp"
#include "idl/lifecycle.h"

namespace invar::tools {

void PartnerEnds::hear(dds::Node& node, const std::string& cell) {
  ends_ = node.reader<lifecycle::ProcessStatus>(
      dds::ServiceTopics{cell}.process_status, "state", [this](const lifecycle::ProcessStatus& status) {
        if (status.pid() != 0) return;
        for (Standby* standby : standbys_)
          if (standby->paired() && standby->paired()->other_process == status.process_name().c_str())
            standby->hear_of_end(static_cast<std::int32_t>(status.ended_pid()));
      });
}

void PartnerEnds::look() const {
  for (Standby* standby : standbys_) standby->look_for_process(&dds::is_alive);
}

}  // namespace invar::tools

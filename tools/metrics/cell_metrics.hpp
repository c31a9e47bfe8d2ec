// CellMetrics: what one look at a running cell found, as metrics of Prometheus.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "tools/live/status_view.hpp"
#include "tools/live/topic_watch.hpp"
#include "tools/metrics/device_signs.hpp"
#include "tools/metrics/families.hpp"

namespace invar::tools {

struct CellLook {
  CellStatus status;
  std::map<std::string, Flows> flows;  // by topic
  DeviceSigns::Seen devices;
  std::map<std::pair<std::string, event::Severity>, std::uint64_t>
      notices;          // by source, since the exporter began
  std::string release;  // of `invar deploy`; empty: none
};

/// Processes that are missing, silent or ended have `process_up` 0 and no other metric: what they said last is not how they are.
[[nodiscard]] Families metrics_of(const CellLook& look);

}  // namespace invar::tools

// BridgeFile: which topics of a cell the plant reads, and which of the plant the cell takes, as the cell file says.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/dds/identity.hpp"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

enum class Direction { out, in };  // out: from the cell to the plant

/// One topic on its way, one way alone.
struct BridgeLine {
  Direction direction = Direction::out;
  std::string cell_topic, plant_topic, type, profile;
  double rate = 10.0;  // [Hz], the most that passes
};

struct BridgeFile {
  std::uint32_t domain = 0;
  std::string host;                    // of the cell, which runs the bridge
  std::vector<std::string> addresses;  // of that host in the plant's network; empty: all
  std::vector<std::string> peers;      // of programs of the plant, where multicast does not pass
  std::optional<dds::Identity>
      plant;  // of the bridge, where the plant's domain is secured, by an authority of the plant
  std::vector<BridgeLine> lines;
};

/// The part `bridge` of a cell file; faults go to the document. Without one it has no lines.
[[nodiscard]] BridgeFile read_bridge(const LoadedCell& loaded);

}  // namespace invar::tools

// BridgeFile: which topics of a cell the plant reads, and which of the plant the cell takes, as the cell file says.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// As which `invar bridge` takes part in the cell.
inline constexpr const char* bridge_name = "bridge";

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
  std::vector<BridgeLine> lines;
};

/// The part `bridge` of a cell file; faults go to the document. Without one it has no lines.
[[nodiscard]] BridgeFile read_bridge(const LoadedCell& loaded);

}  // namespace invar::tools

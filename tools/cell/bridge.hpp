// Bridge: passes named topics between a cell's domain and the plant's, each one way and at a bounded rate.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/dds/node.hpp"
#include "tools/cell/bridge_file.hpp"

namespace invar::tools {

/// How many samples of a line came, passed, were left out by its rate, and were refused.
struct BridgeCount {
  std::uint64_t came = 0, passed = 0, left_out = 0, refused = 0;
};

/// Samples pass as they came, byte for byte, if they are sound: decoded, within the bounds of their IDL, with finite numbers,
/// and of the cell's own number. Where the newest sample counts (depth 1) it takes the place of one that waits. Otherwise sixteen of a
/// writer wait, none longer than its lifespan; further ones are left out.
class Bridge {
 public:
  /// `cell`, `plant`: a node in each domain; they must outlive it.
  Bridge(const BridgeFile& file, std::uint32_t cell_number, dds::Node& cell, dds::Node& plant);
  ~Bridge();
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;

  /// Passes on what is due. Every few milliseconds.
  void pass();
  [[nodiscard]] BridgeCount count(std::size_t line) const;

 private:
  struct Line;
  std::vector<std::unique_ptr<Line>> lines_;
};

}  // namespace invar::tools

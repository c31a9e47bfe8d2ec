// Pattern: the targets of a print, as a cell file describes them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/component/parameters.hpp"

namespace invar::dispenser {

struct Pattern {
  std::string name;
  std::string kind = "grid";
  std::vector<double> from;
  std::vector<double> to;
  std::vector<double> pitch;
  std::int64_t columns = 1;
  std::int64_t rows = 1;
  std::int64_t droplets = 2;
  std::filesystem::path file;
  void describe(auto& p) {
    p(name, "name", "by which it is asked for");
    p(kind, "kind", "grid: rows along x, forth and back; line: from one point to another; file: a table");
    p(from, "from", "m", "[x, y] of the first droplet of a grid or a line");
    p(to, "to", "m", "[x, y] of the last droplet of a line");
    p(pitch, "pitch", "m", "[along x, along y] between the droplets of a grid");
    p(columns, "columns", 1, 4096, "droplets in a row of a grid");
    p(rows, "rows", 1, 4096, "rows of a grid");
    p(droplets, "droplets", 2, 4096, "droplets of a line");
    p(file, "file", "CSV with target_x [m], target_y [m], in the order of printing");
    if constexpr (requires { p.node(); }) {
      const auto need = [&](bool good, const char* what, const char* mend) {
        if (!good) p.node().fault(what, mend);
      };
      need(!name.empty(), "the pattern has no name", "add `name:`");
      if (kind == "grid") {
        need(from.size() == 2 && pitch.size() == 2, "a grid needs `from` and `pitch` with two numbers each",
             "write from: [0.06, 0.06] and pitch: [2.0e-3, 2.0e-3]");
        need(columns * rows <= 4096, "the grid has more than 4096 droplets", "make several patterns of it");
      } else if (kind == "line") {
        need(from.size() == 2 && to.size() == 2 && from != to,
             "a line needs `from` and `to`, two numbers each and not the same",
             "write from: [0.06, 0.06] and to: [0.07, 0.06]");
      } else if (kind == "file") {
        need(!file.empty(), "the pattern names no file", "add `file:`");
      } else {
        p.node()["kind"].fault("`" + kind + "` is no kind of pattern", "use grid, line or file");
      }
    }
  }
};

/// In the order of printing [m]. Throws InputError for a file that cannot be used. Set-up only.
[[nodiscard]] std::vector<Eigen::Vector2d> targets(const Pattern& pattern);

}  // namespace invar::dispenser

// The systemd unit by which a PC runs its processes of a cell.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// Absolute paths on the PC that will run the cell.
struct UnitPaths {
  std::filesystem::path program;    // .../bin/invar
  std::filesystem::path cell;       // the cell file
  std::filesystem::path data;       // where the cell runs: recordings, state, models that it was given
  std::filesystem::path libraries;  // searched for shared libraries first; empty: those of the system
};

struct UnitOptions {
  std::string host;
  std::string user = "invar";
  double watchdog = 0.0;  // s; 0: ten seconds, or eight periods of the slowest loop where that is more
};

/// "invar-xy_table.service"
[[nodiscard]] std::string unit_name(const config::Cell& cell);

/// "invar-xy_table-bridge.service": of the host that runs the bridge to the plant.
[[nodiscard]] std::string bridge_unit_name(const config::Cell& cell);
/// Nothing: the bridge runs on another host, or there is none. Throws as `unit_text`.
[[nodiscard]] std::optional<std::string> bridge_unit_text(const LoadedCell& loaded, const UnitPaths& paths,
                                                          const UnitOptions& options);

/// The text of the unit: one service for all processes of the host. `invar run` starts, watches and stops them in order, and
/// systemd watches `invar run`. Real-time rights follow from the file. Throws InputError for an unknown host, one without
/// processes, a user that cannot be, or a path that is not absolute or has control characters.
[[nodiscard]] std::string unit_text(const LoadedCell& loaded, const UnitPaths& paths,
                                    const UnitOptions& options);

/// A word of a command line as systemd reads it: specifiers, variables, quotes and escapes are letters in it.
[[nodiscard]] std::string command_word(const std::string& text);
/// The value of a setting that takes a path, and one in a list of paths.
[[nodiscard]] std::string path_value(const std::string& text);
[[nodiscard]] std::string listed_path(const std::string& text);

}  // namespace invar::tools

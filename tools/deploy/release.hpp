// A release: everything that a PC needs to run a cell, named by its content.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

struct ReleaseFile {
  std::string path;              // within the release: "cell/maps/heater.yaml"
  std::filesystem::path source;  // empty: `text` is the content
  std::string text;
  std::string sha256;
  std::uintmax_t size = 0;

  [[nodiscard]] bool is_program() const { return path.starts_with("bin/"); }
  /// Its name among the contents that a PC keeps. A program's mode differs, so that it is kept apart.
  [[nodiscard]] std::string stored() const { return sha256 + (is_program() ? ".x" : ""); }
};

struct Release {
  std::string name;                // the first 16 digits of the SHA-256 of `manifest`
  std::string cell_file;           // within the release
  std::string manifest;            // "SHA-256  path" a line, sorted, as sha256sum(1) reads it
  std::vector<ReleaseFile> files;  // in that order
  [[nodiscard]] std::uintmax_t size() const;
};

struct ReleaseOptions {
  std::filesystem::path cell;
  std::filesystem::path home;  // folder of the cell on its PCs: "/opt/invar/xy_table"
  std::string user = "invar";
};

/// The cell file and the files and folders that it names, below cell/, where they lie to one another; the cell file is the
/// first. `absolute` gets a fault for each that the file names by an absolute path. Sums are left empty.
[[nodiscard]] std::vector<ReleaseFile> files_of_cell(const LoadedCell& loaded, std::vector<Fault>& absolute);

/// Folders bin/ and lib/ hold this program, its loadable parts and the shared libraries that it has loaded, but for the C
/// library's. Folder cell/ holds the cell file and all files and folders that it names, where they lie to one another. File
/// CELL holds its path; KEYS holds the place of a secured cell's keys, which stay on each PC. Folder units/ holds a systemd
/// unit a host. Throws InputError for a file that is named by an absolute path, that cannot be read, or whose name cannot be in
/// a manifest.
[[nodiscard]] Release make_release(const LoadedCell& loaded, const ReleaseOptions& options);

/// Hexadecimal, of a text and of a file. The second throws InputError.
[[nodiscard]] std::string sha256_of(const std::string& text);
[[nodiscard]] std::string sha256_of_file(const std::filesystem::path& file);

}  // namespace invar::tools

// A file that takes its name when it is finished: nobody ever reads half of one, and a fault leaves the old one.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

namespace invar {

/// Mode of every file that Invar makes, less the umask: the owner writes, the group reads. Recordings, models and reports tell
/// of a plant.
inline constexpr unsigned new_file_mode = 0640;

/// A stream that writes `file` anew, made with `new_file_mode` where it is not there yet. Look at the stream before use.
[[nodiscard]] std::ofstream new_stream(const std::filesystem::path& file);

class NewFile {
 public:
  /// A link is followed; a device or a pipe is written into as it is. Throws InputError where a folder stands.
  explicit NewFile(const std::filesystem::path& name);
  ~NewFile();  // an unfinished one goes
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  /// Where to write until it is finished; it is there, empty.
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Throws InputError where the name cannot be given.
  void finish();
  /// Throws InputError: it cannot be written.
  [[noreturn]] void refuse() const;

 private:
  std::filesystem::path name_, target_, path_;
  bool finished_ = false;
};

/// The whole file at once. Throws InputError.
void write_file(const std::filesystem::path& name, const std::string& text);

}  // namespace invar

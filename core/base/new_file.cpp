#include "core/base/new_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <fstream>

#include "core/base/fault.hpp"

namespace invar {

namespace fs = std::filesystem;

std::ofstream new_stream(const fs::path& file) {
  // A stream would make it readable, and under a lax umask writable, by everybody.
  if (const int made = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NONBLOCK, new_file_mode);
      made >= 0)
    ::close(made);
  return std::ofstream{file, std::ios::binary};
}

NewFile::NewFile(const fs::path& name) : name_{name}, target_{name} {
  std::error_code none;
  const auto there = fs::status(name, none);
  if (fs::is_directory(there)) throw InputError{name.string(), "is a folder", "name a file"};
  path_ = name;
  if (fs::exists(there) && !fs::is_regular_file(there)) {
    finished_ = true;  // to rename a file over a device would take the device away
    return;
  }
  for (int links = 0; links < 32 && fs::is_symlink(fs::symlink_status(target_, none)); ++links)
    target_ = target_.parent_path() / fs::read_symlink(target_, none);
  path_ = target_;
  path_ += ".part";
  fs::remove(path_, none);  // of one that was killed, with whatever mode
  (void)new_stream(path_);
}

NewFile::~NewFile() {
  std::error_code ignored;
  if (!finished_) fs::remove(path_, ignored);
}

void NewFile::finish() {
  if (finished_) return;
  std::error_code failed;
  fs::rename(path_, target_, failed);
  if (failed) refuse();
  finished_ = true;
}

void NewFile::refuse() const {
  throw InputError{name_.string(), "cannot be written",
                   "check the folder, its permissions and the space left"};
}

void write_file(const fs::path& name, const std::string& text) {
  NewFile file{name};
  std::ofstream out{file.path(), std::ios::binary};
  out << text;
  out.close();
  if (!out) file.refuse();
  file.finish();
}

}  // namespace invar

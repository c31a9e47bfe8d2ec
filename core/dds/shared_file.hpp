// SharedFile: a file in /dev/shm that processes of one user map to share memory.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace invar::dds {

/// The maker holds a lock on the file while it lives and removes the file at the end; a file without a lock is a
/// leftover of a killed process. The mode is 0600: processes of other users do not take part.
class SharedFile {
 public:
  /// Zeroed, with its memory reserved. nullptr: the folder is missing, full or not writable, or the name is taken.
  [[nodiscard]] static std::unique_ptr<SharedFile> make(const std::string& name, std::size_t size);
  /// nullptr: there is none of that name here, or this user may not open it.
  [[nodiscard]] static std::unique_ptr<SharedFile> open(const std::string& name);
  ~SharedFile();
  SharedFile(const SharedFile&) = delete;
  SharedFile& operator=(const SharedFile&) = delete;

  [[nodiscard]] std::byte* data() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  SharedFile(int file, std::string own_path, std::byte* data, std::size_t size);
  int file_;
  std::string own_path_;  // empty: made by another process
  std::byte* data_;
  std::size_t size_;
};

/// Removes files of killed processes. Returns how many.
std::size_t remove_abandoned_shared_files();

}  // namespace invar::dds

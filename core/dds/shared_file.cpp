#include "core/dds/shared_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ctime>
#include <filesystem>

namespace invar::dds {

namespace {

const std::filesystem::path memory_folder{"/dev/shm"};
constexpr const char* prefix = "invar_";

std::byte* map(int file, std::size_t size) {
  void* data = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, file, 0);
  return data == MAP_FAILED ? nullptr : static_cast<std::byte*>(data);
}

/// A file is locked within a moment of its making; one younger than this may not be locked yet.
constexpr std::time_t locked_within_s = 5;

bool is_abandoned(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return false;
  struct stat status {};
  const bool abandoned = fstat(file, &status) == 0 &&
                         std::time(nullptr) - status.st_ctime >= locked_within_s &&
                         flock(file, LOCK_EX | LOCK_NB) == 0;
  close(file);
  return abandoned;
}

}  // namespace

std::unique_ptr<SharedFile> SharedFile::make(const std::string& name, std::size_t size) {
  const std::string path = memory_folder / (prefix + name);
  const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return nullptr;
  // Reserved, not only sized: a full folder is an error here instead of a SIGBUS later.
  std::byte* data = nullptr;
  if (flock(file, LOCK_EX | LOCK_NB) == 0 && posix_fallocate(file, 0, static_cast<off_t>(size)) == 0)
    data = map(file, size);
  if (data != nullptr) return std::unique_ptr<SharedFile>{new SharedFile{file, path, data, size}};  // NOLINT
  unlink(path.c_str());
  close(file);
  return nullptr;
}

std::unique_ptr<SharedFile> SharedFile::open(const std::string& name) {
  const std::string path = memory_folder / (prefix + name);
  const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return nullptr;
  struct stat status {};
  if (fstat(file, &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == geteuid() &&
      status.st_size > 0) {
    const auto size = static_cast<std::size_t>(status.st_size);
    if (std::byte* data = map(file, size))
      return std::unique_ptr<SharedFile>{new SharedFile{file, {}, data, size}};  // NOLINT
  }
  close(file);
  return nullptr;
}

SharedFile::SharedFile(int file, std::string own_path, std::byte* data, std::size_t size)
    : file_{file}, own_path_{std::move(own_path)}, data_{data}, size_{size} {}

SharedFile::~SharedFile() {
  munmap(data_, size_);
  if (!own_path_.empty()) unlink(own_path_.c_str());
  close(file_);
}

std::size_t remove_abandoned_shared_files() {
  std::size_t removed = 0;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator{memory_folder, error})
    if (entry.path().filename().string().starts_with(prefix) && is_abandoned(entry.path()) &&
        std::filesystem::remove(entry.path(), error))
      ++removed;
  return removed;
}

}  // namespace invar::dds

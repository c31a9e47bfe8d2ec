#include "tools/deploy/archive.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <sstream>

#include "core/base/fault.hpp"
#include "core/base/name.hpp"
#include "tools/deploy/release.hpp"
#include "tools/deploy/remote.hpp"

namespace invar::tools {

namespace {

constexpr std::size_t block = 512;
constexpr const char* sums_name = "SHA256SUMS";

/// The text of a field, up to its zero.
std::string field(const std::string& head, std::size_t at, std::size_t size) {
  const std::string text = head.substr(at, size);
  return text.substr(0, text.find('\0'));
}

bool is_safe(const std::string& path) {
  const std::filesystem::path parts{path};
  return !path.empty() && parts.is_relative() && !flaw_of_label(path, 1000) &&
         path.find('\\') == std::string::npos &&
         std::none_of(parts.begin(), parts.end(),
                      [](const auto& part) { return part == ".." || part == "."; });
}

class Reader {
 public:
  Reader(const std::string& bytes, std::string where) : bytes_{bytes}, where_{std::move(where)} {}

  [[nodiscard]] std::vector<ArchiveFile> read() const {
    std::vector<ArchiveFile> files;
    std::size_t at = 0;
    for (; at + block <= bytes_.size() && bytes_[at] != '\0';) {
      const std::string head = bytes_.substr(at, block);
      const std::string path = field(head, 0, 100), size = field(head, 124, 12);
      if (size.empty() || size.find_first_not_of("01234567") != std::string::npos || size.size() > 11)
        refuse();
      const std::uint64_t length = std::stoull(size, nullptr, 8);
      if (length > bytes_.size() - at - block) refuse();
      if (!is_safe(path) || path.size() >= 100) refuse();
      files.push_back({path, bytes_.substr(at + block, length)});
      at += block + length + tar_padding(length).size();
    }
    if (bytes_.size() < at + 2 * block || files.empty() || files.front().path != sums_name) refuse();
    return files;
  }

  [[noreturn]] void refuse() const {
    throw InputError{where_, "is no backup of Invar, or was cut or changed",
                     "name a file that `invar backup` wrote"};
  }

 private:
  const std::string& bytes_;
  std::string where_;
};

std::string sums_of(const std::vector<ArchiveFile>& files) {
  std::string sums;
  for (const ArchiveFile& file : files) sums += sha256_of(file.content) + "  " + file.path + "\n";
  return sums;
}

}  // namespace

std::string archive_of(const std::vector<ArchiveFile>& files) {
  std::vector<ArchiveFile> all{{sums_name, sums_of(files)}};
  all.insert(all.end(), files.begin(), files.end());
  std::string bytes;
  for (const ArchiveFile& file : all) {
    if (!is_safe(file.path) || file.path.size() >= 100)
      throw InputError{printable(file.path), "has a name that a backup cannot hold",
                       "shorten it to less than 100 letters, without control characters"};
    bytes += tar_head(file.path, file.content.size()) + file.content + tar_padding(file.content.size());
  }
  return bytes + tar_end();
}

std::vector<ArchiveFile> read_archive(const std::string& bytes, const std::string& where) {
  const Reader reader{bytes, where};
  std::vector<ArchiveFile> files = reader.read();
  files.erase(files.begin());
  // Byte for byte what we write of these files: their sums, no link, no device, no other name, nothing beside.
  if (archive_of(files) != bytes) reader.refuse();
  return files;
}

}  // namespace invar::tools

// A tar archive (ustar) of small files with a sum of each: written at once, read as a whole or not at all.
#pragma once

#include <string>
#include <vector>

namespace invar::tools {

struct ArchiveFile {
  std::string path;  // relative, without `..`
  std::string content;
};

/// First comes SHA256SUMS, as sha256sum(1) reads it. Throws InputError for a path that tar cannot hold.
[[nodiscard]] std::string archive_of(const std::vector<ArchiveFile>& files);

/// The files but SHA256SUMS. Throws InputError, in the name of `where`, for anything but what archive_of makes. That may be a part
/// that is missing or changed, a link, a path out of the archive, or a file without a sum.
[[nodiscard]] std::vector<ArchiveFile> read_archive(const std::string& bytes, const std::string& where);

}  // namespace invar::tools

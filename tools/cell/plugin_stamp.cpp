#include "tools/cell/plugin_stamp.hpp"

#include <elf.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>

#include "core/base/shown.hpp"
#include "core/component/plugin.hpp"

namespace invar::tools {

namespace {

constexpr const char* section_name = ".invar.plugin";
constexpr std::size_t longest_stamp = 4096;
#if defined(__x86_64__)
constexpr Elf64_Half own_machine = EM_X86_64;
#elif defined(__aarch64__)
constexpr Elf64_Half own_machine = EM_AARCH64;
#else
#error "name the ELF machine of this platform"
#endif

/// A struct at `offset` of the file; nothing beyond its end.
template <class T>
std::optional<T> read_at(std::ifstream& file, std::uint64_t offset) {
  T value{};
  file.clear();
  if (offset > static_cast<std::uint64_t>(INT64_MAX)) return {};
  file.seekg(static_cast<std::streamoff>(offset));
  if (!file.read(reinterpret_cast<char*>(&value), sizeof value)) return {};
  return value;
}

std::string text_at(std::ifstream& file, std::uint64_t offset, std::size_t most) {
  std::string text(most, '\0');
  file.clear();
  if (offset > static_cast<std::uint64_t>(INT64_MAX)) return "";
  file.seekg(static_cast<std::streamoff>(offset));
  file.read(text.data(), static_cast<std::streamsize>(most));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return text.substr(0, text.find('\0'));
}

std::optional<Elf64_Ehdr> library_head(std::ifstream& file) {
  const auto head = read_at<Elf64_Ehdr>(file, 0);
  if (!head || std::memcmp(head->e_ident, ELFMAG, SELFMAG) != 0) return {};
  return head;
}

/// The text of the section; nothing where there is none.
std::optional<std::string> stamp_of(std::ifstream& file, const Elf64_Ehdr& head) {
  if (head.e_shentsize != sizeof(Elf64_Shdr)) return {};
  const auto section = [&](std::uint64_t index) {
    return read_at<Elf64_Shdr>(file, head.e_shoff + index * sizeof(Elf64_Shdr));
  };
  const auto names = section(head.e_shstrndx);
  if (!names) return {};
  for (std::uint64_t i = 0; i < head.e_shnum; ++i) {
    const auto one = section(i);
    if (!one) return {};
    if (text_at(file, names->sh_offset + one->sh_name, std::strlen(section_name) + 1) != section_name)
      continue;
    return text_at(file, one->sh_offset, std::min<std::uint64_t>(one->sh_size, longest_stamp));
  }
  return {};
}

std::map<std::string, std::string> parts_of(const std::string& stamp) {
  std::map<std::string, std::string> parts;
  std::istringstream words{stamp};
  for (std::string word; words >> word;)
    if (const auto sign = word.find('='); sign != std::string::npos)
      parts[word.substr(0, sign)] = word.substr(sign + 1);
  return parts;
}

/// "headers 3fa2, this is 9b1c": what differs, part by part.
std::string difference(const std::string& theirs, const std::string& ours) {
  const auto other = parts_of(theirs), own = parts_of(ours);
  std::string text;
  for (const auto& [key, value] : own) {
    const auto found = other.find(key);
    const std::string their = found == other.end() ? "none" : found->second;
    if (their != value) text += (text.empty() ? "" : "; ") + key + " " + clipped(their) + ", here " + value;
  }
  return text.empty() ? "a stamp that this program does not know" : text;
}

}  // namespace

const std::string& own_stamp() {
  static const std::string stamp = INVAR_PLUGIN_STAMP;
  return stamp;
}

Fault why_not_a_plugin(const std::filesystem::path& file) {
  const auto fault = [&](const std::string& what, const std::string& mend) {
    return Fault{file.string(), what, mend};
  };
  std::error_code unseen;
  if (std::filesystem::is_symlink(std::filesystem::symlink_status(file, unseen)) &&
      !std::filesystem::exists(file, unseen))
    return fault("cannot be loaded: it is a link to a file that does not exist",
                 "build the library, or mend the link");
  if (!std::filesystem::is_regular_file(file, unseen))
    return fault("cannot be loaded: there is no such file", "name a shared library");
  std::ifstream stream{file, std::ios::binary};
  const auto head = library_head(stream);
  if (!head)
    return fault("cannot be loaded: it is no shared library", "name what the linker made: lib....so");
  if (head->e_ident[EI_CLASS] != ELFCLASS64 || head->e_ident[EI_DATA] != ELFDATA2LSB ||
      head->e_type != ET_DYN || head->e_machine != own_machine)
    return fault("cannot be loaded: it is no shared library for this PC's processor", "build it on this PC");
  const auto stamp = stamp_of(stream, *head);
  if (!stamp)
    return fault("carries no stamp of Invar: it is no plug-in, or was built before plug-ins had one",
                 "add INVAR_PLUGIN(registry) { ... } to it, and build it with this installation");
  if (*stamp != own_stamp())
    return fault("was built against another Invar (" + difference(*stamp, own_stamp()) + ")",
                 "build it again with this installation");
  return {};
}

}  // namespace invar::tools

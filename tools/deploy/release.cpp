#include "tools/deploy/release.hpp"

#include <dlfcn.h>
#include <link.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <memory>
#include <numeric>
#include <set>

#include "core/base/name.hpp"
#include "tools/deploy/unit.hpp"

namespace invar::tools {

namespace {

namespace fs = std::filesystem;

class Sha256 {
 public:
  Sha256() : context_{EVP_MD_CTX_new(), EVP_MD_CTX_free} {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }
  void add(const char* bytes, std::size_t size) { EVP_DigestUpdate(context_.get(), bytes, size); }
  std::string digits() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    std::string text;
    for (unsigned i = 0; i < size; ++i) {
      text += "0123456789abcdef"[digest[i] / 16];
      text += "0123456789abcdef"[digest[i] % 16];
    }
    return text;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

/// Files on this PC by their paths within the release.
using Sources = std::map<std::string, fs::path>;

/// The C library and its loader belong to the system of the other PC.
bool is_of_the_c_library(const std::string& name) {
  constexpr std::array<std::string_view, 9> begins{"linux-vdso", "ld-linux",      "libc.so",
                                                   "libm.so",    "libpthread.so", "libdl.so",
                                                   "librt.so",   "libresolv.so",  "libutil.so"};
  return std::any_of(begins.begin(), begins.end(), [&](auto begin) { return name.starts_with(begin); });
}

int add_library(dl_phdr_info* info, std::size_t, void* sources) {
  const fs::path file = info->dlpi_name;
  if (file.is_absolute() && !is_of_the_c_library(file.filename()))
    static_cast<Sources*>(sources)->emplace("lib/" + file.filename().string(), file);
  return 0;
}

/// Whether a component handles pictures; only then OpenCV goes along, which is larger than all the rest.
bool has_pictures(const config::Cell& cell) {
  for (const config::CellProcess& process : cell.processes)
    for (const config::CellComponent& component : process.components)
      if (component.type == "vision" || component.type.ends_with("_camera")) return true;
  return false;
}

void add_program(const config::Cell& cell, Sources& sources) {
  const fs::path program = fs::canonical("/proc/self/exe");
  sources.emplace("bin/invar", program);
  const fs::path parts = program.parent_path().parent_path() / "lib" / "invar";
  std::error_code none;
  for (const auto& part : fs::directory_iterator{parts, none}) {
    if (part.path().extension() != ".so" || !has_pictures(cell)) continue;
    sources.emplace("lib/invar/" + part.path().filename().string(), part.path());
    (void)dlopen(part.path().c_str(), RTLD_NOW | RTLD_LOCAL);  // for the libraries that it stands on
  }
  dl_iterate_phdr(add_library, &sources);
  for (const fs::path& plugin : cell.plugins) {  // not twice: they go along as files of the cell
    const std::string name = "lib/" + plugin.filename().string();
    if (const auto found = sources.find(name);
        found != sources.end() && fs::equivalent(found->second, plugin, none))
      sources.erase(found);
  }
}

/// What the cell file names, as named there: relative where it is relative.
std::vector<fs::path> named_files(const LoadedCell& loaded) {
  const config::Cell& cell = *loaded.cell;
  std::vector<fs::path> named{cell.profiles};
  named.insert(named.end(), cell.plugins.begin(), cell.plugins.end());
  named.insert(named.end(), cell.models.begin(), cell.models.end());
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components)
      for (const ParameterInfo& info : member.prepared.infos)
        if (info.type == "file" && !info.otherwise.empty() && fs::exists(info.otherwise))
          named.emplace_back(info.otherwise);
  return named;
}

/// A path that shell, sha256sum and systemd on the other PC all read as the same file.
void check_name(const std::string& path) {
  const auto flaw = flaw_of_label(path, 1000);
  if (!flaw && path.find('\\') == std::string::npos) return;
  throw InputError{printable(path), flaw ? "its name " + flaw->what : "its name has a backslash",
                   "rename it"};
}

/// Where the cell file finds the keys, within the release: there a link leads to those of the PC. Secrets are in no release.
std::string place_of_keys(const config::Cell& cell, const std::string& cell_file) {
  const fs::path folder = fs::absolute(cell.file).lexically_normal().parent_path();
  const std::string place =
      (fs::path{cell_file}.parent_path() / cell.security->keys.lexically_relative(folder))
          .lexically_normal()
          .string();
  if (!place.starts_with("cell/") || place.size() <= 5)
    throw InputError{cell.file.string() + ": security.keys",
                     "lies outside of the folders of the cell's files", "name a folder beside the cell file"};
  return place;
}

}  // namespace

std::uintmax_t Release::size() const {
  return std::accumulate(files.begin(), files.end(), std::uintmax_t{0},
                         [](std::uintmax_t sum, const ReleaseFile& file) { return sum + file.size; });
}

std::string sha256_of(const std::string& text) {
  Sha256 sum;
  sum.add(text.data(), text.size());
  return sum.digits();
}

std::string sha256_of_file(const fs::path& file) {
  std::ifstream stream{file, std::ios::binary};
  Sha256 sum;
  std::vector<char> part(1 << 16);
  while (stream.read(part.data(), static_cast<std::streamsize>(part.size())) || stream.gcount() > 0)
    sum.add(part.data(), static_cast<std::size_t>(stream.gcount()));
  if (!stream.eof())
    throw InputError{printable(file.string()), "cannot be read", "check the path and its permissions"};
  return sum.digits();
}

std::vector<ReleaseFile> files_of_cell(const LoadedCell& loaded, std::vector<Fault>& absolute) {
  const fs::path file = fs::absolute(loaded.cell->file).lexically_normal();
  std::vector<fs::path> named{file};
  for (const fs::path& path : named_files(loaded)) {
    if (path.is_absolute())
      absolute.push_back({loaded.cell->file.string(),
                          "names `" + printable(path.string()) + "`, which other PCs do not have",
                          "name it relative to the cell file"});
    named.push_back(fs::absolute(path).lexically_normal());
  }
  fs::path top = file.parent_path();
  for (const fs::path& path : named)
    while (*path.lexically_relative(top).begin() == "..") top = top.parent_path();
  std::vector<ReleaseFile> files;
  std::set<fs::path> seen;
  const auto add = [&](const fs::path& path) {
    if (seen.insert(path).second)
      files.push_back({"cell/" + path.lexically_relative(top).string(), path, "", "", fs::file_size(path)});
  };
  for (const fs::path& path : named) {
    if (!fs::is_directory(path)) {
      add(path);
      continue;
    }
    for (const auto& member : fs::recursive_directory_iterator{path})
      if (member.is_regular_file()) add(member.path());
  }
  return files;
}

Release make_release(const LoadedCell& loaded, const ReleaseOptions& options) {
  Release release;
  std::vector<Fault> absolute;
  release.files = files_of_cell(loaded, absolute);
  if (!absolute.empty()) throw InputError{absolute};
  release.cell_file = release.files.front().path;
  Sources sources;
  add_program(*loaded.cell, sources);
  for (const auto& [path, source] : sources)
    release.files.push_back({path, source, "", "", fs::file_size(source)});
  for (ReleaseFile& file : release.files) file.sha256 = sha256_of_file(file.source);
  const auto add_text = [&](const std::string& path, const std::string& text) {
    release.files.push_back({path, "", text, sha256_of(text), text.size()});
  };
  add_text("CELL", release.cell_file + "\n");
  if (loaded.cell->security) add_text("KEYS", place_of_keys(*loaded.cell, release.cell_file) + "\n");
  const fs::path current = options.home / "current";
  std::set<std::string> hosts;
  for (const config::CellProcess& process : loaded.cell->processes) hosts.insert(process.host);
  for (const std::string& host : hosts) {
    const UnitPaths paths{.program = current / "bin/invar",
                          .cell = current / release.cell_file,
                          .data = options.home / "data",
                          .libraries = current / "lib"};
    const UnitOptions unit{.host = host, .user = options.user};
    add_text("units/" + host + "/" + unit_name(*loaded.cell), unit_text(loaded, paths, unit));
    if (const auto bridge = bridge_unit_text(loaded, paths, unit))
      add_text("units/" + host + "/" + bridge_unit_name(*loaded.cell), *bridge);
  }
  std::sort(release.files.begin(), release.files.end(),
            [](const auto& a, const auto& b) { return a.path < b.path; });
  for (const ReleaseFile& file : release.files) {
    check_name(file.path);
    release.manifest += file.sha256 + "  " + file.path + "\n";
  }
  release.name = sha256_of(release.manifest).substr(0, 16);
  return release;
}

}  // namespace invar::tools

#include "tools/deploy/host_keys.hpp"

#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/base/fault.hpp"
#include "core/dds/identity.hpp"
#include "tools/cell/bridge_file.hpp"
#include "tools/deploy/archive.hpp"

namespace invar::tools {

namespace {

namespace fs = std::filesystem;

void add(const fs::path& file, const fs::path& folder, std::vector<ArchiveFile>& files) {
  std::ifstream stream{file, std::ios::binary};
  if (!stream)
    throw InputError{file.string(), "cannot be read by this user",
                     "`invar keys CELL` makes what is missing; deploy as the user that has the keys"};
  files.push_back({file.lexically_relative(folder).string(), {std::istreambuf_iterator<char>{stream}, {}}});
}

}  // namespace

std::vector<std::string> key_holders(const LoadedCell& loaded, const std::string& host) {
  const config::Cell& cell = *loaded.cell;
  std::vector<std::string> names;
  for (const config::CellProcess& process : cell.processes)
    if (process.host == host) names.push_back(process.name);
  names.push_back(config::launcher_name(host));
  if (cell.has_bridge && read_bridge(loaded).host == host) names.emplace_back(config::bridge_name);
  if (!cell.security->viewers.empty()) names.push_back(cell.security->viewers.front());
  return names;
}

std::string keys_for(const LoadedCell& loaded, const std::string& host) {
  const dds::KeyFolder keys{loaded.cell->security->keys};
  std::vector<ArchiveFile> files;
  std::string missing;
  std::error_code none;
  for (const std::string& holder : key_holders(loaded, host))
    for (const std::string& name : {holder, dds::second_name(holder)}) {
      const bool is_there = fs::exists(keys.key(name), none);
      if (!is_there && name == holder) missing += (missing.empty() ? "`" : ", `") + name + "`";
      if (!is_there) continue;
      for (const fs::path& file : {keys.certificate(name), keys.key(name), keys.permissions(name)})
        add(file, keys.path, files);
    }
  if (files.empty()) return "";
  if (!missing.empty())
    throw InputError{keys.path.string(),
                     "has no key of " + missing + " for host `" + host + "`, but has others",
                     "`invar keys CELL` makes what is missing"};
  for (const fs::path& file :
       {keys.identity_authority(), keys.permissions_authority(), keys.governance(), keys.revoked()})
    add(file, keys.path, files);
  return archive_of(files);
}

}  // namespace invar::tools

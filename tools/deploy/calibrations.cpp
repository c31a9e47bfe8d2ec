#include "tools/deploy/calibrations.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <sstream>

#include "core/base/name.hpp"
#include "core/base/new_file.hpp"
#include "tools/cell/process_claim.hpp"
#include "tools/deploy/release.hpp"

namespace invar::tools {

namespace {

namespace fs = std::filesystem;

constexpr const char* about_name = "BACKUP";

/// Where a folder's files stand in the archive.
std::string place_of(const fs::path& folder) {
  const fs::path normal = folder.lexically_normal();
  return normal.is_absolute() ? "root" + normal.string() : (fs::path{"data"} / normal).string();
}

fs::path on_this_pc(const fs::path& folder, const fs::path& data) {
  fs::path path = (folder.is_absolute() ? folder : data / folder).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

std::string content_of(const fs::path& file) {
  std::ifstream stream{file, std::ios::binary};
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) throw InputError{printable(file.string()), "cannot be read", "check its permissions"};
  return text.str();
}

/// Names and times: the same before and after means that nobody wrote meanwhile.
std::map<fs::path, fs::file_time_type> seen_in(const fs::path& folder) {
  std::map<fs::path, fs::file_time_type> seen;
  std::error_code gone;
  for (const auto& entry : fs::recursive_directory_iterator{folder, gone})
    if (entry.is_regular_file(gone)) seen[entry.path()] = entry.last_write_time(gone);
  return seen;
}

void add_folder(const fs::path& folder, const std::string& place, std::vector<ArchiveFile>& files) {
  for (int tries = 0; tries < 5; ++tries) {
    std::vector<ArchiveFile> read;
    const auto before = seen_in(folder);
    try {
      for (const auto& [file, time] : before)
        read.push_back({place + "/" + file.lexically_relative(folder).string(), content_of(file)});
    } catch (const InputError&) {
      if (seen_in(folder) == before) throw;
      continue;
    }
    if (seen_in(folder) != before) continue;
    files.insert(files.end(), read.begin(), read.end());
    return;
  }
  throw InputError{folder.string(), "is written again and again", "wait until the calibration is done"};
}

/// A folder that was made whole, to be exchanged for the one that is there.
struct Staged {
  fs::path target, made, before;
  bool existed = false;
  std::size_t files = 0;
};

/// What root restores belongs to the one in whose folder it lies, as the service that runs the cell.
void give(const fs::path& path, const struct stat& owner) {
  if (geteuid() == 0) (void)!lchown(path.c_str(), owner.st_uid, owner.st_gid);
}

[[noreturn]] void refuse(const fs::path& path) {
  throw InputError{printable(path.string()), std::string{"cannot be written: "} + std::strerror(errno),
                   "check the permissions of its folder; nothing was changed"};
}

Staged stage(const fs::path& target, const std::string& place, const std::vector<ArchiveFile>& files,
             const fs::path& data) {
  Staged staged{target, target.string() + ".restored", target.string() + ".before", fs::exists(target), 0};
  struct stat owner {};
  if (stat(data.c_str(), &owner) != 0) refuse(data);
  std::error_code error;
  fs::remove_all(staged.made, error);
  std::set<fs::path> folders;  // made on the way
  for (fs::path folder = staged.made; !folder.empty() && !fs::exists(folder); folder = folder.parent_path())
    folders.insert(folder);
  if (!fs::create_directories(staged.made, error) && error) refuse(staged.made);
  for (const ArchiveFile& file : files) {
    if (!file.path.starts_with(place + "/")) continue;
    const fs::path path = staged.made / file.path.substr(place.size() + 1);
    for (fs::path folder = path.parent_path(); !fs::exists(folder); folder = folder.parent_path())
      folders.insert(folder);
    fs::create_directories(path.parent_path());
    write_file(path, file.content);
    give(path, owner);
    ++staged.files;
  }
  for (const fs::path& folder : folders) give(folder, owner);
  return staged;
}

/// The folder and the one that was made change their names at once.
bool exchange(const Staged& staged) {
  const unsigned flags = staged.existed ? RENAME_EXCHANGE : 0;
  return renameat2(AT_FDCWD, staged.made.c_str(), AT_FDCWD, staged.target.c_str(), flags) == 0;
}

void exchange_all(const std::vector<Staged>& all) {
  sync();  // files before names
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (exchange(all[i])) continue;
    const int error = errno;
    for (; i > 0; --i) {
      const Staged& done = all[i - 1];
      if (done.existed)
        (void)exchange(done);
      else
        (void)rename(done.target.c_str(), done.made.c_str());
    }
    errno = error;
    refuse(all[i].target);
  }
  std::error_code ignored;
  for (const Staged& staged : all) {
    if (!staged.existed) continue;
    fs::remove_all(staged.before, ignored);
    fs::rename(staged.made, staged.before, ignored);
  }
  sync();
}

std::string about(const config::Cell& cell) {
  return "invar_backup: 1\ncell: " + cell.name + "\nversion: " INVAR_VERSION "\n";
}

/// Refuses what is no backup of this cell.
void check(const LoadedCell& loaded, const std::vector<ArchiveFile>& files, const std::string& where) {
  const auto found =
      std::find_if(files.begin(), files.end(), [](const auto& file) { return file.path == about_name; });
  if (found == files.end())
    throw InputError{where, "is a backup of several PCs, or none",
                     "restore it by `invar restore --deployed`"};
  std::istringstream lines{found->content};
  std::string version, name;
  std::getline(lines, version);
  std::getline(lines, name);
  if (version != "invar_backup: 1")
    throw InputError{where, "has a version that this program does not know", "use the program that wrote it"};
  if (name != "cell: " + loaded.cell->name)
    throw InputError{where, "is a backup of another cell (`" + printable(name) + "`)",
                     "name the file of that cell"};
  for (const ArchiveFile& file : files) {
    if (file.path == about_name || file.path.starts_with("cell/")) continue;
    const auto folders = calibration_folders(loaded);
    if (std::none_of(folders.begin(), folders.end(),
                     [&](const auto& folder) { return file.path.starts_with(place_of(folder) + "/"); }))
      throw InputError{where, "holds `" + file.path + "`, and this cell keeps nothing there",
                       "restore with the cell file of that time, which is in the backup"};
  }
}

}  // namespace

std::vector<fs::path> calibration_folders(const LoadedCell& loaded) {
  std::set<fs::path> folders{"out/models"};  // tools/cell/process.cpp
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components)
      for (const ParameterInfo& info : member.prepared.infos)
        if (info.path.substr(info.path.find_last_of('.') + 1) == "state" && !info.otherwise.empty())
          folders.insert(fs::path{info.otherwise}.lexically_normal());
  return {folders.begin(), folders.end()};
}

std::string backup_of(const LoadedCell& loaded, const fs::path& data) {
  std::vector<ArchiveFile> files{{about_name, about(*loaded.cell)}};
  for (const fs::path& folder : calibration_folders(loaded))
    add_folder(on_this_pc(folder, data), place_of(folder), files);
  std::vector<Fault> absolute;  // all the same here: they are for people
  for (const ReleaseFile& file : files_of_cell(loaded, absolute))
    if (file.path.size() < 100 && file.size < 64 * 1024 * 1024)
      files.push_back({file.path, content_of(file.source)});
  return archive_of(files);
}

std::vector<std::string> restore(const LoadedCell& loaded, const fs::path& data, const std::string& bytes,
                                 const std::string& where, bool dry_run) {
  const std::vector<ArchiveFile> files = read_archive(bytes, where);
  check(loaded, files, where);
  if (dry_run) return {};
  std::vector<std::unique_ptr<ProcessClaim>>
      claims;  // so no process starts meanwhile, and none that runs is disturbed
  for (const config::CellProcess& process : loaded.cell->processes)
    claims.push_back(std::make_unique<ProcessClaim>(*loaded.cell, process.name));
  std::vector<Staged> all;
  std::vector<std::string> lines;
  for (const fs::path& folder : calibration_folders(loaded)) {
    const std::string place = place_of(folder);
    const fs::path target = on_this_pc(folder, data);
    const bool holds = std::any_of(files.begin(), files.end(),
                                   [&](const auto& file) { return file.path.starts_with(place + "/"); });
    if (!holds && !fs::exists(target)) continue;
    all.push_back(stage(target, place, files, data));
    lines.push_back(target.string() + ": " + std::to_string(all.back().files) + " files");
  }
  exchange_all(all);
  return lines;
}

}  // namespace invar::tools

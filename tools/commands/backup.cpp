// `invar backup` and `invar restore`: what a cell has calibrated, as a file and back.
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <string>

#include "core/base/input_file.hpp"
#include "core/base/name.hpp"
#include "core/base/new_file.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/command.hpp"
#include "tools/commands/remote_options.hpp"
#include "tools/deploy/calibrations.hpp"
#include "tools/deploy/deployment.hpp"

namespace invar::tools {

namespace {

constexpr std::size_t largest_backup = 1024UL * 1024 * 1024;  // bytes; calibrations are a thousandth of that

struct BackupOptions {
  DeployOptions remote;
  std::filesystem::path data, file;
  std::string service = "systemd";
  bool deployed = false, dry_run = false;
};

int tell(const HostFaults& faults, const char* command) {
  for (const std::string& fault : faults)
    std::cerr << "invar " << command << ": " << printable_lines(fault) << '\n';
  return faults.empty() ? 0 : 1;
}

std::filesystem::path data_of(const BackupOptions& options) {
  const auto data =
      options.data.empty() ? std::filesystem::current_path() : std::filesystem::absolute(options.data);
  if (!std::filesystem::is_directory(data))
    throw InputError{"--data", "`" + printable(data.string()) + "` is no folder",
                     "name the one in which the cell runs"};
  return data;
}

int backup(const BackupOptions& options) {
  check_remote_options(options.remote);
  std::string bytes;
  if (options.deployed) {
    if (const HostFaults faults = back_up(options.remote, bytes); !faults.empty())
      return tell(faults, "backup");
  } else {
    bytes = backup_of(load_cell(options.remote.cell), data_of(options));
  }
  if (options.file != "-") {
    write_file(options.file, bytes);
  } else if (std::fwrite(bytes.data(), 1, bytes.size(), stdout) !=
             bytes.size()) {  // std::cout is for letters
    throw InputError{"standard output", "cannot be written", "look for a full disk or a closed pipe"};
  }
  return 0;
}

/// Empty where it is too large to be one.
std::string bytes_of(const std::filesystem::path& file) {
  if (file == "-") return {std::istreambuf_iterator<char>{std::cin}, {}};
  close(open_input(file, "a file that `invar backup` wrote"));  // refuses what is no file
  if (std::filesystem::file_size(file) > largest_backup) return "";
  std::ifstream stream{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{stream}, {}};
}

int restore(BackupOptions& options) {
  check_remote_options(options.remote);
  options.remote.service = options.service == "systemd";
  const std::string bytes = bytes_of(options.file);
  const std::string where = options.file == "-" ? "the input" : options.file.string();
  const auto say = [](const std::string& line) { std::cout << printable(line) << '\n'; };
  if (options.deployed) return tell(restore_backups(options.remote, bytes, where, say), "restore");
  const LoadedCell loaded = load_cell(options.remote.cell);
  for (const std::string& line : tools::restore(loaded, data_of(options), bytes, where, options.dry_run))
    say(line);
  return 0;
}

std::shared_ptr<BackupOptions> common(CLI::App& command) {
  auto options = std::make_shared<BackupOptions>();
  command.add_option("file", options->remote.cell, "the cell file")->required();
  auto* data = command.add_option("--data", options->data,
                                  "folder in which the cell runs; otherwise that of this call");
  command.add_flag("--deployed", options->deployed, "all PCs that `invar deploy` serves, by ssh")
      ->excludes(data);
  add_remote_options(command, options->remote);
  return options;
}

}  // namespace

void add_backup(CLI::App& program) {
  auto* command = program.add_subcommand("backup", "Write what a cell has calibrated into one file");
  command->footer(
      "Example: invar backup deployment/xy-table.yaml --out xy-table.tar\n"
      "The file holds each folder `state` and the models that commands sent (out/models), with a SHA-256 of "
      "each.\n"
      "The cell may run. For people, the cell file and the files that it names are in it too; tar reads it.\n"
      "Exit status: 0 written, 1 a PC failed, 2 the call or a file is wrong");
  auto options = common(*command);
  command->add_option("--out", options->file, "the file; - is the standard output")->required();
  command->callback([options] {
    if (const int status = backup(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

void add_restore(CLI::App& program) {
  auto* command = program.add_subcommand("restore", "Put back what a cell had calibrated, from a backup");
  command->footer(
      "Example: invar restore deployment/xy-table.yaml xy-table.tar\n"
      "The cell must not run; with --deployed it is stopped and started. Each folder changes as a whole; a "
      "fault "
      "in one leaves all as they were.\n"
      "A folder as it was before stays beside it as NAME.before. The cell file and the files that it names "
      "stay.\n"
      "Exit status: 0 restored, 1 a PC failed, 2 the call or a file is wrong: nothing was changed");
  auto options = common(*command);
  command->add_option("backup", options->file, "the file; - is the standard input")->required();
  command->add_option("--host", options->remote.only, "with --deployed: this PC alone, the others go on")
      ->needs("--deployed");
  command->add_flag("--dry-run", options->dry_run, "look for faults of the backup, and change nothing");
  command->add_option("--service", options->service, "with --deployed, as of `invar deploy`")
      ->check(CLI::IsMember({"systemd", "none"}))
      ->capture_default_str();
  command->callback([options] {
    if (const int status = restore(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools

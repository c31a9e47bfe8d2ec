// `invar units`: the systemd unit by which a PC runs its processes of a cell.
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/new_file.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/command.hpp"
#include "tools/deploy/unit.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

struct UnitsOptions {
  std::filesystem::path cell, out, data, program;
  UnitOptions unit;
};

int units(const UnitsOptions& options) {
  const LoadedCell loaded = load_cell(options.cell);
  const auto absolute = [](const std::filesystem::path& path) {
    return std::filesystem::absolute(path).lexically_normal();
  };
  UnitPaths paths;
  paths.program = options.program.empty() ? std::filesystem::read_symlink("/proc/self/exe") : options.program;
  paths.cell = absolute(options.cell);
  paths.data = options.data.empty() ? std::filesystem::current_path() : absolute(options.data);
  std::vector<std::pair<std::string, std::string>> units{
      {unit_name(*loaded.cell), unit_text(loaded, paths, options.unit)}};
  if (const auto bridge = bridge_unit_text(loaded, paths, options.unit))
    units.emplace_back(bridge_unit_name(*loaded.cell), *bridge);
  if (!options.out.empty()) std::filesystem::create_directories(options.out);
  for (const auto& [name, text] : units) {
    if (options.out.empty()) {
      std::cout << (units.size() > 1 ? "# ---- " + name + "\n" : "") << text;
      continue;
    }
    write_file(options.out / name, text);
    std::cout << (options.out / name).string() << '\n';
  }
  return 0;
}

}  // namespace

void add_units(CLI::App& program) {
  auto* command = program.add_subcommand("units", "Write the systemd unit of a cell's host");
  command->footer(
      "Example: invar units deployment/xy-table.yaml --host stage-pc --data /srv/xy-table --out "
      "/etc/systemd/system\n"
      "One service runs all processes of the host: `invar run` starts them, watches them and stops them in "
      "order.\n"
      "The service is ready when all components are up. systemd restarts it where `invar run` hangs.\n"
      "A process whose loop makes no cycle for half of --watchdog is ended and restarted by `invar run`.\n"
      "The host that `bridge` of the file names has a second service, for `invar bridge`.\n"
      "`invar deploy` writes and installs the units of all hosts by itself.\n"
      "Exit status: 0 written, 2 the call or the file is wrong");
  auto options = std::make_shared<UnitsOptions>();
  command->add_option("file", options->cell, "the cell file, where it lies on that PC")->required();
  command->add_option("--host", options->unit.host, "the host of the file")->required();
  command->add_option("--out", options->out, "folder for the unit; without it, the text is printed");
  command->add_option("--data", options->data,
                      "folder in which the cell runs and writes; otherwise the folder of this call");
  command->add_option("--program", options->program, "invar on that PC; otherwise this program");
  command->add_option("--user", options->unit.user, "user of the service")->capture_default_str();
  command
      ->add_option("--watchdog", options->unit.watchdog,
                   "time without progress after which systemd acts [s]; otherwise 10 s, or 8 periods of the "
                   "slowest loop")
      ->check(positive());
  command->callback([options] {
    if (const int status = units(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools

// `invar check`: finds every fault of a cell file before anything starts.
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/name.hpp"
#include "tools/cell/drives.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/command.hpp"

namespace invar::tools {

namespace {

struct CheckOptions {
  std::filesystem::path file;
  bool json = false;
};

/// "1 process", "3 processes".
std::string counted(std::size_t number, const std::string& one, const std::string& several) {
  return std::to_string(number) + " " + (number == 1 ? one : several);
}

int check(const CheckOptions& options) {
  std::vector<Fault> faults, notes;
  std::size_t components = 0;
  std::size_t processes = 0;
  try {
    const LoadedCell loaded = load_cell(options.file);
    for (const LoadedProcess& process : loaded.processes) components += process.components.size();
    processes = loaded.processes.size();
    notes = unchecked(loaded);
  } catch (const InputError& error) {
    faults = error.faults();
  }
  if (options.json) {
    nlohmann::json report{
        {"file", options.file.string()}, {"sound", faults.empty()}, {"faults", nlohmann::json::array()}};
    for (const Fault& fault : faults)
      report["faults"].push_back({{"where", fault.where}, {"what", fault.what}, {"mend", fault.mend}});
    report["unchecked"] = nlohmann::json::array();
    for (const Fault& note : notes)
      report["unchecked"].push_back({{"where", note.where}, {"what", note.what}, {"mend", note.mend}});
    std::cout << report.dump(2) << '\n';
  } else {
    for (const Fault& fault : faults) std::cerr << printable(fault.line()) << '\n';
    if (faults.empty())
      std::cout << options.file.string() << ": sound (" << counted(components, "component", "components")
                << " in " << counted(processes, "process", "processes") << ")\n";
    for (const Fault& note : notes) std::cout << printable(note.line()) << '\n';
  }
  return faults.empty() ? 0 : 2;
}

}  // namespace

void add_check(CLI::App& program) {
  auto* command = program.add_subcommand("check", "Find every fault of a cell file before anything starts");
  command->footer(
      "Example: invar check deployment/xy-table.yaml\nExit status: 0 sound, 2 faults (one a line on stderr)");
  auto options = std::make_shared<CheckOptions>();
  command->add_option("file", options->file, "the cell file")->required();
  command->add_flag("--json", options->json, "print the faults as JSON on stdout");
  command->callback([options] {
    if (const int status = check(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools

// `invar doctor`: what of this PC would hurt a cell, and how to mend it.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/live/commands.hpp"
#include "tools/live/host_checks.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/network_checks.hpp"

namespace invar::tools {

namespace {

std::string word(Finding::Level level) {
  return level == Finding::Level::good ? "good" : level == Finding::Level::note ? "note" : "BAD";
}

struct DoctorOptions {
  std::filesystem::path cell;
  bool json = false;
};

int doctor(const DoctorOptions& options) {
  auto findings = check_host();
  if (!options.cell.empty())
    for (Finding& finding : check_network(*read_structure(options.cell)))
      findings.push_back(std::move(finding));
  if (options.json) {
    auto list = nlohmann::ordered_json::array();
    for (const Finding& finding : findings)
      list.push_back({{"level", finding.level == Finding::Level::bad ? "bad" : word(finding.level)},
                      {"what", finding.what},
                      {"state", finding.state},
                      {"mend", finding.mend}});
    std::cout << list.dump(2) << '\n';
  } else {
    for (const Finding& finding : findings) {
      const std::string level = word(finding.level);
      std::cout << level << std::string(6 - level.size(), ' ') << finding.what << ": " << finding.state
                << (finding.mend.empty() ? "" : "; " + finding.mend) << '\n';
    }
  }
  return std::any_of(findings.begin(), findings.end(),
                     [](const Finding& finding) { return finding.level == Finding::Level::bad; })
             ? 1
             : 0;
}

}  // namespace

void add_doctor(CLI::App& program) {
  auto* command =
      program.add_subcommand("doctor", "Find what of this PC would hurt a cell, and how to mend it");
  command->footer(
      "Example: invar doctor deployment/xy-table.yaml\n"
      "With a cell file also whether this PC is one of its hosts, which UDP ports a firewall must let in, "
      "whether "
      "discovery passes, and room in /dev/shm.\n"
      "Looks only; changes nothing. Exit status: 0 nothing is bad (notes may be); 1 something is");
  auto options = std::make_shared<DoctorOptions>();
  command->add_option("CELL", options->cell, "a cell file, whose network is looked at too");
  command->add_flag("--json", options->json, "print it as JSON");
  command->callback([options] {
    if (const int result = doctor(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools

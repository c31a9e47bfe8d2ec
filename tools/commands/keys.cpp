// `invar keys`: makes the authorities, certificates and permissions of a secured cell.
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/fault.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/command.hpp"
#include "tools/keys/key_ring.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

struct KeysOptions {
  std::filesystem::path cell, out;
  KeyOrder order;
  bool json = false;
};

void print_keys(const std::vector<KeyState>& states) {
  TextTable table{{"name", "role", "valid until (UTC)", "certificate"}};
  for (const KeyState& state : states) table.add({state.name, text_of(state.role), state.until, state.state});
  table.print(std::cout);
}

nlohmann::ordered_json to_json(const std::vector<KeyState>& states, const std::filesystem::path& folder) {
  nlohmann::ordered_json json{{"folder", folder.string()}, {"keys", nlohmann::ordered_json::array()}};
  for (const KeyState& state : states)
    json["keys"].push_back({{"name", state.name},
                            {"role", text_of(state.role)},
                            {"until", state.until},
                            {"certificate", state.state}});
  return json;
}

void keys(KeysOptions& options) {
  LoadedCell loaded = load_cell(options.cell);
  const auto& security = loaded.cell->security;
  const std::filesystem::path beside = std::filesystem::absolute(options.cell).parent_path() / "keys";
  options.order.folder = !options.out.empty() ? options.out : security ? security->keys : beside;
  const std::vector<KeyState> states = make_keys(loaded, options.order);
  if (options.json) {
    std::cout << to_json(states, options.order.folder).dump(2) << '\n';
    return;
  }
  print_keys(states);
  std::cout << '\n';
  print_wrapped("keys in " + options.order.folder.string() +
                    ": each PC gets `public` and the folders of its own names, never `authority`",
                2, std::cout);
  if (!security)
    print_wrapped("the cell is not secured yet: add `security: {keys: " +
                      options.order.folder.lexically_proximate(beside.parent_path()).string() + "}` to " +
                      options.cell.string() + " and start it anew",
                  2, std::cout);
}

}  // namespace

void add_keys(CLI::App& program) {
  auto* command = program.add_subcommand("keys", "Make the keys and permissions of a secured cell");
  command->footer(
      "Example: invar keys deployment/xy-table.yaml\n"
      "         invar keys cell.yaml --revoke anna\n"
      "         invar keys cell.yaml --renew motion --days 365\n"
      "Authorities and certificates that are there already are kept; what is missing is made.\n"
      "Permissions follow from the cell file and are signed anew: call it after each change of the file.\n"
      "Exit status: 0; 2 a fault of the call, the file or the folder");
  auto options = std::make_shared<KeysOptions>();
  command->add_option("CELL", options->cell, "the cell file")->required();
  command->add_option("--out", options->out, "folder of the keys, instead of that of the file");
  command->add_option("--days", options->order.days, "how long a new certificate is valid (730)")
      ->check(CLI::Range(1, 7300));
  command->add_option("--renew", options->order.renew, "give this name another key and certificate")
      ->allow_extra_args(false);
  command->add_option("--revoke", options->order.revoke, "let nobody in with the certificate of this name")
      ->allow_extra_args(false);
  command->add_flag("--json", options->json, "print it as JSON");
  command->callback([options] { keys(*options); });
}

}  // namespace invar::tools

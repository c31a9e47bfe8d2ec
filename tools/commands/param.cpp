// `invar param`: looks at and changes the parameters of running components.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/live/commands.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/parameter_json.hpp"
#include "tools/live/text_table.hpp"

namespace invar::tools {

namespace {

struct ParamOptions {
  ParamOptions(CLI::App& command, std::vector<Word> words) : call{command, std::move(words)} {}
  CellCall call;
  bool json = false;
};

nlohmann::ordered_json json_of(const lifecycle::Parameter& p) {
  return json_of(ShownParameter{.component = p.component_name().c_str(),
                                .path = p.path().c_str(),
                                .type = p.kind().c_str(),
                                .unit = p.unit_text().c_str(),
                                .value = p.value().c_str(),
                                .otherwise = "",
                                .range = range_of(p.bounds().c_str()),
                                .while_running = p.changeable(),
                                .description = p.description().c_str()});
}

int show(const std::vector<lifecycle::Parameter>& parameters, bool json) {
  if (json) {
    auto list = nlohmann::ordered_json::array();
    for (const auto& parameter : parameters) list.push_back(json_of(parameter));
    std::cout << list.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    return 0;
  }
  TextTable table{{"component", "parameter", "value", "unit", "bounds", "while running", "what"}};
  for (const auto& p : parameters)
    table.add({p.component_name().c_str(), p.path().c_str(), p.value().c_str(), p.unit_text().c_str(),
               p.bounds().c_str(), p.changeable() ? "yes" : "no", p.description().c_str()});
  table.print(std::cout);
  return 0;
}

/// The parameters of one component, or of every process when `component` is empty.
int call(ParamOptions& options, lifecycle::ParameterAction action) {
  options.call.resolve();
  const std::string& component = options.call.word(0);
  const bool lists = action == lifecycle::PARAMETER_LIST;
  const std::string path = lists ? "" : options.call.word(1);
  const std::string value = action == lifecycle::PARAMETER_SET ? options.call.word(2) : "";
  LiveCell cell{options.call};
  if (!cell.found()) {
    cell.say_not_found(options.call.command);
    return 1;
  }
  std::vector<std::string> processes;
  if (!component.empty()) {
    const std::string process = cell.process_of(component);
    if (process.empty() && cell.file() != nullptr)
      throw InputError{"COMPONENT", "`" + component + "` is no component of " + cell.file()->file.string(),
                       "use a name below `components`"};
    if (process.empty()) {
      std::cerr << options.call.command << ": no process says that it has `" << component << "`\n";
      return 1;
    }
    processes.push_back(process);
  } else {
    cell.wait_for_processes();
    for (const auto& process : cell.client().processes())
      processes.emplace_back(process.process_name().c_str());
    if (processes.empty()) {
      cell.say_not_found(options.call.command);
      return 1;
    }
  }
  std::vector<lifecycle::Parameter> parameters;
  for (const auto& process : processes) {
    const auto reply = cell.client().parameter(process, component, action, path, value, cell.patience());
    if (!reply) {
      std::cerr << options.call.command << ": process `" << process << "` does not answer"
                << cell.clocks_apart(process) << '\n';
      return 1;
    }
    if (!reply->done()) {
      std::cerr << options.call.command << ": " << reply->text().c_str() << '\n';
      return 1;
    }
    parameters.insert(parameters.end(), reply->parameters().begin(), reply->parameters().end());
  }
  if (lists || options.json) return show(parameters, options.json);
  for (const auto& p : parameters)
    std::cout << p.value().c_str() << (p.unit_text().to_string().empty() ? "" : " ") << p.unit_text().c_str()
              << '\n';
  return 0;
}

void add_action(CLI::App& group, const std::string& name, const std::string& about, std::vector<Word> words,
                lifecycle::ParameterAction action, const std::string& example) {
  auto* command = group.add_subcommand(name, about);
  command->footer(
      "Example: " + example +
      "\nExit status: 0 done; 1 refused (the reason says which bounds) or no answer; 2 a fault of the "
      "call or the file");
  auto options = std::make_shared<ParamOptions>(*command, std::move(words));
  command->add_flag("--json", options->json, "print it as JSON");
  command->callback([options, action] {
    if (const int result = call(*options, action); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace

void add_param(CLI::App& program) {
  auto* group = program.add_subcommand("param", "List, read and change the parameters of running components");
  group->require_subcommand(1);
  group->footer("Example: invar param set deployment/xy-table.yaml thermal setpoint 32");
  add_action(*group, "list", "List the parameters with their units, bounds and meaning",
             {{"COMPONENT", "only of this one", false}}, lifecycle::PARAMETER_LIST,
             "invar param list deployment/xy-table.yaml thermal");
  add_action(*group, "get", "Print one parameter's value",
             {{"COMPONENT", "whose"}, {"PATH", "name of the parameter, such as pid.kp"}},
             lifecycle::PARAMETER_GET, "invar param get deployment/xy-table.yaml thermal setpoint");
  add_action(*group, "set", "Change a parameter while the component runs",
             {{"COMPONENT", "whose"},
              {"PATH", "name of the parameter, such as pid.kp"},
              {"VALUE", "the new value, with a unit where it is not the parameter's own"}},
             lifecycle::PARAMETER_SET, "invar param set deployment/xy-table.yaml thermal setpoint 32");
}

}  // namespace invar::tools

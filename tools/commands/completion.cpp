// `invar completion`: completion of commands and options for bash, made from what the program knows of itself.
#include <iostream>
#include <string>

#include "tools/live/commands.hpp"

namespace invar::tools {

namespace {

/// One case of the script for each command: its subcommands and options.
void add_cases(const CLI::App& app, const std::string& path, std::string& cases) {
  std::string words;
  for (const auto* command : app.get_subcommands({})) words += command->get_name() + ' ';
  for (const auto* option : app.get_options())
    for (const auto& name : option->get_lnames()) words += "--" + name + ' ';
  cases += "    \"" + path + "\") words=\"" + words + "\" ;;\n";
  for (const auto* command : app.get_subcommands({}))
    add_cases(*command, path.empty() ? command->get_name() : path + ' ' + command->get_name(), cases);
}

void print_script(const CLI::App& program) {
  std::string cases;
  add_cases(program, "", cases);
  std::cout << "# Completion of `invar` for bash: source it, or put it into /etc/bash_completion.d/.\n"
               "_invar() {\n"
               "  local path=\"\" word words\n"
               "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n"
               "    case \"$word\" in -*|*[./]*) break ;; esac\n"
               "    path=\"${path:+$path }$word\"\n"
               "  done\n"
               "  case \"$path\" in\n"
            << cases
            << "  esac\n"
               "  COMPREPLY=($(compgen -W \"$words\" -- \"${COMP_WORDS[COMP_CWORD]}\"))\n"
               "}\n"
               "complete -o default -F _invar invar\n";
}

}  // namespace

void add_completion(CLI::App& program) {
  auto* command =
      program.add_subcommand("completion", "Print a script that completes commands and options in bash");
  command->footer("Example: source <(invar completion)\nExit status: 0");
  command->callback([&program] { print_script(program); });
}

}  // namespace invar::tools

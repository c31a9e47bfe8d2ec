#include "tools/wrong_call.hpp"

#include "core/config/yaml.hpp"

namespace invar::tools {

namespace {

std::vector<std::string> subcommand_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::App* sub : command.get_subcommands({})) names.push_back(sub->get_name());
  return names;
}

std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

std::string meant(const std::string& word, const std::vector<std::string>& choices) {
  const std::string near = config::nearest(word, choices);
  return near.empty() ? "" : "; did you mean `" + near + "`?";
}

}  // namespace

std::string wrong_call(const CLI::App& program, const std::vector<std::string>& words,
                       const CLI::ParseError& error) {
  const CLI::App* command = &program;
  std::string path = program.get_name();
  std::string what = error.what();
  for (const std::string& word : words) {
    const auto subs = command->get_subcommands([&](const CLI::App* sub) { return sub->get_name() == word; });
    if (!subs.empty()) {
      command = subs.front();
      path += " " + word;
    } else if (word.starts_with("--") && word.size() > 2) {
      const std::string option = word.substr(0, word.find('='));
      if (command->get_option_no_throw(option) != nullptr) continue;
      what = path + " has no option `" + option + "`" + meant(option, option_names(*command));
      break;
    } else if (!word.starts_with('-') && command->get_require_subcommand_min() > 0) {
      what = path + " has no subcommand `" + word + "`" + meant(word, subcommand_names(*command));
      break;
    }
  }
  return what + (what.ends_with('?') ? " See `" : "; see `") + path + " --help`";
}

}  // namespace invar::tools

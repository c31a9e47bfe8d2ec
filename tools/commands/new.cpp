// `invar new`: a working start of a component, a cell or a register map, in a folder of its own.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <string>

#include "components/all.hpp"
#include "core/base/fault.hpp"
#include "core/base/name.hpp"
#include "core/base/new_file.hpp"
#include "core/base/shown.hpp"
#include "core/component/registry.hpp"
#include "tools/command.hpp"
#include "tools/new/templates.hpp"

namespace invar::tools {

namespace {

struct NewOptions {
  std::string name;
  std::filesystem::path out;
  int domain = 0;  // none: that of the template
};

/// Names of a build's own targets (CMake), and of the class inside a component: a component cannot have them.
constexpr std::array<std::string_view, 10> taken{
    "all",     "clean",      "edit_cache",    "help", "install", "list_install_components",
    "package", "parameters", "rebuild_cache", "test"};

/// "low_pass" as a class: "LowPass".
std::string class_of(std::string_view name) {
  std::string made;
  bool begins = true;
  for (const char letter : name) {
    if (letter != '_')
      made += begins ? static_cast<char>(std::toupper(static_cast<unsigned char>(letter))) : letter;
    begins = letter == '_';
  }
  return made;
}

/// The text with `name` in the place of the example's, as it is and as a class.
std::string renamed(std::string_view text, std::string_view example, const std::string& name) {
  std::string made;
  const std::string as_class = class_of(example);
  while (!text.empty()) {
    if (text.starts_with(example)) {
      made += name;
      text.remove_prefix(example.size());
    } else if (text.starts_with(as_class)) {
      made += class_of(name);
      text.remove_prefix(as_class.size());
    } else {
      made += text.front();
      text.remove_prefix(1);
    }
  }
  return made;
}

/// The number behind each `key` becomes another one.
void set_number(std::string& text, const std::string& key, int number) {
  for (std::size_t at = 0; (at = text.find(key, at)) != std::string::npos;) {
    at += key.size();
    const std::size_t end = std::min(text.find_first_not_of("0123456789", at), text.size());
    text.replace(at, end - at, std::to_string(number));
  }
}

void expect_name(const std::string& kind, const std::string& name) {
  if (const auto flaw = flaw_of_identifier(name))
    throw InputError{"NAME", "`" + clipped(printable(name)) + "` " + flaw->what, flaw->mend};
  if (std::isalpha(static_cast<unsigned char>(name.front())) == 0)
    throw InputError{"NAME", "`" + name + "` begins with no letter", "begin it with a letter"};
  if (kind != "component") return;
  Registry known;
  add_all_components(known);
  if (known.has(name))
    throw InputError{"NAME", "`" + name + "` is a component of Invar already (invar types " + name + ")",
                     "give another name"};
  if (std::find(taken.begin(), taken.end(), name) != taken.end())
    throw InputError{"NAME", "`" + name + "` is taken by the build", "give another name"};
}

/// Name to text of all files. Throws InputError where two would have one name.
std::map<std::string, std::string> files_of(const std::string& kind, const NewOptions& options) {
  std::map<std::string, std::string> files;
  for (const TemplateFile& file : template_files()) {
    if (file.kind != kind) continue;
    std::string text = renamed(file.text, file.example, options.name);
    if (options.domain > 0) {
      set_number(text, "\ndomain: ", options.domain);
      set_number(text, "--domain ", options.domain);
    }
    const std::string name = renamed(file.file, file.example, options.name);
    if (!files.emplace(name, text).second)
      throw InputError{"NAME", "`" + options.name + "` gives two files of the name " + name,
                       "give another name"};
  }
  return files;
}

/// All files or none: they are written beside, and the folder takes its name when it is whole.
void write_folder(const std::filesystem::path& folder, const std::map<std::string, std::string>& files) {
  namespace fs = std::filesystem;
  fs::path target = fs::absolute(folder).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();  // it was written with `/` at the end
  if (fs::exists(fs::symlink_status(target)))
    throw InputError{folder.string(), "exists already",
                     "name another folder with --out, or take that one away"};
  if (!fs::is_directory(target.parent_path()))
    throw InputError{folder.string(), "lies in a folder that does not exist", "make that one first"};
  const fs::path beside = target.string() + ".new-" + std::to_string(getpid());
  try {
    fs::create_directory(beside);
    for (const auto& [name, text] : files) write_file(beside / name, text);
    fs::rename(beside, target);
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(beside, ignored);
    throw;
  }
}

void make(const std::string& kind, const NewOptions& options) {
  expect_name(kind, options.name);
  const auto files = files_of(kind, options);
  const std::filesystem::path folder =
      options.out.empty() ? std::filesystem::path{options.name} : options.out;
  write_folder(folder, files);
  std::cout << printable(folder.string()) << ": " << files.size() << " files of a " << kind << "; "
            << printable((folder / "README.md").string()) << " says how to go on\n";
}

void add_kind(CLI::App& command, const std::string& kind, const std::string& what) {
  auto* sub = command.add_subcommand(kind, what);
  auto options = std::make_shared<NewOptions>();
  sub->add_option("NAME", options->name, "letters, digits and `_`; stands in files and texts")->required();
  sub->add_option("--out", options->out, "the folder to write, which does not exist yet (default: NAME)");
  sub->add_option("--domain", options->domain, "DDS domain of the cell (default: the template's)")
      ->check(CLI::Range(1, 230));
  sub->footer("Example: invar new " + kind + " my_" + kind +
              "\nExit status: 0; 2 a name that cannot be, or a folder that exists");
  sub->callback([kind, options] { make(kind, *options); });
}

}  // namespace

void add_new(CLI::App& program) {
  auto* command = program.add_subcommand(
      "new", "Write a working start of a component, a cell or a register map into a new folder");
  command->require_subcommand(1);
  command->footer(
      "Example: invar new component low_pass\n"
      "Each folder has a README.md with the commands that build, check and run it on simulated devices.");
  add_kind(*command, "component", "A component in C++ with build, test, and a cell that runs it");
  add_kind(*command, "cell", "A cell file with one simulated axis and a job that moves it");
  add_kind(*command, "map", "A register map of a Modbus device, and a cell that tries it on a simulated one");
}

}  // namespace invar::tools

#include "core/base/library.hpp"

#include <dlfcn.h>

#include <filesystem>

#include "core/base/fault.hpp"

namespace invar {

void* library_entry(const std::string& name, const char* entry) {
  std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  // The kernel says so of a program in whose place another was installed.
  if (const std::string gone = " (deleted)"; program.ends_with(gone))
    program.resize(program.size() - gone.size());
  const auto file =
      std::filesystem::path{program}.parent_path().parent_path() / "lib" / "invar" / ("lib" + name + ".so");
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* found = library != nullptr ? dlsym(library, entry) : nullptr;
  if (found == nullptr)
    throw InputError{
        file.string(), std::string{"cannot be loaded: "} + dlerror(),
        "install the package invar-vision, or build Invar again with its folder lib/invar and what "
        "tools/packages.txt names"};
  return found;
}

}  // namespace invar

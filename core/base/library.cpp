#include "core/base/library.hpp"

#include <dlfcn.h>

#include <filesystem>

#include "core/base/fault.hpp"

namespace invar {

void* library_entry(const std::string& name, const char* entry) {
  const auto program = std::filesystem::canonical("/proc/self/exe");
  const auto file = program.parent_path().parent_path() / "lib" / "invar" / ("lib" + name + ".so");
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* found = library != nullptr ? dlsym(library, entry) : nullptr;
  if (found == nullptr)
    throw InputError{
        file.string(), std::string{"cannot be loaded: "} + dlerror(),
        "build or install Invar again, with its folder lib/invar, and what tools/packages.txt names"};
  return found;
}

}  // namespace invar

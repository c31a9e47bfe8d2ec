#include "core/base/contract.hpp"

#include <cstdio>
#include <cstdlib>

namespace invar {

void contract_broken(const char* file, int line, const char* condition, const std::string& values) {
  std::fprintf(stderr, "%s:%d: broken contract: %s (%s)\n", file, line, condition, values.c_str());
  std::fflush(stderr);
  std::abort();
}

}  // namespace invar

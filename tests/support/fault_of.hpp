// What a refused input is told.
#pragma once

#include <string>

#include "core/base/fault.hpp"

namespace invar::testing {

/// The message of the InputError that `what` throws, "accepted" when it throws none.
template <class Callable>
std::string fault_of(Callable&& what) {
  try {
    what();
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace invar::testing

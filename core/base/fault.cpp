#include "core/base/fault.hpp"

#include <utility>

#include "core/base/contract.hpp"

namespace invar {

namespace {
const std::vector<Fault>& checked(const std::vector<Fault>& faults) {
  INVAR_EXPECTS(!faults.empty());
  return faults;
}
}  // namespace

InputError::InputError(std::vector<Fault> faults)
    : std::runtime_error{checked(faults).front().line()}, faults_{std::move(faults)} {}

InputError::InputError(std::string where, std::string what, std::string mend)
    : InputError{std::vector<Fault>{{std::move(where), std::move(what), std::move(mend)}}} {}

}  // namespace invar

#include "core/base/fault.hpp"

#include <utility>

#include "core/base/contract.hpp"
#include "core/base/name.hpp"

namespace invar {

namespace {
const std::vector<Fault>& checked(const std::vector<Fault>& faults) {
  INVAR_EXPECTS(!faults.empty());
  return faults;
}

/// One line, whatever names stand in it: nothing that a terminal acts upon, and of a very long one both ends.
std::string shown_line(const std::string& line) {
  constexpr std::size_t most = 4000, ends = 1900;
  const std::string text = printable(line);
  if (text.size() <= most) return text;
  return printable(text.substr(0, ends)) + " ... " + printable(text.substr(text.size() - ends));
}
}  // namespace

InputError::InputError(std::vector<Fault> faults)
    : std::runtime_error{shown_line(checked(faults).front().line())}, faults_{std::move(faults)} {}

InputError::InputError(std::string where, std::string what, std::string mend)
    : InputError{std::vector<Fault>{{std::move(where), std::move(what), std::move(mend)}}} {}

}  // namespace invar

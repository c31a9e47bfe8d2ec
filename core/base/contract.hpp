// INVAR_EXPECTS: a broken precondition is our fault; it prints where, what and the values, and stops the
// process.
#pragma once

#include <sstream>
#include <string>

namespace invar {

/// Prints "file:line: broken contract: condition (values)" to stderr and aborts. The device's watchdog and
/// the outputs' safe values make that safe. Any thread.
[[noreturn]] void contract_broken(const char* file, int line, const char* condition,
                                  const std::string& values);

namespace detail {
template <class... Values>
std::string list_values(const Values&... values) {
  std::ostringstream text;
  [[maybe_unused]] const char* separator = "";
  ((text << separator << values, separator = ", "), ...);
  return text.str();
}
}  // namespace detail
}  // namespace invar

/// Always on. Never for user input and never for what a device answered: those are not our fault.
#define INVAR_EXPECTS(condition, ...)                                                                      \
  do {                                                                                                     \
    if (!(condition)) [[unlikely]]                                                                         \
      ::invar::contract_broken(__FILE__, __LINE__, #condition, ::invar::detail::list_values(__VA_ARGS__)); \
  } while (false)

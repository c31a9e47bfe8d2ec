// Faults of what a user gave us: where, what is wrong, how to mend it.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace invar {

/// One thing wrong with an input. `where` is "file:line: key", "file: column `x [m]`, row 7" or "--option".
struct Fault {
  std::string where;
  std::string what;
  std::string mend;

  /// "where: what; mend" on one line.
  [[nodiscard]] std::string line() const { return where + ": " + what + (mend.empty() ? "" : "; " + mend); }
};

/// Thrown while setting up and in offline tools when an input is unusable; the program prints it and ends
/// with status 2. Holds every fault that was found, at least one.
class InputError : public std::runtime_error {
 public:
  explicit InputError(std::vector<Fault> faults);
  InputError(std::string where, std::string what, std::string mend = "");

  [[nodiscard]] const std::vector<Fault>& faults() const { return faults_; }

 private:
  std::vector<Fault> faults_;
};

}  // namespace invar

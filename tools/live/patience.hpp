// How long a command may take to end after Ctrl-C.
#pragma once

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

namespace invar::tools {

/// After Ctrl-C a command reports the results so far, within a second or so. A single step may take for ever, and nobody should have
/// to end the program by hand. While this object lives, the program ends with status 130 so long after Ctrl-C, with `said` on
/// stderr. Nothing may be open then that must be closed.
class Patience {
 public:
  explicit Patience(std::string said, std::chrono::milliseconds left = std::chrono::seconds{10});
  ~Patience();
  Patience(const Patience&) = delete;
  Patience& operator=(const Patience&) = delete;

 private:
  void watch() const;

  std::string said_;
  std::chrono::milliseconds left_;
  std::atomic<bool> is_over_{false};
  std::thread watch_;
};

}  // namespace invar::tools

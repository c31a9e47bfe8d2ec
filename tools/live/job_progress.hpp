// JobProgress: how far a job is, on the error output: one line kept current on a terminal, elsewhere a line at each change.
#pragma once

#include <string>

namespace invar::tools {

class JobProgress {
 public:
  /// `fraction` of the whole, 0 to 1; `text`: what it does now.
  void show(double fraction, const std::string& text);
  /// Before anything else is written, and at the end.
  void end();

 private:
  std::string last_;
  bool open_ = false;
};

}  // namespace invar::tools

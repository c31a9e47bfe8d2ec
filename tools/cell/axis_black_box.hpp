// AxisBlackBox: what every axis of a process did goes into the black box of its executor.
#pragma once

#include <deque>
#include <functional>
#include <string>

#include "core/executor/executor.hpp"
#include "idl/event.h"
#include "idl/stage.h"

namespace invar::tools {

/// An axis in fault freezes the box, as a component in error does. Outlives the executor's components.
class AxisBlackBox {
 public:
  using Say = std::function<void(event::Severity level, const std::string& text)>;
  /// Set-up, once all components are in the executor. `say`: where the record of a trip was written, or why it was not.
  void fill(Executor& executor, Say say);

 private:
  std::deque<stage::AxisState> axes_;  // newest state of each, the loop's; addresses stay
};

}  // namespace invar::tools

// each_port: the ports of a process that have a topic.
#pragma once

#include <cstddef>

#include "core/executor/executor.hpp"

namespace invar::tools {

/// Calls `visit(index of the component, port)`.
template <class Visit>
void each_port(Executor& executor, Visit visit) {
  for (std::size_t i = 0; i < executor.size(); ++i)
    for (Port* port : executor.component(i).ports())
      if (!port->topic.empty()) visit(i, *port);
}

}  // namespace invar::tools

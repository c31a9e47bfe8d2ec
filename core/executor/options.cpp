#include "core/executor/options.hpp"

namespace invar {

std::string_view to_text(OverrunPolicy policy) {
  switch (policy) {
    case OverrunPolicy::degrade:
      return "degrade";
    case OverrunPolicy::safe_stop:
      return "safe_stop";
    case OverrunPolicy::skip:
      break;
  }
  return "skip";
}

ExecutorOptions executor_options(const config::CellProcess& process, bool simulated) {
  ExecutorOptions options;
  options.process = process.name;
  options.period = process.period;
  options.overrun = process.overrun;
  options.tolerated = static_cast<std::uint32_t>(process.tolerate);
  options.real_time = process.realtime;
  options.late = process.late;
  options.simulated = simulated;
  return options;
}

}  // namespace invar

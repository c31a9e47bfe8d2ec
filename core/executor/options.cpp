#include "core/executor/options.hpp"

#include <cmath>

namespace invar {

std::string_view to_text(OverrunPolicy policy) {
  switch (policy) {
    case OverrunPolicy::skip:
      return "skip";
    case OverrunPolicy::degrade:
      return "degrade";
    case OverrunPolicy::safe_stop:
      return "safe_stop";
  }
  return "skip";
}

namespace {

constexpr Range rates{0.01, 20'000.0};  // Hz

void read_loop(const config::Node& node, ExecutorOptions& options) {
  if (node.has("rate")) {
    const double rate = node.number("rate", "Hz", rates);
    options.period = {static_cast<std::int64_t>(std::llround(1e9 / rates.clamp(rate)))};
  }
  if (node.has("overrun")) {
    const std::string policy = node.choice("overrun", {"skip", "degrade", "safe_stop"});
    options.overrun = policy == "degrade"     ? OverrunPolicy::degrade
                      : policy == "safe_stop" ? OverrunPolicy::safe_stop
                                              : OverrunPolicy::skip;
    options.tolerated = options.overrun == OverrunPolicy::degrade ? 3 : 0;
  }
  if (node.has("tolerate"))
    options.tolerated = static_cast<std::uint32_t>(node.integer("tolerate", 0, 1'000'000));
}

}  // namespace

ExecutorOptions read_executor_options(const config::Node& process) {
  ExecutorOptions options;
  options.process = process.key();
  options.period = Duration::milliseconds(10);
  read_loop(process, options);
  if (!process.has("realtime")) return options;
  const config::Node node = process["realtime"];
  if (process.has("rate"))
    process["rate"].fault("the rate stands here and in `realtime`", "remove one of the two");
  read_loop(node, options);
  if (!node.has("rate")) node.fault("a real-time process has no rate", "add `rate: 1000`");
  RealTimeRequest request;
  request.priority = static_cast<int>(node.integer("priority", 0, 98, 0));
  if (node.has("cpu")) request.cpu = static_cast<int>(node.integer("cpu", 0, 1023));
  request.lock_memory = node.flag("lock_memory", false);
  request.require = node.flag("require", false);
  options.real_time = request;
  return options;
}

}  // namespace invar

// Wired: components joined port to port and stepped in order by hand, without executor, middleware or threads.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/component/component.hpp"

namespace invar::support {

class Wired {
 public:
  explicit Wired(double period = 1e-3) : period_{period} {}

  /// Steps after those added before. `every`: only each so many periods, as a slower process would.
  void add(Component& component, int every = 1) {
    component.simulated_time = true;
    component.id = static_cast<std::uint32_t>(parts_.size() + 1);
    parts_.push_back({&component, every});
  }
  void join(Component& from, const std::string& output, Component& to, const std::string& input) {
    auto* source = dynamic_cast<OutputPort*>(from.find_port(output));
    auto* sink = dynamic_cast<InputPort*>(to.find_port(input));
    if (source == nullptr || sink == nullptr || !source->connect(*sink))
      throw std::logic_error{"cannot join " + output + " to " + input};
  }
  void start() {
    for (const Part& part : parts_) part.component->configure();
    for (const Part& part : parts_) {
      part.component->set_now(now());
      part.component->activate();
    }
  }
  void step() {
    for (const Part& part : parts_) {
      if (cycle_ % part.every != 0) continue;
      part.component->set_now(now(), static_cast<std::uint64_t>(cycle_));
      part.component->step({now(), period_ * part.every, static_cast<std::uint64_t>(cycle_)});
    }
    ++cycle_;
  }
  [[nodiscard]] Instant now() const {
    return Instant{} + Duration::seconds(period_ * static_cast<double>(cycle_));
  }
  [[nodiscard]] double time() const { return period_ * static_cast<double>(cycle_); }

 private:
  struct Part {
    Component* component;
    int every;
  };
  double period_;
  std::vector<Part> parts_;
  std::int64_t cycle_ = 0;
};

}  // namespace invar::support

// wait: a job lets time pass.
#pragma once

#include "core/component/component.hpp"
#include "core/job/task.hpp"

namespace invar::job {

/// `seconds` on the clock of `owner`, whose job this is.
inline Task wait(const Component& owner, double seconds) {
  const Instant until = owner.now() + Duration::seconds(seconds);
  while (owner.now() < until) co_await NextStep{};
}

}  // namespace invar::job

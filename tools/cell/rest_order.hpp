// RestOrder: a process comes to rest when it is ordered to, or when `invar run` is no more.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <vector>

#include "core/component/standby.hpp"
#include "core/executor/executor.hpp"

namespace invar::tools {

/// Not real-time; one thread calls it.
class RestOrder {
 public:
  /// `parent`: the `invar run` that started this process, where there is one (then there is an outcome file).
  RestOrder(const std::filesystem::path& outcome, Executor& executor, pid_t parent)
      : outcome_{outcome}, executor_{executor}, parent_{parent} {}

  /// The first call orders those that have a standby to hand over to it. True as soon as none is needed any more, or after 15 s.
  [[nodiscard]] bool has_handed_over(const std::vector<Standby*>& standbys);
  /// The components brake, and are stepped further: what other processes move on or read must be there until they rest, too.
  /// The file `rest_file` tells the launcher when they are at rest. Once each round after the order.
  void come_to_rest();
  [[nodiscard]] bool is_resting() const { return resting_; }

  enum class Parent { there, newly_gone, gone, gone_long };
  /// Nobody could stop a process any more whose `invar run` is no more. `gone_long`: everybody has had the time to come to rest,
  /// and `lingers` more.
  [[nodiscard]] Parent look(Duration lingers);

 private:
  const std::filesystem::path& outcome_;
  Executor& executor_;
  const pid_t parent_;
  std::optional<Instant> orphan_since_, handing_since_;
  bool resting_ = false, told_ = false;
};

}  // namespace invar::tools

// AxisLink: whether a job still hears the stage of an axis that it moves.
#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include "core/base/shown.hpp"
#include "core/base/time.hpp"
#include "idl/stage.h"

namespace invar::calibration {

/// Looks at the age of the newest state in every step of a motion. A stage that does not hear its commander stops by itself
/// (`commander_timeout`), and the job hears that when the link is back, or ends when it stays away.
class AxisLink {
 public:
  void reset() { longest_ = {}; }
  void look(Duration age) { longest_ = std::max(longest_, age); }
  /// Why the job cannot go on; nothing: the stage is heard.
  [[nodiscard]] std::optional<std::string> fault(const std::string& stage,
                                                 const std::string& commander) const {
    // Half of the time after which the supervisor takes a process for lost: the job ends before it is deactivated.
    constexpr Duration patience = Duration::milliseconds(1000);
    if (longest_ < patience) return std::nullopt;
    return "nothing comes from " + stage + between(stage, commander, "is");
  }
  /// Why an axis does not become enabled; `state`: its newest answer, nullptr where nothing was heard.
  [[nodiscard]] static std::string not_enabled(const std::string& stage, const stage::AxisState* state) {
    if (state == nullptr) return "nothing is heard from " + stage + ": is its stage active?";
    if (state->mode() == stage::AXIS_MODE_FAULT)
      return stage +
             " tripped before the job: mend the cause that its notices state, then deactivate and "
             "activate the stage by `invar lifecycle`";
    return stage + " does not take `enable`; its notices say why";
  }
  /// The reason of a job whose motion was taken and did not end as ordered.
  [[nodiscard]] std::string stopped(const std::string& stage, const std::string& commander) const {
    constexpr Duration noticed = Duration::milliseconds(50);
    const std::string what = stage + " stopped a motion of the job before its end";
    if (longest_ < noticed) return what + "; its notices say why";
    return what + ": nothing came from it for " + shown(longest_.in_seconds(), 2) + " s" +
           between(stage, commander, "was");
  }

 private:
  static std::string between(const std::string& stage, const std::string& commander, const char* verb) {
    return ": the link between its host and that of its commander `" + commander + "` " + verb +
           " lost, and " + stage + " does what its `lost_commander` says";
  }
  Duration longest_;
};

}  // namespace invar::calibration

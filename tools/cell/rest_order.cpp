#include "tools/cell/rest_order.hpp"

#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "core/base/clock.hpp"
#include "tools/cell/last_words.hpp"

namespace invar::tools {

void RestOrder::come_to_rest() {
  if (!resting_) executor_.wind_down_all();
  resting_ = true;
  if (told_ || !executor_.is_at_rest() || outcome_.empty()) return;
  std::ofstream{rest_file(outcome_)} << '\n';
  told_ = true;
}

bool RestOrder::has_handed_over(const std::vector<Standby*>& standbys) {
  const Instant now = monotonic_now();
  if (!handing_since_) {
    handing_since_ = now;
    for (Standby* standby : standbys) standby->hand_over();
  }
  // One whose certificate is new, too, may have to be back first.
  constexpr Duration patience = Duration::seconds(15.0);
  return resting_ || now - *handing_since_ > patience ||
         std::none_of(standbys.begin(), standbys.end(), [](const Standby* s) { return s->is_needed(); });
}

RestOrder::Parent RestOrder::look(Duration lingers) {
  if (outcome_.empty() || getppid() == parent_) return Parent::there;
  const Instant now = monotonic_now();
  if (!orphan_since_) {
    orphan_since_ = now;
    return Parent::newly_gone;
  }
  return now - *orphan_since_ > executor_.options().wind_down + lingers ? Parent::gone_long : Parent::gone;
}

}  // namespace invar::tools

#include "core/metrology/geometric/error_motion_tables.hpp"

#include <algorithm>
#include <utility>

#include "core/base/index.hpp"

namespace invar::metrology {

ErrorMotionTables::ErrorMotionTables(ErrorMotionNetworks model, double tolerance, std::size_t most_nodes)
    : model_{std::move(model)}, directions_{axis_directions(model_.chain, model_.squareness)} {
  for (int c = 0; c < error_motion_count; ++c) {
    const auto& component = model_.components[index(c)];
    if (!component || !model_.chain.has(axis_of(c))) continue;
    const double arm =
        is_rotation(c) ? longest_arm(model_.chain, model_.travel, directions_, model_.tool, axis_of(c)) : 1.0;
    const double allowed = tolerance / std::max(arm, 1e-9);
    Entry entry{c, component->states, {}};
    const auto take = [&](auto compiled) {
      bound_ += arm * compiled.bound;
      entry.table = std::move(compiled.table);
    };
    switch (component->states.size()) {
      case 0:
        take(numerics::compile<1>(component->network, allowed, most_nodes));
        break;
      case 1:
        take(numerics::compile<2>(component->network, allowed, most_nodes));
        break;
      default:
        take(numerics::compile<3>(component->network, allowed, most_nodes));
    }
    entries_.push_back(std::move(entry));
  }
  forget();
}

void ErrorMotionTables::forget() noexcept {
  state_.resize(model_.states.size());  // allocates in the constructor alone
  for (std::size_t i = 0; i < state_.size(); ++i) state_[i] = model_.states[i].usual();
}

double ErrorMotionTables::value(const Entry& entry, double position) const noexcept {
  const auto* one = std::get_if<0>(&entry.table);
  if (one != nullptr) return (*one)({position});
  const auto* two = std::get_if<1>(&entry.table);
  if (two != nullptr) return (*two)({position, state_[entry.states[0]]});
  return (*std::get_if<2>(&entry.table))({position, state_[entry.states[0]], state_[entry.states[1]]});
}

Eigen::Vector3d ErrorMotionTables::error(const Eigen::Vector3d& position) const noexcept {
  Eigen::Vector3d held = position;
  for (int k = 0; k < 3; ++k)
    held[k] = model_.chain.has(k) ? model_.travel[index(k)].clamp(position[k]) : 0.0;
  ErrorMotions motions;
  for (const Entry& entry : entries_) {
    ErrorMotion& motion = motions[index(axis_of(entry.component))];
    (is_rotation(entry.component) ? motion.rotation : motion.translation)[direction_of(entry.component)] =
        value(entry, held[axis_of(entry.component)]);
  }
  return linear_error(model_.chain, directions_, held, motions, model_.tool);
}

}  // namespace invar::metrology

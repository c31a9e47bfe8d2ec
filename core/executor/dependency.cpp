#include "core/executor/dependency.hpp"

#include <algorithm>

namespace invar {

namespace {

bool feeds(const Component& upstream, const Component& downstream, bool by_commands) {
  for (const Port* to : downstream.ports()) {
    if (to->direction() == Port::Direction::output) continue;
    if (to->direction() == Port::Direction::inbox && !by_commands) continue;
    const auto& sources = static_cast<const InputPort*>(to)->sources();
    for (const Port* from : upstream.ports()) {
      if (from->direction() != Port::Direction::output) continue;
      if (!to->topic.empty() && to->topic == from->topic) return true;
      if (std::find(sources.begin(), sources.end(), from) != sources.end()) return true;
    }
  }
  return false;
}

using Relation = std::vector<std::vector<bool>>;

Relation direct_feeds(const std::vector<const Component*>& components, bool by_commands) {
  const std::size_t n = components.size();
  Relation direct(n, std::vector<bool>(n, false));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < n; ++k)
      direct[i][k] = i != k && feeds(*components[i], *components[k], by_commands);
  return direct;
}

/// Over any number of steps (Warshall).
Relation closure(Relation reaches) {
  const std::size_t n = reaches.size();
  for (std::size_t via = 0; via < n; ++via)
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < n; ++k)
        if (reaches[i][via] && reaches[via][k]) reaches[i][k] = true;
  return reaches;
}

}  // namespace

Relation signals_reach(const std::vector<const Component*>& components) {
  return closure(direct_feeds(components, false));
}

std::vector<std::size_t> upstream_first(const std::vector<const Component*>& components) {
  const std::size_t n = components.size();
  const Relation direct = direct_feeds(components, true);
  const Relation reaches = closure(direct);

  std::vector<std::size_t> order;
  std::vector<bool> placed(n, false);
  const auto none_waits = [&](std::size_t i, const auto& is_before) {
    for (std::size_t k = 0; k < n; ++k)
      if (!placed[k] && is_before(k, i)) return false;
    return true;
  };
  const auto first = [&](const auto& is_before) {
    std::size_t i = 0;
    while (i < n && (placed[i] || !none_waits(i, is_before))) ++i;
    return i;
  };
  while (order.size() < n) {
    std::size_t next = first([&](std::size_t k, std::size_t i) { return direct[k][i]; });
    if (next == n)  // a circle: opened at its first member, once nothing outside it stands before it
      next = first([&](std::size_t k, std::size_t i) { return reaches[k][i] && !reaches[i][k]; });
    placed[next] = true;
    order.push_back(next);
  }
  return order;
}

}  // namespace invar

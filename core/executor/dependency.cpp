#include "core/executor/dependency.hpp"

#include <algorithm>

namespace invar {

namespace {

bool feeds(const Component& upstream, const Component& downstream) {
  for (const Port* to : downstream.ports()) {
    if (to->direction() == Port::Direction::output) continue;
    const auto& sources = static_cast<const InputPort*>(to)->sources();
    for (const Port* from : upstream.ports()) {
      if (from->direction() != Port::Direction::output) continue;
      if (!to->topic.empty() && to->topic == from->topic) return true;
      if (std::find(sources.begin(), sources.end(), from) != sources.end()) return true;
    }
  }
  return false;
}

}  // namespace

std::vector<std::size_t> upstream_first(const std::vector<const Component*>& components) {
  const std::size_t n = components.size();
  std::vector<std::vector<bool>> direct(n, std::vector<bool>(n, false));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < n; ++k) direct[i][k] = i != k && feeds(*components[i], *components[k]);
  auto reaches = direct;  // over any number of steps (Warshall)
  for (std::size_t via = 0; via < n; ++via)
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < n; ++k)
        if (reaches[i][via] && reaches[via][k]) reaches[i][k] = true;

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

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
  std::vector<std::vector<std::size_t>> downstream(n);
  std::vector<std::size_t> waiting_for(n, 0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < n; ++k)
      if (i != k && feeds(*components[i], *components[k])) {
        downstream[i].push_back(k);
        ++waiting_for[k];
      }
  std::vector<std::size_t> order;
  std::vector<bool> placed(n, false);
  while (order.size() < n) {
    std::size_t next = n;
    for (std::size_t i = 0; i < n && next == n; ++i)
      if (!placed[i] && waiting_for[i] == 0) next = i;
    for (std::size_t i = 0; i < n && next == n; ++i)  // a circle: the given order opens it
      if (!placed[i]) next = i;
    placed[next] = true;
    order.push_back(next);
    for (const std::size_t k : downstream[next])
      if (waiting_for[k] > 0) --waiting_for[k];
  }
  return order;
}

}  // namespace invar

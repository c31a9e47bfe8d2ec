#include "core/physics/equations_columns.hpp"

#include <algorithm>
#include <cmath>

#include "core/physics/static_plants.hpp"

namespace invar::physics {

namespace {

/// Of each value a share arrives by way of a first-order store, in balance at the start. What is held from row to row
/// counts with the mean over its row's step, as a machine feels it; what is smooth goes straight from row to row.
void follow(const std::vector<double>& time, std::vector<double>& values, double time_constant, double share,
            bool held) {
  double z = values.front(), last = values.front();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double now = values[i];
    const std::size_t end = held ? std::min(i + 1, values.size() - 1) : i;
    const double h = end > 0 ? time[end] - time[end - 1] : 0.0, kept = std::exp(-h / time_constant);
    double felt = z;
    if (held) {
      felt = h > 0.0 ? now + (z - now) * (1.0 - kept) * time_constant / h : z;
      z = now + (z - now) * kept;
    } else if (h > 0.0) {
      const double behind = (now - last) / h * time_constant;
      felt = z = now - behind + (z - last + behind) * kept;
    }
    last = now;
    values[i] = now + share * (felt - now);
  }
}

}  // namespace

void run_over(const Model& model, const std::vector<std::string>& names,
              std::vector<std::vector<double>>& columns) {
  const auto place = [&](const std::string& name) {
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  };
  for (const auto& term : model.terms) {
    if (equations_kind(*term.info)->memory != EquationsMemory::overflow) continue;
    const std::size_t on = place(term.on), to = place(term.with);
    if (on >= names.size()) continue;
    for (std::size_t i = 0; i < columns[on].size(); ++i) {
      const double surplus = std::max(0.0, columns[on][i] - term.values[0]);
      columns[on][i] -= surplus;
      if (to < names.size() && to != on) columns[to][i] += term.values[1] * surplus;
    }
  }
}

void bend(const Model& model, const std::string& on, const std::vector<double>& time,
          std::vector<double>& values, bool held) {
  for (const auto& term : model.terms) {
    if (term.on != on) continue;
    const double p = term.values[0];
    switch (equations_kind(*term.info)->memory) {
      case EquationsMemory::upper_limit:
        for (double& v : values) v = std::min(v, p);
        break;
      case EquationsMemory::lower_limit:
        for (double& v : values) v = std::max(v, p);
        break;
      case EquationsMemory::dead_zone:
        for (double& v : values) v -= std::clamp(v, -p, p);
        break;
      case EquationsMemory::lag:
        if (p > 0.0) follow(time, values, p, 1.0, held);
        break;
      case EquationsMemory::hidden_state:
        follow(time, values, term.values[1], p, held);
        break;
      case EquationsMemory::delay: {
        if (!(p > 0.0)) break;
        const auto before = values;
        std::size_t a = 0;
        for (std::size_t i = 0; i < values.size(); ++i) {
          const double when = time[i] - p;
          while (a + 1 < before.size() && time[a + 1] <= when) ++a;
          const std::size_t b = std::min(a + 1, before.size() - 1);
          const double h = time[b] - time[a];
          const double share = h > 0.0 ? std::clamp((when - time[a]) / h, 0.0, 1.0) : 0.0;
          values[i] = before[a] + share * (before[b] - before[a]);
        }
        break;
      }
      default:
        break;
    }
  }
}

}  // namespace invar::physics

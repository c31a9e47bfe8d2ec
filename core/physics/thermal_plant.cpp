#include "core/physics/thermal_plant.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/contract.hpp"

namespace invar::physics {

namespace {

double variable(const Curve& curve, const ThermalPoint& at, double power) noexcept {
  if (curve.over == "time") return at.time;
  if (curve.over == "ambient") return at.ambient;
  if (curve.over == "speed") return at.speed;
  if (curve.over == "motor_current") return at.motor_current;
  if (curve.over == "power") return power;
  return at.temperature;
}

}  // namespace

ThermalPlant::ThermalPlant(std::vector<ThermalNode> nodes, std::vector<ThermalHeater> heaters,
                           std::vector<ThermalCoupling> couplings, std::vector<ThermalTerm> terms)
    : nodes_{std::move(nodes)},
      heaters_{std::move(heaters)},
      couplings_{std::move(couplings)},
      terms_{std::move(terms)} {
  INVAR_EXPECTS(!nodes_.empty() && nodes_.size() <= most_nodes, nodes_.size());
  std::array<double, most_nodes> conductance{};
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    INVAR_EXPECTS(nodes_[i].capacity > 0.0, i, nodes_[i].capacity);
    conductance[i] = std::abs(nodes_[i].loss);
  }
  for (const auto& heater : heaters_) INVAR_EXPECTS(heater.node < nodes_.size(), heater.node);
  for (const auto& c : couplings_) {
    INVAR_EXPECTS(c.first < nodes_.size() && c.second < nodes_.size(), c.first, c.second);
    conductance[c.first] += std::abs(c.conductance);
    conductance[c.second] += std::abs(c.conductance);
  }
  double fastest = 0.0;
  for (const auto& term : terms_) {
    INVAR_EXPECTS(term.node < nodes_.size() && term.other < nodes_.size(), term.node, term.other);
    if (term.kind->couples) {
      conductance[term.node] += std::abs(term.parameters[0]);
      conductance[term.other] += std::abs(term.parameters[0]);
    } else if (term.kind->memory == ThermalMemory::hidden_node) {
      hidden_.push_back(&term);
      conductance[term.node] += std::abs(term.parameters[0]);
      fastest = std::max(fastest, std::abs(term.parameters[0]) / term.parameters[1]);
    } else if (term.kind->memory == ThermalMemory::sensor_lag) {
      lag_[term.node] = std::max(0.0, term.parameters[0]);
      has_lag_[term.node] = lag_[term.node] > 0.0;
    } else if (term.kind->heat != nullptr) {
      // What the loss may reach at a speed of 1 m/s or 100 K above the air; it only sets the sub-step.
      const ThermalPoint cold{0.0, 20.0, 20.0, 20.0, 1.0, 0.0}, hot{0.0, 120.0, 120.0, 20.0, 1.0, 0.0};
      conductance[term.node] += std::abs(term.kind->heat(hot, term.parameters.data()) -
                                         term.kind->heat(cold, term.parameters.data())) /
                                100.0;
    }
  }
  INVAR_EXPECTS(nodes_.size() + hidden_.size() <= most_nodes, nodes_.size(), hidden_.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    fastest = std::max(fastest, conductance[i] / nodes_[i].capacity);
  if (fastest > 0.0) longest_substep_ = 0.25 / fastest;
  for (std::size_t i = 0; i < nodes_.size(); ++i) set_temperature(i, 20.0);
}

void ThermalPlant::set_temperature(std::size_t node, double temperature) noexcept {
  state_[node] = sensor_[node] = temperature;
  for (std::size_t h = 0; h < hidden_.size(); ++h)
    if (hidden_[h]->node == node) state_[nodes_.size() + h] = temperature;
}

ThermalPlant::State ThermalPlant::slope(const State& state, double time,
                                        const ThermalInputs& inputs) const noexcept {
  State heat{};
  State received{};  // from heaters alone, for terms that go over the power
  State stored{};    // [J/K] beside the nodes' own
  double ambient = inputs.ambient;
  for (const auto& term : terms_)
    if (term.kind->ambient != nullptr) ambient += term.kind->ambient(time, term.parameters.data());
  for (std::size_t i = 0; i < nodes_.size(); ++i) heat[i] = -nodes_[i].loss * (state[i] - ambient);
  for (std::size_t h = 0; h < heaters_.size() && h < inputs.powers.size(); ++h) {
    double power = inputs.powers[h];
    for (const auto& term : terms_)
      if (term.kind->heater != nullptr && term.node == heaters_[h].node)
        power = term.kind->heater(power, term.parameters.data());
    received[heaters_[h].node] += heaters_[h].gain * power;
  }
  for (std::size_t i = 0; i < nodes_.size(); ++i) heat[i] += received[i];
  for (const auto& c : couplings_) {
    const double flow = c.conductance * (state[c.second] - state[c.first]);
    heat[c.first] += flow;
    heat[c.second] -= flow;
  }
  for (const auto& term : terms_) {
    if (term.kind->heat == nullptr && term.curve.knots.empty()) continue;
    const ThermalPoint at{time,    state[term.node], state[term.other],
                          ambient, inputs.speed,     inputs.motor_current};
    if (term.kind->heat != nullptr) {
      const double flow = term.kind->heat(at, term.parameters.data());
      heat[term.node] += flow;
      if (term.kind->couples) heat[term.other] -= flow;
    }
    if (!term.curve.knots.empty()) {
      double value = term.curve(variable(term.curve, at, received[term.node]));
      if (term.by_power) value *= received[term.node];
      if (term.kind->info->site == "storage") {
        stored[term.node] += value;
      } else if (term.kind->info->site == "exchange") {
        heat[term.node] += value * (at.other_temperature - at.temperature);
        heat[term.other] -= value * (at.other_temperature - at.temperature);
      } else
        heat[term.node] += term.kind->info->site == "loss" ? -value * (at.temperature - ambient) : value;
    }
  }
  State change{};
  for (std::size_t h = 0; h < hidden_.size(); ++h) {
    const auto& p = hidden_[h]->parameters;
    const double flow = p[0] * (state[hidden_[h]->node] - state[nodes_.size() + h]);
    heat[hidden_[h]->node] -= flow;
    change[nodes_.size() + h] = flow / p[1];
  }
  constexpr double least = 0.1;  // of its capacity a node keeps, whatever is taken off
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    change[i] = heat[i] / std::max(nodes_[i].capacity + stored[i], least * nodes_[i].capacity);
  return change;
}

void ThermalPlant::step(const ThermalInputs& inputs, double dt) noexcept {
  if (!(dt > 0.0)) return;
  const auto parts = static_cast<int>(std::min(200.0, std::max(1.0, std::ceil(dt / longest_substep_))));
  const double h = dt / parts;
  const std::size_t n = nodes_.size() + hidden_.size();
  for (int part = 0; part < parts; ++part) {
    const State before = state_;
    const auto moved = [&](const State& by, double share) {
      State s = before;
      for (std::size_t i = 0; i < n; ++i) s[i] += share * by[i];
      return s;
    };
    const State a = slope(before, time_, inputs);
    const State b = slope(moved(a, 0.5 * h), time_ + 0.5 * h, inputs);
    const State c = slope(moved(b, 0.5 * h), time_ + 0.5 * h, inputs);
    const State d = slope(moved(c, h), time_ + h, inputs);
    for (std::size_t i = 0; i < n; ++i) state_[i] += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
    time_ += h;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (!has_lag_[i]) continue;
      // Exact where the node's temperature goes straight from `before` to now.
      const double slope_of_node = (state_[i] - before[i]) / h;
      const double behind = lag_[i] * slope_of_node;
      sensor_[i] = state_[i] - behind + (sensor_[i] - before[i] + behind) * std::exp(-h / lag_[i]);
    }
  }
}

}  // namespace invar::physics

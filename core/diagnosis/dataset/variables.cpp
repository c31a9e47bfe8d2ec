#include "core/diagnosis/dataset/variables.hpp"

#include <algorithm>
#include <cmath>

#include "core/physics/equations_columns.hpp"

namespace invar::diagnosis {

using physics::Plant;

std::vector<double> variable_values(const Case& data, std::size_t recording, const std::string& name,
                                    const std::string& node) {
  const auto& r = data.recordings[recording];
  if (name == "time") return r.inputs.time;
  if (const auto* values = r.inputs.find(name);
      values != nullptr && std::find(data.outputs.begin(), data.outputs.end(), name) == data.outputs.end())
    return physics::bridged(r.inputs.time, *values);
  const auto measured = [&](const std::string& signal) {
    for (std::size_t o = 0; o < data.outputs.size(); ++o)
      if (data.outputs[o] == signal) return physics::bridged(r.inputs.time, r.measured[o]);
    return std::vector<double>{};
  };
  if (data.model.plant == Plant::thermal && name == "temperature")
    return measured(node.empty() ? data.outputs.front() : node);
  if (name == "velocity" || name == "acceleration") {
    auto values =
        data.model.plant == Plant::sensor ? physics::bridged(r.inputs.time, *r.inputs.find("true_position"))
        : r.inputs.find("reference") != nullptr ? physics::bridged(r.inputs.time, *r.inputs.find("reference"))
                                                : measured("position");
    for (int order = 0; order < (name == "velocity" ? 1 : 2); ++order) {
      std::vector<double> rate(values.size(), 0.0);
      for (std::size_t i = 1; i + 1 < values.size(); ++i)
        rate[i] = (values[i + 1] - values[i - 1]) / (r.inputs.time[i + 1] - r.inputs.time[i - 1]);
      values = std::move(rate);
    }
    return values;
  }
  return measured(name);
}

Spans::Spans(const Case& data, const physics::Model& fitted) {
  auto model = fitted;
  model.equations.outputs.clear();
  for (const auto& state : model.equations.states)
    model.equations.outputs.push_back({state.name, state.name, {}});
  std::erase_if(model.signals, [](const auto& signal) { return signal.is_output; });
  for (const auto& state : model.equations.states)
    model.signals.push_back({state.name, state.name, "", true});
  const auto& decided = model.equations.controlled_input;  // recorded or not
  if (!decided.empty()) {
    model.equations.outputs.push_back({decided, decided, {}});
    model.signals.push_back({decided, decided, "", true});
  }
  for (const auto& recording : data.recordings) {
    const auto& time = recording.inputs.time;
    duration = std::max(duration, time.back() - time.front());
    rows = std::max(rows, time.size());
    physics::Outputs states;
    physics::prepare(model, recording.inputs)->run(model, states);
    for (std::size_t i = 0; i < states.size(); ++i) widen(model.equations.outputs[i].name, time, states[i]);
    for (const auto& input : model.equations.inputs)
      if (const auto* values = recording.inputs.find(input.signal);
          values != nullptr && input.symbol != decided)
        widen(input.symbol, time, *values);
    widen("t", time, time);
    for (std::size_t o = 0; o < data.outputs.size(); ++o)
      widen(physics::place_of_output(data.model.equations, data.outputs[o]), time, recording.measured[o]);
  }
}

void Spans::widen(const std::string& name, const std::vector<double>& time,
                  const std::vector<double>& values) {
  const auto [at, is_new] = spans_.try_emplace(name);
  auto& span = at->second;
  bool first = is_new;
  std::vector<double> sorted;
  for (const double v : values)
    if (std::isfinite(v)) sorted.push_back(v);
  std::sort(sorted.begin(), sorted.end());
  if (!sorted.empty())
    span.inner = std::max(span.inner, sorted[sorted.size() * 9 / 10] - sorted[sorted.size() / 10]);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    span.low = first ? values[i] : std::min(span.low, values[i]);
    span.high = first ? values[i] : std::max(span.high, values[i]);
    first = false;
    span.rests += i > 0 && values[i] == 0.0 ? 1U : 0U;
    if (!(i > 0 && std::isfinite(values[i - 1]) && time[i] > time[i - 1])) continue;
    const double rate = (values[i] - values[i - 1]) / (time[i] - time[i - 1]);
    span.falls = std::min(span.falls, rate), span.rises = std::max(span.rises, rate);
    span.rate = std::max(span.rate, std::abs(rate));
  }
}

std::pair<double, double> span_of(const Case& data, const physics::Model& model, const std::string& name) {
  const auto span = Spans{data, model}.of(name);
  return {span.low, span.high};
}

double inner_span_of(const Case& data, const physics::Model& model, const std::string& name) {
  return Spans{data, model}.of(name).inner;
}

bool turns(const Case& data, const physics::Model& model, const std::string& name) {
  return Spans{data, model}.of(name).turns();
}

bool rests(const Case& data, const physics::Model& model, const std::string& name) {
  constexpr std::size_t plainly = 5;  // rows
  return Spans{data, model}.of(name).rests >= plainly;
}

}  // namespace invar::diagnosis

#include "core/diagnosis/candidates/start.hpp"

#include <cmath>

namespace invar::diagnosis {

using physics::Role;
using physics::Term;

void add_starts(std::vector<Start>& starts, Term term, const std::vector<double>& first_shapes) {
  const auto& info = *term.info;
  Start start;
  bool periodic = false, any_amplitude = false;
  std::size_t shape = physics::no_parameter;
  for (std::size_t i = 0; i < info.parameter_count(); ++i) {
    const auto& p = info.parameters[i];
    if (p.role == Role::phase) periodic = true;
    if (p.role == Role::amplitude) any_amplitude = true;
    if (p.role == Role::shape && shape == physics::no_parameter) shape = i;
    if (p.role != Role::reference || !term.given[i])
      term.values[i] = term.given[i] ? term.values[i] : p.starts[0];
    term.given[i] = true;
  }
  for (std::size_t i = 0; i < info.parameter_count(); ++i) {
    if (info.parameters[i].role != Role::amplitude) continue;
    start.directions.push_back({i, 0, false});
    if (periodic) start.directions.push_back({i, 0, true});
  }
  if (!any_amplitude) start.directions.push_back({physics::no_parameter, 0, false});
  std::vector<double> values = first_shapes;
  if (values.empty() && shape != physics::no_parameter)
    for (double v : info.parameters[shape].starts)
      if (std::isfinite(v)) values.push_back(v);
  if (shape == physics::no_parameter) values = {0.0};
  for (double v : values) {
    start.term = term;
    if (shape != physics::no_parameter) start.term.values[shape] = info.parameters[shape].bounds.clamp(v);
    starts.push_back(start);
  }
}

void lay_memory(Start& start, std::size_t count, double span, double duration) {
  // From a thousandth of the way to all of it; from a five-hundredth of the time to half of it.
  const bool is_stop = start.term.curve.memory == physics::Curve::Memory::stop;
  const double low = is_stop ? 1e-3 * span : 2e-3 * duration, high = is_stop ? 0.7 * span : 0.5 * duration;
  for (std::size_t k = 0; k < count; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(count - 1);
    start.term.curve.knots.push_back(low * std::pow(high / low, share));
    start.term.curve.values.push_back(0.0);
    start.directions.push_back({physics::no_parameter, k, false});
  }
}

}  // namespace invar::diagnosis

#include "core/physics/axis_feedforward.hpp"

#include <algorithm>

#include "core/physics/library.hpp"

namespace invar::physics {

namespace {

bool goes_over_time(const Term& term) {
  const auto& on = term.info->depends_on;
  return term.curve.over == "time" || std::find(on.begin(), on.end(), "time") != on.end();
}

/// The terms whose force or reading is known from the motion alone.
Model known_from_motion(Model model) {
  std::erase_if(model.terms, [](const Term& term) {
    const auto memory = axis_kind(*term.info)->memory;
    return goes_over_time(term) || (memory != AxisMemory::none && memory != AxisMemory::presliding);
  });
  return model;
}

}  // namespace

AxisFeedforward::AxisFeedforward(const Model& model)
    : plant_{make_axis(known_from_motion(model))},
      mass_{model.value("mass", 1.0)},
      motor_constant_{model.value("motor_constant", 1.0)} {
  for (const auto& term : model.terms) {
    const auto memory = axis_kind(*term.info)->memory;
    if (memory == AxisMemory::transport_delay || memory == AxisMemory::amplifier_lag)
      lead_ += std::max(0.0, term.values[0]);
    if (term.info->name == "dead_zone") dead_ += std::max(0.0, term.values[0]);
  }
}

double AxisFeedforward::current(const AxisMotion& motion, double temperature) noexcept {
  plant_.follow(motion.position);
  const double direction = motion.velocity > 0.0 ? 1.0 : (motion.velocity < 0.0 ? -1.0 : 0.0);
  AxisPoint at{0.0, motion.position, motion.velocity, 0.0, temperature};
  // The force is straight in the current but for the iron's saturation: a few steps settle it.
  for (int i = 0; i < 12; ++i)
    at.current += (mass_ * motion.acceleration - plant_.force(at, direction)) / motor_constant_;
  if (at.current > 0.0) return at.current + dead_;
  return at.current < 0.0 ? at.current - dead_ : 0.0;
}

double AxisFeedforward::reading_error(double reading) const noexcept {
  // The error goes over the true position, which is the reading less the error.
  return plant_.reading_error(reading - plant_.reading_error(reading));
}

}  // namespace invar::physics

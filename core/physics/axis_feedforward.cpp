#include "core/physics/axis_feedforward.hpp"

#include <algorithm>

#include "core/physics/library.hpp"

namespace invar::physics {

namespace {

bool goes_over_time(const Term& term) {
  const auto& on = term.info->depends_on;
  return term.curve.over == "time" || std::find(on.begin(), on.end(), "time") != on.end();
}

/// What acts on plant_: the terms whose force or reading is known from the motion alone.
Model known_from_motion(Model model) {
  std::erase_if(model.terms, [](const Term& term) {
    const auto memory = axis_kind(*term.info)->memory;
    return !why_not_fed_forward(term).empty() || memory == AxisMemory::transport_delay ||
           memory == AxisMemory::amplifier_lag;
  });
  return model;
}

}  // namespace

std::string_view why_not_fed_forward(const Term& term) {
  if (goes_over_time(term)) return "it goes over time, and a recording's clock is not the loop's";
  switch (axis_kind(*term.info)->memory) {
    case AxisMemory::backlash:
      return "a current cannot take up play";
    case AxisMemory::measurement_delay:
      return "a current cannot make a reading younger";
    case AxisMemory::flexible_mode:
      return "a swinging part has a motion of its own";
    case AxisMemory::none:
    case AxisMemory::presliding:
    case AxisMemory::transport_delay:
    case AxisMemory::amplifier_lag:
      break;
  }
  return {};
}

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

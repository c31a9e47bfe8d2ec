#include "components/fusion/fusion.hpp"

#include <algorithm>

#include "core/compensation/fusion_file.hpp"

namespace invar::fusion {

void Fusion::configure() {
  if (parameters_.model.empty()) {
    metrology::FusionModel model;
    model.position_names = {"encoder"};
    model.velocity_names = {"velocity"};
    model.positions.resize(1);
    model.positions[0].step = parameters_.resolution;
    model.positions[0].noise = 0.02 * parameters_.resolution;  // of an edge
    model.velocities.resize(1);
    model.velocities[0].gains[0] = parameters_.velocity_gain;
    model.velocities[0].fastest = model.velocities[0].largest = parameters_.largest_velocity;
    estimator_ = std::make_unique<metrology::FusionObserver>(model);
    return;
  }
  const auto yaml = config::Yaml::load(parameters_.model);
  compensation::check_seal(yaml);
  (void)yaml.root().integer("invar_compensation", 1, 1);
  (void)yaml.root().choice("kind", {"fusion"});
  const auto model = compensation::read_fusion(yaml.root());
  yaml.finish();
  if (model.sensors.positions.size() != 1 || model.sensors.velocities.size() != 1)
    throw InputError{parameters_.model.string(), "is not of one position and one velocity sensor",
                     "calibrate with the columns of this axis"};
  estimator_ = compensation::make_estimator(model);
}

void Fusion::activate() {
  estimator_->reset();
  first_ = true;
}

void Fusion::step(const Tick& tick) noexcept {
  const auto* feedback = feedback_.latest();
  if (feedback == nullptr) return;
  metrology::FusionSample sample;
  sample.positions.fill(std::numeric_limits<double>::quiet_NaN());
  sample.velocities.fill(std::numeric_limits<double>::quiet_NaN());
  sample.period = first_ ? 0.0 : tick.period;
  sample.positions[0] = feedback->position();
  sample.velocities[0] = feedback->velocity();
  first_ = false;
  const metrology::FusedPosition found = estimator_->step(sample);

  sensing::FusedPosition fused;
  fused.cell(cell);
  fused.axis(feedback->axis());
  fused.at().time_ns(tick.now.ns);
  fused.at().cycle(tick.cycle);
  fused.position(found.position);
  fused.velocity(found.velocity);
  fused.sigma(found.sigma);
  fused.sensor_count(2);
  fused.weights()[0] = found.weights[0];
  fused.weights()[1] = found.weights[1];
  fused.residuals()[0] = feedback->position() - found.position;
  fused.valid(found.live != 0);
  fused_.write(fused);
}

}  // namespace invar::fusion

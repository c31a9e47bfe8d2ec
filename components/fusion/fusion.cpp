#include "components/fusion/fusion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/compensation/fusion_file.hpp"
#include "core/metrology/fusion/fusion_observer.hpp"

namespace invar::fusion {

namespace {

std::vector<Fusion::Sensor> sensors_of(const Fusion::Parameters& parameters) {
  std::vector<Fusion::Sensor> sensors = parameters.sensors;
  if (sensors.empty()) {
    Fusion::Sensor encoder;
    encoder.name = "encoder";
    encoder.from = "feedback";
    encoder.resolution = parameters.resolution;
    Fusion::Sensor velocity = encoder;
    velocity.name = "velocity";
    velocity.quantity = "velocity";
    velocity.gain = parameters.velocity_gain;
    velocity.largest = parameters.largest_velocity;
    sensors = {encoder, velocity};
  }
  std::stable_partition(sensors.begin(), sensors.end(),
                        [](const auto& sensor) { return sensor.quantity == "position"; });
  return sensors;
}

std::size_t positions_in(const std::vector<Fusion::Sensor>& sensors) {
  return static_cast<std::size_t>(std::count_if(
      sensors.begin(), sensors.end(), [](const auto& sensor) { return sensor.quantity == "position"; }));
}

metrology::FusionModel model_of(const std::vector<Fusion::Sensor>& sensors) {
  metrology::FusionModel model;
  for (const auto& sensor : sensors) {
    if (sensor.quantity == "position") {
      metrology::PositionSensorModel position;
      position.step = sensor.resolution;
      position.noise = sensor.noise > 0.0 ? sensor.noise : std::max(0.02 * sensor.resolution, 1e-9);
      position.delay = sensor.delay;
      position.delay_sigma = sensor.delay_sigma;
      model.position_names.push_back(sensor.name);
      model.positions.push_back(position);
    } else {
      metrology::VelocitySensorModel velocity;
      velocity.gains[0] = sensor.gain;
      velocity.gain_sigma = sensor.gain_sigma;
      velocity.gain_drift =
          std::max(velocity.gain_drift, 0.3 * sensor.gain_sigma);  // it may change with speed
      velocity.fastest = velocity.largest = sensor.largest;
      velocity.lag = sensor.delay;
      velocity.lag_sigma = sensor.delay_sigma;
      model.velocity_names.push_back(sensor.name);
      model.velocities.push_back(velocity);
    }
  }
  const auto& first = model.positions.front();
  model.start_sigma = std::hypot(first.step / std::sqrt(12.0), first.noise);
  return model;
}

}  // namespace

/// Where a sensor's readings come from, and which was the last.
struct Fusion::Source {
  Source(Fusion& owner, const Sensor& sensor, std::size_t index)
      : is_position{sensor.quantity == "position"},
        place{is_position ? index : index - owner.positions_},
        bit{index},
        patience{Duration::seconds(sensor.patience)} {
    if (sensor.from == "port")
      reading = std::make_unique<Input<sensing::AxisReading>>(owner, "sensor_" + sensor.name);
  }
  bool is_position;
  std::size_t place;  // among the sensors of its kind
  std::size_t bit;    // among all
  Duration patience;
  std::unique_ptr<Input<sensing::AxisReading>> reading;  // nullptr: from `feedback`
  std::uint64_t received = 0;
  Instant last;  // when a sound reading came
};

Fusion::Fusion(const Parameters& parameters)
    : parameters_{parameters},
      sensors_{sensors_of(parameters)},
      positions_{positions_in(sensors_)},
      rest_{{parameters.rest.least_weight, parameters.rest.after, parameters.rest.look_again},
            positions_,
            sensors_.size()},
      step_free_{parameters.fade},
      model_{*this,
             [this](const std::filesystem::path& file, Staged::Model& model) { return load(file, model); },
             "model", "model_status"} {
  bool from_feedback = false;
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    sources_.push_back(std::make_unique<Source>(*this, sensors_[i], i));
    from_feedback = from_feedback || sources_.back()->reading == nullptr;
  }
  if (from_feedback) {
    feedback_ = std::make_unique<Input<stage::AxisFeedback>>(*this, "feedback");
    feedback_->key = static_cast<std::uint32_t>(parameters.axis);
  }
  fused_.key = static_cast<std::uint32_t>(parameters.axis);
}

Fusion::~Fusion() = default;

void Fusion::configure() {
  const std::string mend = "describe one position sensor at least and eight sensors at most";
  if (positions_ < 1) throw InputError{name, "has no position sensor", mend};
  if (sensors_.size() > metrology::most_sensors) throw InputError{name, "has more than eight sensors", mend};
  described_ = std::make_unique<metrology::FusionObserver>(model_of(sensors_));
  model_.open(parameters_.model, "calibrate the fusion of this axis again");
  use_model();
}

/// A model of other sensors, or none of fusion, throws.
std::string Fusion::load(const std::filesystem::path& file, Staged::Model& staged) const {
  const auto yaml = config::Yaml::load(file);
  staged.checksum = compensation::check_seal(yaml);
  (void)yaml.root().integer("invar_compensation", 1, 1);
  (void)yaml.root().choice("kind", {"fusion"});
  yaml.root()["identified_from"].accept_all();
  const auto model = compensation::read_fusion(yaml.root());
  yaml.finish();
  std::vector<std::string> names = model.sensors.position_names;
  names.insert(names.end(), model.sensors.velocity_names.begin(), model.sensors.velocity_names.end());
  const bool same = positions_ == model.sensors.position_names.size() &&
                    std::equal(names.begin(), names.end(), sensors_.begin(), sensors_.end(),
                               [](const auto& text, const auto& sensor) { return text == sensor.name; });
  if (!same) {
    std::string list;
    for (const auto& text : names) list += (list.empty() ? "" : ", ") + text;
    throw InputError{file.string(), "is of the sensors " + list,
                     "name the component's sensors so, in this order"};
  }
  const auto& learning = parameters_.learning;
  staged.content =
      compensation::make_estimator(model, {learning.memory, learning.most, learning.most_intercept});
  return {};
}

/// The estimator of the model in use begins afresh; the step that this makes fades.
void Fusion::use_model() noexcept {
  estimator_ = model_.active() != nullptr ? model_.active()->content.get() : described_.get();
  estimator_->reset();
  rest_.reset();
  resting_ = 0;
  step_free_.expect_step();
}

void Fusion::activate() {
  use_model();
  step_free_.reset();
  velocity_ = 0.0;
  started_ = false;
  model_.announce();
  for (auto& source : sources_) source->last = now();
}

/// One sensor's reading into the sample; false where none came yet.
bool Fusion::read(Source& source, const Tick& tick, metrology::FusionSample& sample) noexcept {
  double value = std::numeric_limits<double>::quiet_NaN();
  bool fresh = false;
  Instant measured = tick.now;
  if (source.reading != nullptr) {
    fresh = source.reading->received() != source.received;
    source.received = source.reading->received();
    if (const auto* reading = source.reading->latest(); reading != nullptr) {
      value = source.is_position ? reading->position() : reading->velocity();
      measured = Instant{reading->at().time_ns()};
    }
  } else {
    fresh = feedback_->received() != source.received;
    source.received = feedback_->received();
    if (const auto* feedback = feedback_->latest(); feedback != nullptr)
      value = source.is_position ? feedback->position() : feedback->velocity();
  }
  const Duration age = std::max(tick.now - measured, Duration{});
  if (fresh && age <= source.patience) {
    source.last = tick.now;
    sample.ages[source.bit] = age.in_seconds();
  } else {
    value = std::numeric_limits<double>::quiet_NaN();
    if (tick.now - source.last < source.patience) sample.silent |= 1U << source.bit;
  }
  (source.is_position ? sample.positions : sample.velocities)[source.place] = value;
  return fresh;
}

/// Where an instrument along the axis says that it is now; NaN where none reads.
double Fusion::reference(const Tick& tick) noexcept {
  constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  const auto* reading = reference_.latest();
  if (reading == nullptr || std::exchange(referred_, reference_.received()) == reference_.received())
    return nothing;
  const auto axis = static_cast<std::size_t>(parameters_.axis);
  const double along = reading->beam_direction()[axis];
  if (!reading->valid() || std::abs(along) < 0.9999) return nothing;
  const double age = (tick.now - Instant{reading->at().time_ns()}).in_seconds();
  return reading->beam_start()[axis] + reading->displacement() / along + age * velocity_;
}

void Fusion::step(const Tick& tick) noexcept {
  if (model_.update()) use_model();
  metrology::FusionSample sample;
  sample.positions.fill(std::numeric_limits<double>::quiet_NaN());
  sample.velocities.fill(std::numeric_limits<double>::quiet_NaN());
  sample.period = started_ ? tick.period : 0.0;
  sample.selector = parameters_.selector;
  sample.reference = reference(tick);
  bool any = false;
  for (auto& source : sources_) any = (read(*source, tick, sample) && source->is_position) || any;
  if (!started_ && !any) return;  // says nothing before its first position
  started_ = true;
  sample.silent |= resting_;
  const metrology::FusedPosition found = estimator_->step(sample);
  resting_ = rest_.update(found, tick.period);
  velocity_ = found.velocity;
  write(found, sample);
}

void Fusion::write(const metrology::FusedPosition& found, const metrology::FusionSample& sample) noexcept {
  sensing::FusedPosition fused;
  stamp(fused);
  fused.axis(static_cast<std::uint32_t>(parameters_.axis));
  fused.position(step_free_(found, sample.period));
  fused.velocity(found.velocity);
  fused.sigma(found.sigma);
  fused.sensor_count(static_cast<std::uint32_t>(sensors_.size()));
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    fused.weights()[i] = found.weights[i];
    fused.lateness()[i] = found.lateness[i];
    fused.noise()[i] = found.noise[i];
    if (i < positions_ && std::isfinite(sample.positions[i]))
      fused.residuals()[i] = sample.positions[i] - found.position;
  }
  fused.live(found.live);
  fused.resting(resting_);
  fused.valid(found.live != 0);
  fused_.write(fused);
}

}  // namespace invar::fusion

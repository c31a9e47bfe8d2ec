#include "core/compensation/fusion_file.hpp"

#include <algorithm>

#include "core/metrology/fusion/fusion_observer.hpp"

namespace invar::compensation {

using metrology::PositionSensorModel;
using metrology::VelocitySensorModel;

namespace {

void read_noise(const config::Node& node, metrology::NoiseBySpeed& noise) {
  noise.speed = node.required("speed").as_numbers("m/s");
  noise.log_deviation = exactly(node.required("log_deviation"), noise.speed.size(), "1");
  if (noise.speed.empty() || !std::is_sorted(noise.speed.begin(), noise.speed.end()))
    node.fault("its speeds do not ascend");
}

void read_polynomial(const config::Node& node, int sensors, metrology::FusionPolynomial& p) {
  p.degree = static_cast<int>(node.integer("degree", 2, 6));
  p.centre = node.number("centre", "m");
  p.reach = node.number("reach", "m", Range::positive());
  p.difference_reach = node.number("difference_reach", "m", Range::positive());
  const auto values =
      exactly(node.required("coefficients"), metrology::monomials(sensors, p.degree).size(), "m");
  p.coefficients = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

}  // namespace

void write_network(ModelText& text, const std::string& key, const numerics::RbfNetwork& network) {
  std::vector<double> ends;
  for (const Range& range : network.range) ends.insert(ends.end(), {range.lower, range.upper});
  text.open(key)
      .integer("inputs", network.inputs())
      .integer("centres_count", network.size())
      .numbers("range", ends)
      .numbers("input_offset", network.input_offset)
      .numbers("input_scale", network.input_scale)
      .number("output_offset", network.output_offset)
      .number("output_scale", network.output_scale)
      .number("constant", network.constant)
      .numbers("slope", network.slope)
      .numbers("centres", Eigen::VectorXd{network.centres.reshaped()})
      .numbers("widths", Eigen::VectorXd{network.widths.reshaped()})
      .numbers("weights", network.weights)
      .close();
}

numerics::RbfNetwork read_network(const config::Node& node) {
  numerics::RbfNetwork network;
  const auto inputs = static_cast<std::size_t>(node.integer("inputs", 1, 8));
  const auto size = static_cast<std::size_t>(node.integer("centres_count", 0, 100'000));
  const auto vector = [&](const char* key, std::size_t count) -> Eigen::VectorXd {
    const auto values = exactly(node.required(key), count, "1");
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(count));
  };
  const auto ends = exactly(node.required("range"), 2 * inputs, "1");
  for (std::size_t d = 0; d < inputs; ++d)
    network.range.push_back({ends[2 * d], std::max(ends[2 * d], ends[2 * d + 1])});
  network.input_offset = vector("input_offset", inputs);
  network.input_scale = vector("input_scale", inputs);
  network.output_offset = node.number("output_offset", "1");
  network.output_scale = node.number("output_scale", "1");
  network.constant = node.number("constant", "1");
  network.slope = vector("slope", inputs);
  const auto rows = static_cast<Eigen::Index>(inputs);
  const auto columns = static_cast<Eigen::Index>(size);
  network.centres = vector("centres", inputs * size).reshaped(rows, columns);
  network.widths = vector("widths", inputs * size).reshaped(rows, columns);
  network.weights = vector("weights", size);
  if ((network.input_scale.array() <= 0.0).any() || (network.widths.array() <= 0.0).any())
    node.fault("a scale or width is not positive");
  return network;
}

void write_fusion(ModelText& text, const FusionFile& model) {
  text.comment("lengths m, speeds m/s, times s; both methods are stored, `method` is the one used")
      .text("method", model.method)
      .text("noise", model.noise_given ? "given" : "estimated")
      .open("start")
      .number("offset", model.sensors.start_offset)
      .number("sigma", model.sensors.start_sigma)
      .close()
      .open_list("positions");
  for (std::size_t i = 0; i < model.sensors.positions.size(); ++i) {
    const PositionSensorModel& sensor = model.sensors.positions[i];
    text.item()
        .text("name", model.sensors.position_names[i])
        .number("step", sensor.step)
        .number("offset", sensor.offset)
        .number("hysteresis", sensor.hysteresis)
        .number("delay", sensor.delay)
        .number("delay_sigma", sensor.delay_sigma)
        .number("noise", sensor.noise)
        .integer("longest_repeat", sensor.longest_repeat);
  }
  text.close();
  if (!model.sensors.velocities.empty()) {
    text.comment("reading = offset + sum_k gains[k] sign(v) |v|^(k+1), v lagged").open_list("velocities");
    for (std::size_t i = 0; i < model.sensors.velocities.size(); ++i) {
      const VelocitySensorModel& sensor = model.sensors.velocities[i];
      text.item()
          .text("name", model.sensors.velocity_names[i])
          .numbers("gains", sensor.gains.data(), sensor.gains.size())
          .number("offset", sensor.offset)
          .number("lag", sensor.lag)
          .number("gain_sigma", sensor.gain_sigma)
          .number("lag_sigma", sensor.lag_sigma)
          .number("fastest", sensor.fastest)
          .number("largest", sensor.largest)
          .number("correlation", sensor.correlation)
          .integer("longest_repeat", sensor.longest_repeat);
    }
    text.close();
  }
  text.comment("weights over speed and noise level, by the method of the thesis")
      .open("weights")
      .number("intercept", model.weights.intercept)
      .numbers("delays", model.weights.delays);
  if (!model.selector.empty()) text.text("selector", model.selector);
  if (const auto& noise = model.weights.noise; !noise.speed.empty())
    text.comment("noise of the first velocity sensor by speed: logarithm of its deviation in m/s")
        .open("noise_by_speed")
        .numbers("speed", noise.speed)
        .numbers("log_deviation", noise.log_deviation)
        .close();
  if (const auto& p = model.weights.polynomial; p.degree > 1)
    text.comment("added to the weighted mean: monomials of it and of each sensor's difference from the first")
        .open("polynomial")
        .integer("degree", p.degree)
        .number("centre", p.centre)
        .number("reach", p.reach)
        .number("difference_reach", p.difference_reach)
        .numbers("coefficients", p.coefficients)
        .close();
  for (std::size_t i = 0; i < model.weights.weights.size(); ++i)
    write_network(text, "sensor_" + std::to_string(i + 2), model.weights.weights[i]);
  text.close();
}

FusionFile read_fusion(const config::Node& root) {
  FusionFile model;
  model.method = root.choice("method", {"observer", "weights"});
  model.noise_given = root.choice("noise", {"given", "estimated"}) == "given";
  const auto start = root.required("start");
  model.sensors.start_offset = start.number("offset", "m");
  model.sensors.start_sigma = start.number("sigma", "m", Range::positive());
  for (const auto& node : root.required("positions").children()) {
    model.sensors.position_names.push_back(node.text("name"));
    PositionSensorModel sensor;
    sensor.step = node.number("step", "m", Range::not_negative());
    sensor.offset = node.number("offset", "m");
    sensor.hysteresis = node.number("hysteresis", "m");
    sensor.delay = node.number("delay", "s", Range{0.0, 1.0});
    sensor.delay_sigma = node.number("delay_sigma", "s", Range{0.0, 1.0});
    sensor.noise = node.number("noise", "m", Range::positive());
    sensor.longest_repeat = static_cast<int>(node.integer("longest_repeat", 0, 1000));
    model.sensors.positions.push_back(sensor);
  }
  if (root.has("velocities"))
    for (const auto& node : root["velocities"].children()) {
      model.sensors.velocity_names.push_back(node.text("name"));
      VelocitySensorModel sensor;
      const auto gains = exactly(node.required("gains"), sensor.gains.size(), "1");
      std::copy(gains.begin(), gains.end(), sensor.gains.begin());
      sensor.offset = node.number("offset", "m/s");
      sensor.lag = node.number("lag", "s", Range{0.0, 1.0});
      sensor.gain_sigma = node.number("gain_sigma", "1", Range{0.0, 1.0});
      sensor.lag_sigma = node.number("lag_sigma", "s", Range{0.0, 1.0});
      sensor.fastest = node.number("fastest", "m/s", Range::positive());
      sensor.largest = node.number("largest", "m/s", Range::positive());
      sensor.correlation = node.number("correlation", "1", Range::positive());
      sensor.longest_repeat = static_cast<int>(node.integer("longest_repeat", 0, 1000));
      model.sensors.velocities.push_back(sensor);
    }
  const std::size_t positions = model.sensors.positions.size();
  const std::size_t velocities = model.sensors.velocities.size();
  if (positions < 1 || positions + velocities > metrology::most_sensors)
    root["positions"].fault("there must be one position sensor at least and 8 sensors at most");
  const auto weights = root.required("weights");
  model.weights.positions = static_cast<int>(positions);
  model.weights.velocities = static_cast<int>(velocities);
  model.weights.intercept = weights.number("intercept", "m");
  model.weights.delays = exactly(weights.required("delays"), positions + velocities, "s");
  const bool further = weights.has("selector");
  if (further) model.selector = weights.text("selector");
  if (weights.has("noise_by_speed")) read_noise(weights["noise_by_speed"], model.weights.noise);
  if (weights.has("polynomial"))
    read_polynomial(weights["polynomial"], static_cast<int>(positions + velocities),
                    model.weights.polynomial);
  for (std::size_t i = 0; i + 1 < positions + velocities; ++i) {
    const auto node = weights.required("sensor_" + std::to_string(i + 2));
    model.weights.weights.push_back(read_network(node));
    if (model.weights.weights.back().inputs() != (further ? 3 : 2))
      node.fault("has not the inputs speed, noise level and, where one is named, the selector");
  }
  return model;
}

std::unique_ptr<metrology::FusionEstimator> make_estimator(const FusionFile& model,
                                                           const metrology::WeightLearning& learning) {
  if (model.method == "weights") {
    auto weights = model.weights;
    weights.known = model.sensors.positions;
    return std::make_unique<metrology::WeightedFusion>(weights, learning);
  }
  return std::make_unique<metrology::FusionObserver>(model.sensors);
}

}  // namespace invar::compensation

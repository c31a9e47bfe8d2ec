// A position loop closed on the fused position: sinusoids of 100 mm, tracking error by the truth, for the encoder alone, for
// the thesis's weights and for the observer, each with the loop bandwidth that suits it best. Prints a table; no test.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <random>

#include "components/fusion/fusion.hpp"
#include "components/world/simulated_sensor.hpp"
#include "core/compensation/fusion_file.hpp"
#include "core/metrology/fusion/fusion_identification.hpp"
#include "core/physics/terms/sensor/gain_droop.hpp"
#include "core/physics/terms/sensor/latency.hpp"
#include "tests/support/wired_axis.hpp"

namespace {

using namespace invar;

constexpr double amplitude = 0.1, resolution = 2e-3, latency = 3e-3, droop = 0.1, dt = 1e-3;
constexpr double mass = 3.2, motor = 12.0, damping = 18.0;

/// The thesis's training: 200 mm at constant speed, noise in parts of the largest reading.
std::vector<metrology::FusionRun> training() {
  std::mt19937 random{1};
  std::uniform_real_distribution<double> uniform{-1.0, 1.0};
  std::vector<metrology::FusionRun> runs;
  for (const double noise : {0.05, 0.1, 0.5, 1.0, 3.0, 5.0, 10.0})
    for (const double speed : {0.04, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6}) {
      const double ramp = speed / 4.0;
      const auto n = static_cast<Eigen::Index>((0.2 / speed + 0.5 * ramp) / dt);
      metrology::FusionRun run{Eigen::VectorXd(n),
                               Eigen::VectorXd(n),
                               Eigen::MatrixXd(n, 1),
                               Eigen::MatrixXd(n, 1),
                               Eigen::VectorXd::Constant(n, noise),
                               {}};
      physics::SensorPlant tachometer{
          physics::SensorPlant::Quantity::velocity,
          {{&physics::sensor::Latency::kind, {latency}}, {&physics::sensor::GainDroop::kind, {droop}}}};
      for (Eigen::Index i = 0; i < n; ++i) {
        const double t = dt * static_cast<double>(i);
        const double x = t < ramp ? 2.0 * t * t : speed * (t - 0.5 * ramp);
        run.time(i) = t;
        run.reference(i) = x;
        run.positions(i, 0) = resolution * std::round(x / resolution);
        run.velocities(i, 0) =
            tachometer.step(x, std::min(4.0 * t, speed), i == 0 ? 0.0 : dt) + noise * speed * uniform(random);
      }
      runs.push_back(std::move(run));
    }
  return runs;
}

struct Trial {
  double period, noise, bandwidth;
  bool feedforward;
  std::string model;  // of the fusion; empty: the encoder alone
};

/// RMS of true position minus setpoint, over two periods after the first [m].
double tracking_error(const Trial& trial, const std::filesystem::path& machine,
                      const std::filesystem::path& axis) {
  const double peak = 2.0 * std::numbers::pi * amplitude / trial.period;
  world::SimulatedStage::Parameters of_world;
  of_world.machine = machine;
  of_world.x.model = axis;  // friction and ripple that the loop does not know
  of_world.x.resolution = resolution;
  of_world.x.noise = 0.0;
  world::SimulatedSensor::Parameters of_sensor;
  of_sensor.quantity = "velocity";
  of_sensor.latency = latency;
  of_sensor.gain_droop = droop;
  of_sensor.noise_level = trial.noise;
  of_sensor.largest = peak;
  world::SimulatedSensor tachometer{of_sensor};
  fusion::Fusion::Parameters of_fusion;
  of_fusion.model = trial.model;
  of_fusion.sensors.resize(2);
  of_fusion.sensors[0].name = "encoder";
  of_fusion.sensors[0].from = "feedback";
  of_fusion.sensors[1].name = "tachometer";
  of_fusion.sensors[1].quantity = "velocity";
  fusion::Fusion fused{of_fusion};
  stage::Stage::Parameters of_stage;
  of_stage.travel = {-0.01, 0.21};
  of_stage.limits = {1.0, 10.0, 1000.0};
  of_stage.following_error = 1.0;
  const double w = 2.0 * std::numbers::pi * trial.bandwidth;
  of_stage.control.kp = mass * w * w / motor;
  of_stage.control.ki = 0.2 * w * of_stage.control.kp;
  of_stage.control.kd = 1.6 * w * mass / motor;
  of_stage.control.velocity_filter = 10.0 * trial.bandwidth;
  if (trial.feedforward) {
    of_stage.control.feedforward_velocity = damping / motor;
    of_stage.control.feedforward_acceleration = mass / motor;
  }
  support::WiredAxis loop{of_world, of_stage, dt};
  support::Wired& wired = loop.wired;
  struct Watch final : Component {
    Input<sensing::AxisReading> truth{*this, "truth"};
    void step(const Tick&) noexcept override {}
  } watch;
  wired.join(loop.world, "truth_x", watch, "truth");
  wired.add(loop.world);
  if (!trial.model.empty()) {
    wired.join(loop.world, "truth_x", tachometer, "truth");
    wired.join(loop.world, "feedback_x", fused, "feedback");
    wired.join(tachometer, "reading", fused, "sensor_tachometer");
    wired.join(fused, "fused", loop.stage, "fused");
    wired.add(tachometer);
    wired.add(fused);
  }
  wired.add(loop.stage);
  wired.add(loop.hand);
  wired.add(watch);
  wired.start();
  for (int k = 0; k < 10; ++k) wired.step();
  loop.tell(stage::AXIS_COMMAND_ENABLE);
  for (int k = 0; k < 500; ++k) wired.step();
  stage::AxisCommand sine;
  sine.kind(stage::AXIS_COMMAND_SINE);
  sine.id(loop.next++);
  sine.amplitude(amplitude);
  sine.period(trial.period);
  sine.periods(3);
  loop.hand.command.write(sine);
  auto& state = loop.hand.state;
  double squares = 0.0;
  int count = 0;
  const auto cycles = static_cast<int>(3.0 * trial.period / dt);
  for (int k = 0; k < cycles; ++k) {
    wired.step();
    if (!state.latest()->enabled()) return 1e9;  // it tripped: its setpoint goes where it stands
    if (k < cycles / 3) continue;
    squares += std::pow(watch.truth.latest()->position() - state.latest()->setpoint_position(), 2);
    ++count;
  }
  return std::sqrt(squares / count);
}

void write_model(const metrology::FusionFit& fit, const std::string& method,
                 const std::filesystem::path& file) {
  compensation::ModelText text{"fusion", {}};
  compensation::write_fusion(text, {method, false, fit.sensors, fit.weights, ""});
  text.write(file);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Tracking error of a position loop: encoder alone, the thesis's weights, the observer"};
  bool alone = false;
  std::filesystem::path axis = "deployment/machines/axis-rippled.yaml";
  app.add_option("--axis", axis, "model.yaml that is the truth of the axis")->capture_default_str();
  app.add_flag("--pid-alone", alone, "no feedforward, as the thesis has it");
  CLI11_PARSE(app, argc, argv);
  const auto folder =
      std::filesystem::temp_directory_path() / ("invar-fusion-loop-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const auto machine = folder / "machine.yaml";  // limit switches far away
  std::FILE* file = std::fopen(machine.c_str(), "w");
  if (file == nullptr) return 1;
  std::fputs("invar_machine: 1\nchain: [y, x]\ntravel: {x: [-0.2, 0.4], y: [0, 0.2]}\n", file);
  std::fclose(file);
  metrology::FusionOptions options;
  options.noise_estimated = true;
  const auto fit = metrology::identify_fusion(training(), {"encoder"}, {"tachometer"}, options);
  std::printf("held out at constant speed: weights %.3f mm, observer %.3f mm RMS\n\n", 1e3 * fit.weights_rms,
              1e3 * fit.observer_rms);
  write_model(fit, "weights", folder / "weights.yaml");
  write_model(fit, "observer", folder / "observer.yaml");
  std::printf(
      "| noise | period s | encoder alone mm | the thesis's weights mm | observer mm | encoder over observer "
      "|\n"
      "| --- | --- | --- | --- | --- | --- |\n");
  for (const double noise : {0.05, 0.1, 0.2, 0.3, 0.4, 0.5})
    for (const double period : {3.0, 4.0, 5.0, 1.05}) {
      double best[3];
      double bandwidth[3] = {};
      const std::string models[] = {"", (folder / "weights.yaml").string(),
                                    (folder / "observer.yaml").string()};
      for (int m = 0; m < 3; ++m) {
        best[m] = 1e9;
        for (const double hz : {1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0}) {
          const double rms = tracking_error({period, noise, hz, !alone, models[m]}, machine, axis);
          if (rms >= best[m]) continue;
          best[m] = rms;
          bandwidth[m] = hz;
        }
      }
      std::printf("| %.0f %% | %g | %.3f (%g Hz) | %.3f (%g Hz) | %.3f (%g Hz) | %.1f |\n", 100.0 * noise,
                  period, 1e3 * best[0], bandwidth[0], 1e3 * best[1], bandwidth[1], 1e3 * best[2],
                  bandwidth[2], best[0] / best[2]);
      std::fflush(stdout);
    }
  std::filesystem::remove_all(folder);
  return 0;
}

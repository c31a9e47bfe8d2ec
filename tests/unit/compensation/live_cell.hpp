// The compensation of an XY table in the hands of a test: its inputs are written, its outputs read, its models made here.
#pragma once

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "components/compensation/compensation.hpp"
#include "core/compensation/geometric_file.hpp"
#include "core/compensation/thermal_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::compensation::testing {

/// A folder that goes with the test, with the machine file in it.
struct Folder : invar::testing::TemporaryFolder {
  Folder() { write("machine.yaml", "invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n"); }
  [[nodiscard]] std::filesystem::path machine() const { return *this / "machine.yaml"; }
};

/// X too long by `stretch`, and a bow of `bow` [m] at mid travel.
inline metrology::GeometricModel geometry(double stretch, double bow, double travel_x = 0.2) {
  metrology::GeometricModel model;
  model.chain = {{1, 0, 2}, 2};
  model.travel[0] = {0.0, travel_x};
  model.travel[1] = {0.0, 0.2};
  model.squareness_sigma[0] = 1e-6;
  for (std::size_t axis = 0; axis < 2; ++axis) model.splines[axis] = {model.travel[axis], 8};
  const auto& spline = model.splines[0];
  const auto component = static_cast<std::size_t>(metrology::translation(0, 0));
  model.coefficients[component].resize(spline.size());
  for (int i = 0; i < spline.size(); ++i) {
    const double s = spline.place(i) / travel_x;
    model.coefficients[component][i] = stretch * spline.place(i) + bow * 4.0 * s * (1.0 - s);
  }
  model.sigma[component] = Eigen::VectorXd::Constant(spline.intervals() + 1, 1e-7);
  model.field_sigma.range = model.travel;
  model.field_sigma.values = {Eigen::Vector3d{1e-7, 2e-7, 0.0}};
  return model;
}

/// expansion * x * (T - 28) between 26 and 30 degC, heating rates of -10 to 10 mK/s without effect.
inline metrology::ThermalError heat(double expansion, double lag = 0.0) {
  metrology::ThermalError model;
  model.x = {0.0, 0.2};
  model.temperature = {26.0, 30.0};
  model.heating_rate = {-0.01, 0.01};
  model.lag = lag;
  model.slope_temperature = std::abs(expansion) * 0.1;
  metrology::ThermalTerm term{metrology::ThermalFactor::temperature, -0.01, 0.01, Eigen::MatrixXd(23, 1)};
  for (Eigen::Index i = 0; i < 23; ++i)
    term.weights(i, 0) = expansion * 2.0 * (0.01 * static_cast<double>(i - 1));
  model.terms = {term};
  model.sigma_table = {{numerics::GridAxis{model.x, 1}, numerics::GridAxis{model.temperature, 1},
                        numerics::GridAxis{model.heating_rate, 1}},
                       std::vector<double>{5e-8}};
  return model;
}

inline std::filesystem::path write(const Folder& folder, const std::string& name,
                                   const metrology::GeometricModel& model) {
  ModelText text{"geometric", {}};
  write_geometric(text, model);
  text.write(folder / name);
  return folder / name;
}

inline std::filesystem::path write(const Folder& folder, const std::string& name,
                                   const metrology::ThermalError& model, const ThermalPlace& place) {
  ModelText text{"thermal", {}};
  write_place(text, place);
  write_thermal(text, model);
  text.write(folder / name);
  return folder / name;
}

inline std::uint32_t checksum_of(const std::filesystem::path& file) {
  return check_seal(config::Yaml::load(file));
}

struct LiveCell : Component {
  Output<stage::AxisState> state_x{*this, "state_x"};
  Output<stage::AxisState> state_y{*this, "state_y"};
  Output<thermal::NodeTemperature> slide{*this, "slide"};
  Output<ModelCommand> command{*this, "command"};
  Input<AxisCorrection> correction{*this, "correction"};
  Input<AxisCorrection> correction_y{*this, "correction_y"};
  Input<ModelStatus> status{*this, "status"};
  Inbox<event::Notice> notices{*this, "notices"};

  Folder folder;
  Compensation::Parameters parameters;
  std::unique_ptr<Compensation> compensation;
  double x = 0.1;
  double velocity = 0.0;  // m/s, of x
  double temperature = 28.0;
  bool thermometer_lives = true;
  std::uint64_t cycle = 0;
  std::uint64_t next_id = 1;
  double period = 1e-3;

  LiveCell() {
    parameters.machine = folder.machine();
    parameters.rate_limit = 1e-4;
    parameters.bound = 5e-5;
  }
  void bring_up(bool simulated = true) {
    compensation = std::make_unique<Compensation>(parameters);
    compensation->name = "compensation";
    compensation->simulated_time = simulated;
    join(state_x, "state_x");
    join(state_y, "state_y");
    join(slide, "temperature");
    join(command, "model");
    static_cast<OutputPort*>(compensation->find_port("correction_x"))->connect(correction);
    static_cast<OutputPort*>(compensation->find_port("correction_y"))->connect(correction_y);
    static_cast<OutputPort*>(compensation->find_port("status"))->connect(status);
    static_cast<OutputPort*>(compensation->find_port("notices"))->connect(notices);
    compensation->configure();
    compensation->activate();
  }
  void join(OutputPort& output, const char* port) {
    output.connect(*static_cast<InputPort*>(compensation->find_port(port)));
  }
  void step(const Tick&) noexcept override {}

  [[nodiscard]] Tick tick() const {
    return {Instant{} + Duration::seconds(period) * static_cast<std::int64_t>(cycle), period, cycle};
  }
  const AxisCorrection& cycle_once() {
    const Tick now = tick();
    set_now(now.now);
    compensation->set_now(now.now);
    stage::AxisState sample;
    const auto held = [](Input<AxisCorrection>& input) {
      return input.latest() != nullptr ? input.latest()->correction() : 0.0;
    };
    sample.setpoint_position(x);
    sample.setpoint_velocity(velocity);
    sample.correction(held(correction));
    state_x.write(sample);
    sample.setpoint_velocity(0.0);
    sample.setpoint_position(0.05);
    sample.correction(held(correction_y));
    state_y.write(sample);
    const auto each = static_cast<std::uint64_t>(std::max(1L, std::lround(0.1 / period)));
    if (thermometer_lives && cycle % each == 0) {
      thermal::NodeTemperature reading;
      reading.temperature(temperature);
      slide.write(reading);
    }
    compensation->step(now);
    ++cycle;
    return *correction.latest();
  }
  const AxisCorrection& run_for(double seconds) {
    for (long i = std::lround(seconds / period); i > 1; --i) cycle_once();
    return cycle_once();
  }
  /// Sends and steps once; the answer.
  const ModelStatus& tell(ModelCommandKind kind, const std::filesystem::path& path = {},
                          std::uint64_t transaction = 0) {
    ModelCommand sample;
    sample.id(next_id++);
    sample.kind(kind);
    sample.path(path.string());
    sample.transaction(transaction);
    command.write(sample);
    cycle_once();
    return *status.latest();
  }
  const ModelStatus& use(const std::filesystem::path& path, std::uint64_t transaction = 0) {
    if (tell(MODEL_STAGE, path, transaction).state() == MODEL_REFUSED) return *status.latest();
    return tell(MODEL_ACTIVATE, {}, transaction);
  }
  /// All notices so far, a line each.
  std::string said() {
    std::string text;
    event::Notice notice;
    while (notices.take(notice)) text += std::string{notice.text().c_str()} + "\n";
    return text;
  }
};

}  // namespace invar::compensation::testing

// Calibration as a transaction, on a table without dynamics whose error the test knows and changes at will.
#include "components/calibration/calibration.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <random>

#include "components/compensation/compensation.hpp"
#include "core/metrology/geometric/line_errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::calibration {
namespace {

using ::testing::HasSubstr;

/// Axes that stand where they are told the next cycle, a laser without noise, and the real compensation.
struct Table final : Component {
  struct Axis {
    Axis(Table& owner, const std::string& letter)
        : state{owner, "state_" + letter},
          command{owner, "command_" + letter},
          correction{owner, "correction_" + letter} {}
    Output<stage::AxisState> state;
    Inbox<stage::AxisCommand> command;
    Input<compensation::AxisCorrection> correction;
    stage::AxisState sample;
  };
  Axis x{*this, "x"};
  Axis y{*this, "y"};
  Output<sensing::DisplacementReading> reading{*this, "reading"};
  Inbox<sensing::BeamCommand> beam{*this, "beam"};
  Output<thermal::NodeTemperature> slide{*this, "slide"};
  Inbox<thermal::ThermalCommand> heater{*this, "heater"};
  Output<job::JobCommand> job{*this, "job"};
  Input<job::JobStatus> job_status{*this, "job_status"};
  Input<compensation::ModelStatus> model_status{*this, "model_status"};

  invar::testing::TemporaryFolder folder;
  compensation::Compensation::Parameters compensation_parameters;
  Calibration::Parameters calibration_parameters;
  std::unique_ptr<compensation::Compensation> compensation;
  std::unique_ptr<Calibration> calibration;
  bool calibration_lives = true;
  std::function<Eigen::Vector2d(double, double)> error = good_error;
  double expansion = 0.0;  // 1/K above 26.8 degC, of X
  double noise = 0.0;      // m, of the laser
  std::mt19937 random{5};
  std::normal_distribution<double> normal;
  double temperature = 26.8;
  double setpoint = 26.8;
  Eigen::Vector3d start = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  std::uint64_t cycle = 0;
  static constexpr double period = 0.01;

  static Eigen::Vector2d good_error(double at_x, double at_y) {
    return {5e-5 * at_x + 2e-6 * std::sin(20.0 * at_x) + 1e-5 * at_y,
            -3e-5 * at_y + 4e-5 * at_x * at_y / 0.2};
  }

  Table() {
    std::ofstream{folder / "machine.yaml"}
        << "invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n";
    compensation_parameters.transaction_timeout = 10.0;
    GeometricJob geometry;
    geometry.name = "geometry";
    geometry.machine = folder / "machine.yaml";
    geometry.interval = 0.02;
    geometry.verify_interval = 0.02;
    geometry.readings = 1;
    geometry.out = folder / "out";
    geometry.lines = {{"X", {0, 0}, {0.2, 0}},          {"Y", {0, 0}, {0, 0.2}},
                      {"Y at x", {0.2, 0}, {0.2, 0.2}}, {"diagonal", {0, 0}, {0.2, 0.2}},
                      {"half", {0, 0}, {0.2, 0.1}},     {"anti", {0.2, 0}, {0, 0.2}}};
    geometry.verify = {{"X at y", {0, 0.13}, {0.2, 0.13}}};
    calibration_parameters.jobs = {geometry};
    ThermalJob heat;
    heat.name = "heat";
    heat.line = {"X", {0, 0}, {0.2, 0}};
    heat.interval = 0.02;
    heat.readings = 1;
    heat.trace = {{0, 300, 350, 650}, {26.8, 30, 30, 27}};
    heat.verify = {{0, 100, 200}, {28.5, 29.5, 27.5}};
    heat.pause = 25.0;
    heat.soak = 10.0;
    heat.out = folder / "heat";
    calibration_parameters.thermal_jobs = {heat};
  }
  ~Table() override {
    calibration.reset();
    compensation.reset();
  }

  template <class T>
  static void join(Component& from, const char* output, Component& to, const char* input) {
    static_cast<Output<T>*>(from.find_port(output))->connect(*static_cast<InputPort*>(to.find_port(input)));
  }
  void bring_up() {
    compensation = std::make_unique<compensation::Compensation>(compensation_parameters);
    calibration = std::make_unique<Calibration>(calibration_parameters);
    calibration->id = 5;
    for (const char* letter : {"x", "y"}) {
      const std::string state = std::string{"state_"} + letter;
      const std::string command = std::string{"command_"} + letter;
      const std::string correction = std::string{"correction_"} + letter;
      join<stage::AxisState>(*this, state.c_str(), *calibration, state.c_str());
      join<stage::AxisState>(*this, state.c_str(), *compensation, state.c_str());
      join<stage::AxisCommand>(*calibration, command.c_str(), *this, command.c_str());
      join<compensation::AxisCorrection>(*compensation, correction.c_str(), *this, correction.c_str());
    }
    join<sensing::DisplacementReading>(*this, "reading", *calibration, "reading");
    join<thermal::NodeTemperature>(*this, "slide", *calibration, "temperature");
    join<thermal::NodeTemperature>(*this, "slide", *compensation, "temperature");
    join<thermal::ThermalCommand>(*calibration, "heater", *this, "heater");
    join<sensing::BeamCommand>(*calibration, "beam", *this, "beam");
    join<job::JobCommand>(*this, "job", *calibration, "job");
    join<job::JobStatus>(*calibration, "status", *this, "job_status");
    join<compensation::ModelCommand>(*calibration, "model", *compensation, "model");
    join<compensation::ModelStatus>(*compensation, "status", *calibration, "model_status");
    join<compensation::ModelStatus>(*compensation, "status", *this, "model_status");
    for (Component* one :
         {static_cast<Component*>(compensation.get()), static_cast<Component*>(calibration.get())}) {
      one->simulated_time = true;
      one->configure();
      one->activate();
    }
  }
  void step(const Tick&) noexcept override {}

  void cycle_once() {
    const Tick tick{Instant{} + Duration::milliseconds(10) * static_cast<std::int64_t>(cycle), period, cycle};
    ++cycle;
    for (Component* one : {static_cast<Component*>(this), static_cast<Component*>(compensation.get()),
                           static_cast<Component*>(calibration.get())})
      one->set_now(tick.now);
    for (Axis* axis : {&x, &y}) {
      stage::AxisCommand command;
      while (axis->command.take(command)) {
        if (command.kind() == stage::AXIS_COMMAND_MOVE) axis->sample.setpoint_position(command.position());
        axis->sample.command_id(command.id());
        axis->sample.command_done(true);
      }
      if (const auto* held = axis->correction.latest()) axis->sample.correction(held->correction());
      axis->sample.enabled(true);
      axis->sample.settled(true);
      axis->state.write(axis->sample);
    }
    thermal::ThermalCommand heating;
    while (heater.take(heating)) setpoint = heating.setpoint();
    temperature += std::clamp(setpoint - temperature, -0.02 * period, 0.02 * period);
    if (cycle % 10 == 0) {
      thermal::NodeTemperature sample;
      sample.at().time_ns(tick.now.ns);
      sample.temperature(temperature);
      sample.setpoint(setpoint);
      slide.write(sample);
    }
    compensation->step(tick);
    const Eigen::Vector2d sent{x.sample.setpoint_position() + x.correction.latest()->correction(),
                               y.sample.setpoint_position() + y.correction.latest()->correction()};
    const Eigen::Vector2d stands = sent + error(sent.x(), sent.y());
    const Eigen::Vector3d tool{stands.x() + expansion * (temperature - 26.8) * sent.x(), stands.y(), 0.0};
    sensing::BeamCommand aligned;
    while (beam.take(aligned)) {
      start = tool;
      direction = Eigen::Vector3d{aligned.beam_direction()[0], aligned.beam_direction()[1], 0.0};
    }
    sensing::DisplacementReading sample;
    sample.at().time_ns(tick.now.ns);
    sample.valid(true);
    sample.displacement(direction.dot(tool - start) + noise * normal(random));
    reading.write(sample);
    if (calibration_lives) calibration->step(tick);
  }
  void run(const char* wanted = "geometry") {
    job::JobCommand command;
    command.id(cycle + 1);
    command.kind(job::JOB_RUN);
    command.name(wanted);
    job.write(command);
    cycle_once();
  }
  /// Until the job says so, or has ended.
  void until(const std::string& text) {
    for (int i = 0; i < 1'000'000; ++i) {
      cycle_once();
      const auto phase = job_status.latest()->phase();
      if (text == job_status.latest()->text().c_str() || phase == job::JOB_DONE || phase == job::JOB_FAILED)
        return;
    }
  }
  [[nodiscard]] std::string ended() {
    until("done");
    for (int i = 0; i < 300; ++i) cycle_once();
    return job_status.latest()->text().c_str();
  }
  [[nodiscard]] std::uint32_t in_use() { return model_status.latest()->geometric_checksum(); }
  /// RMS of the readings of a comparison with that model in use.
  [[nodiscard]] double rms(const char* file, const std::string& model) const {
    const auto table = recording::Table::read(folder / "heat" / file, {"model"});
    const auto readings = table.in("error", "m");
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < table.rows(); ++i) {
      if (table.find("model")->texts[i] != model) continue;
      squares += readings[i] * readings[i];
      count += 1.0;
    }
    return std::sqrt(squares / count);
  }
  [[nodiscard]] double rms(const char* file) const {
    const auto table = recording::Table::read(folder / "out" / file, {"line"});
    return metrology::line_errors({table.find("line")->texts, table.in("x", "m"), table.in("y", "m"),
                                   table.in("z", "m"), table.in("displacement", "m")})
        .rms;
  }
  /// A first calibration that goes well; its model's checksum.
  std::uint32_t calibrated() {
    bring_up();
    run();
    EXPECT_EQ(ended(), "done");
    EXPECT_EQ(model_status.latest()->transaction(), 0U);
    EXPECT_NE(in_use(), 0U);
    return in_use();
  }
};

constexpr const char* on_trial = "compensation active; verifying";

TEST(Calibration, KeepsAModelThatHelpsAndMeasuresTheNextOneWithoutIt) {
  Table table;
  const auto first = table.calibrated();
  const double before = table.rms("verify_before.csv");
  EXPECT_GT(before, 3e-6);
  EXPECT_LT(table.rms("verify_after.csv"), 0.1 * before);
  table.run();
  EXPECT_EQ(table.ended(), "done");
  EXPECT_NEAR(table.rms("verify_before.csv"), before, 1e-9);
  EXPECT_EQ(table.in_use(), first);  // the same readings make the same model
}

TEST(Calibration, RollsBackAModelThatMakesTheErrorLarger) {
  Table table;
  const auto good = table.calibrated();
  table.run();
  table.until(on_trial);
  table.error = [](double x, double y) -> Eigen::Vector2d { return -2.0 * Table::good_error(x, y); };
  EXPECT_THAT(table.ended(), HasSubstr("larger on lines that were not fitted; rolled back"));
  EXPECT_EQ(table.in_use(), good);
  EXPECT_EQ(table.model_status.latest()->transaction(), 0U);
}

TEST(Calibration, DoesNotActivateAModelThatIsWrongOnLinesThatWereNotFitted) {
  Table table;
  const auto good = table.calibrated();
  table.run();
  table.until("measured line X at y");
  table.error = [](double x, double y) -> Eigen::Vector2d { return -1.5 * Table::good_error(x, y); };
  EXPECT_THAT(table.ended(), HasSubstr("it was not activated"));
  EXPECT_EQ(table.in_use(), good);
}

TEST(Calibration, AModelThatTheCompensationRefusesEndsTheJobAndLeavesWhatWas) {
  Table table;
  std::ofstream{table.folder / "other.yaml"}
      << "invar_machine: 1\nchain: [x, y]\ntravel: {x: [0, 0.2], y: [0, 0.2]}\n";
  table.compensation_parameters.machine = table.folder / "other.yaml";
  table.bring_up();
  table.run();
  EXPECT_THAT(table.ended(), HasSubstr("refused the model: it is of another machine"));
  EXPECT_EQ(table.in_use(), 0U);
  EXPECT_EQ(table.model_status.latest()->transaction(), 0U);
}

TEST(Calibration, SeesThatTheCompensationWasStartedAgainInTheMiddle) {
  Table table;
  const auto good = table.calibrated();
  table.run();
  table.until(on_trial);
  table.compensation->deactivate();
  table.compensation->activate();
  EXPECT_THAT(table.ended(), HasSubstr("restarted"));
  EXPECT_EQ(table.in_use(), good);
}

TEST(Calibration, TakesItsModelBackWhenItIsStoppedInTheMiddle) {
  Table table;
  const auto good = table.calibrated();
  table.run();
  table.until("measured line Y");  // the models are out of use for the measurement
  EXPECT_EQ(table.in_use(), 0U);
  table.calibration->deactivate();
  table.cycle_once();
  EXPECT_EQ(table.in_use(), good);
  table.calibration->activate();
  table.run();
  EXPECT_EQ(table.ended(), "done");
}

TEST(Calibration, OfPositionAndTemperatureStandsAboveTheGeometricModelAndBeatsThatOfRoomTemperature) {
  Table table;
  const auto geometric = table.calibrated();
  table.expansion = -2e-5;
  table.noise = 5e-8;
  table.run("heat");
  EXPECT_EQ(table.ended(), "done");
  for (const char* file : {"verify_fixed.csv", "verify_varying.csv"}) {
    EXPECT_GT(table.rms(file, "room temperature"), 1e-6) << file;
    EXPECT_LT(table.rms(file, "position and temperature"), 0.1 * table.rms(file, "room temperature")) << file;
  }
  EXPECT_EQ(table.in_use(), geometric);
  EXPECT_NE(table.model_status.latest()->thermal_checksum()[0], 0U);
  EXPECT_EQ(table.model_status.latest()->transaction(), 0U);
  EXPECT_EQ(table.setpoint, 26.8);  // as it was before the job
}

TEST(Calibration, OfPositionAndTemperatureIsTakenBackWhereTheMachineNoLongerBehavesSo) {
  Table table;
  const auto geometric = table.calibrated();
  table.expansion = -2e-5;
  table.noise = 5e-8;
  table.run("heat");
  table.until("comparing with the model of room temperature at one temperature");
  table.expansion = 3e-5;
  EXPECT_THAT(table.ended(), HasSubstr("larger than that of room temperature; rolled back"));
  EXPECT_EQ(table.in_use(), geometric);
  EXPECT_EQ(table.model_status.latest()->thermal_checksum()[0], 0U);
  EXPECT_EQ(table.setpoint, 26.8);
}

TEST(Calibration, KilledInTheMiddleItsModelGoesToo) {
  Table table;
  const auto good = table.calibrated();
  table.run();
  table.until("measured line Y");
  table.calibration_lives = false;
  for (int i = 0; i < 1200; ++i) table.cycle_once();
  EXPECT_EQ(table.in_use(), good);
  EXPECT_THAT(std::string{table.model_status.latest()->text().c_str()}, HasSubstr("fell silent"));
}

}  // namespace
}  // namespace invar::calibration

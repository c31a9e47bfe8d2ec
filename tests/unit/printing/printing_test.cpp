// The whole print job without middleware: stage, valve, pressure over Modbus TCP, flight, and a camera that sees perfectly.
#include "components/printing/printing.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <numbers>
#include <random>

#include "components/calibration/calibration.hpp"
#include "components/dispenser/dispenser.hpp"
#include "components/dispenser/valve.hpp"
#include "components/stage/axis_stage.hpp"
#include "components/world/simulated_pneumatics.hpp"
#include "components/world/simulated_stage.hpp"
#include "components/world/simulated_substrate.hpp"
#include "core/compensation/trajectory_file.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::printing {
namespace {

namespace fs = std::filesystem;
constexpr double degree = std::numbers::pi / 180.0;

/// Stands where vision and its camera stand: answers with what truly landed.
struct Seer final : Component {
  Inbox<dispensing::LandedDroplet> landed{*this, "landed", {}, 4096};
  Inbox<image::VisionCommand> command{*this, "command"};
  Output<image::VisionStatus> status{*this, "status"};
  Output<image::DropletsMeasured> droplets{*this, "droplets"};
  std::vector<dispensing::LandedDroplet> seen;
  image::VisionStatus sample;

  void activate() override {
    sample.view_center({0.03, -0.01});
    sample.view_size({0.0155, 0.0103});
    status.write(sample);
  }
  void step(const Tick& tick) noexcept override {
    for (dispensing::LandedDroplet one; landed.take(one);) {
      if (!seen.empty() && one.substrate() != seen.back().substrate()) seen.clear();
      seen.push_back(one);
    }
    image::VisionCommand wanted;
    while (command.take(wanted)) {
      image::DropletsMeasured found;
      found.request(wanted.id());
      found.at().time_ns(tick.now.ns);
      for (const auto& one : seen) {
        image::MeasuredDroplet droplet;
        droplet.status(one.satellite() ? image::DROPLET_SATELLITE : image::DROPLET_SOUND);
        droplet.position(one.position());
        droplet.diameter(one.diameter());
        found.droplets().push_back(droplet);
      }
      if (wanted.wanted() == image::VISION_MEASURE) droplets.write(found);
      sample.id(wanted.id());
      sample.phase(job::JOB_DONE);
      status.write(sample);
    }
  }
};

struct Cell final : Component {
  Output<job::JobCommand> job{*this, "job"};
  Input<job::JobStatus> status{*this, "status"};

  world::SimulatedStage::Parameters world_parameters;
  stage::Stage::Parameters stage_parameters[2];
  dispenser::Valve::Parameters valve_parameters;
  dispenser::Dispenser::Parameters dispenser_parameters;
  world::SimulatedPneumatics::Parameters air_parameters;
  world::SimulatedSubstrate::Parameters head;
  calibration::Calibration::Parameters parameters;
  struct Member {
    std::unique_ptr<Component> component;
    int every;
  };
  std::map<std::string, Member> members;
  std::vector<std::string> order;
  invar::testing::TemporaryFolder folder;
  std::uint64_t cycle = 0;

  Cell() {
    const fs::path deployment = fs::path{INVAR_SOURCE_DIR} / "deployment";
    world_parameters.machine = deployment / "machines/xy-table-nominal.yaml";
    for (int axis = 0; axis < 2; ++axis) {
      stage_parameters[axis].axis = axis;
      stage_parameters[axis].control.ki = 8e5;
      stage_parameters[axis].control.feedforward_velocity = 25.0 / 12.0;
      stage_parameters[axis].control.feedforward_acceleration = 3.2 / 12.0;
    }
    const auto port = test::free_port();
    air_parameters.modbus.map = dispenser_parameters.modbus.map = deployment / "maps/pneumatic.yaml";
    air_parameters.modbus.port = dispenser_parameters.modbus.port = port;
    dispenser::Pattern& grid = dispenser_parameters.patterns.emplace_back();
    grid.name = "grid";
    grid.from = {0.056, 0.057};
    grid.pitch = {2e-3, 1.8e-3};
    grid.columns = 5;
    grid.rows = 4;
    head.placement = {2.0e-6, 118.2e-6};
    head.tilt = 0.304 * degree;
    head.azimuth = 0.9739 * degree;
    head.satellites = 0.1;
    PrintJob& print = parameters.prints.emplace_back();
    print.name = "print";
    print.pattern = "grid";
    print.ruler = {0.1, 0.1};
    print.out = (folder / "out").string();
  }

  template <class Type, class Parameters>
  void add(const char* member, const Parameters& with, int every) {
    members[member] = {std::make_unique<Type>(with), every};
    order.emplace_back(member);
  }
  void join(const char* from, const char* out, const char* to, const char* in) {
    auto* output = dynamic_cast<OutputPort*>(members.at(from).component->find_port(out));
    auto* input = dynamic_cast<InputPort*>(members.at(to).component->find_port(in));
    ASSERT_TRUE(output != nullptr && input != nullptr && output->connect(*input))
        << from << "." << out << " " << to << "." << in;
  }
  void bring_up() {
    add<world::SimulatedStage>("world", world_parameters, 1);
    add<stage::Stage>("stage_x", stage_parameters[0], 1);
    add<stage::Stage>("stage_y", stage_parameters[1], 1);
    add<dispenser::Valve>("valve", valve_parameters, 1);
    add<world::SimulatedSubstrate>("substrate", head, 1);
    add<world::SimulatedPneumatics>("air", air_parameters, 20);
    add<dispenser::Dispenser>("dispenser", dispenser_parameters, 20);
    members["vision"] = {std::make_unique<Seer>(), 10};
    order.emplace_back("vision");
    add<calibration::Calibration>("job", parameters, 10);
    for (const char* axis : {"x", "y"}) {
      const std::string stage = std::string{"stage_"} + axis, state = std::string{"state_"} + axis;
      join("world", (std::string{"feedback_"} + axis).c_str(), stage.c_str(), "feedback");
      join(stage.c_str(), "motor", "world", (std::string{"motor_"} + axis).c_str());
      join(stage.c_str(), "state", "valve", state.c_str());
      join(stage.c_str(), "state", "job", state.c_str());
      join("job", (std::string{"command_"} + axis).c_str(), stage.c_str(), "command");
    }
    join("world", "tool", "substrate", "tool");
    join("valve", "pulse", "substrate", "pulse");
    join("air", "actual", "substrate", "pressure");
    join("dispenser", "pressure", "valve", "pressure");
    join("dispenser", "pressure", "job", "pressure");
    join("dispenser", "pattern", "valve", "pattern");
    join("dispenser", "pattern", "job", "pattern");
    join("dispenser", "status", "job", "aim_status");
    join("job", "pressure_command", "dispenser", "command");
    join("job", "print", "dispenser", "print");
    join("job", "aim", "dispenser", "model");
    join("job", "trigger", "valve", "command");
    join("valve", "state", "job", "valve");
    join("valve", "jetted", "job", "jetted");
    join("valve", "refused", "job", "refused");
    join("job", "lay", "substrate", "command");
    join("substrate", "state", "job", "substrate");
    join("substrate", "landed", "vision", "landed");
    join("job", "look", "vision", "command");
    join("vision", "status", "job", "vision");
    join("vision", "droplets", "job", "droplets");
    Component& component = *members.at("job").component;
    job.connect(*static_cast<InputPort*>(component.find_port("job")));
    static_cast<OutputPort*>(component.find_port("status"))->connect(status);
    for (const auto& member : order) {
      members.at(member).component->simulated_time = true;
      members.at(member).component->configure();
    }
    for (const auto& member : order) members.at(member).component->activate();
  }
  void step(const Tick&) noexcept override {}

  /// Until the job has ended, however it ends.
  job::JobStatus run() {
    job::JobCommand command;
    command.id(1);
    command.kind(job::JOB_RUN);
    command.name("print");
    job.write(command);
    for (;; ++cycle) {
      const Instant now = Instant{} + Duration::milliseconds(1) * static_cast<std::int64_t>(cycle);
      set_now(now);
      for (const auto& member : order) members.at(member).component->set_now(now);
      for (const auto& member : order) {
        const auto& [component, every] = members.at(member);
        if (cycle % static_cast<std::uint64_t>(every) == 0) component->step({now, 1e-3 * every, cycle});
      }
      const auto phase = status.latest()->phase();
      if (phase == job::JOB_DONE || phase == job::JOB_FAILED || now.in_seconds() > 900.0)
        return *status.latest();
    }
  }
  /// RMS distance from the targets, and what the truth about this head would have left: the scatter of these droplets.
  void compare(const char* file, double height, double& error, double& oracle,
               double speed_lost = 0.0) const {
    const auto table = recording::Table::read(folder / "out" / file);
    const auto of = [&](const char* column, const char* unit) { return table.in(column, unit); };
    const auto h = of("height", "m");
    const auto x = of("landed_x", "m"), tx = of("target_x", "m"), jx = of("jetted_x", "m"),
               v = of("stage_velocity_x", "m/s");
    const auto y = of("landed_y", "m"), ty = of("target_y", "m"), jy = of("jetted_y", "m");
    const double slope = std::tan(head.tilt);
    double errors = 0.0, scatter = 0.0, count = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (std::abs(h[i] - height) > 1e-9) continue;
      const double lead = head.delay + height / (head.speed * (1.0 - speed_lost));
      errors += std::pow(x[i] - tx[i], 2) + std::pow(y[i] - ty[i], 2);
      scatter +=
          std::pow(x[i] - jx[i] - head.placement[0] - height * slope * std::cos(head.azimuth) - v[i] * lead,
                   2) +
          std::pow(y[i] - jy[i] - head.placement[1] - height * slope * std::sin(head.azimuth), 2);
      count += 1.0;
    }
    ASSERT_GE(count, 19.0);
    error = std::sqrt(errors / count);
    oracle = std::sqrt(scatter / count);
  }
};

TEST(Printing, PlacesDropletsNearlyAsWellAsTheTruthWouldAtBothHeights) {
  for (const int seed : {6, 7, 8}) {
    Cell cell;
    cell.head.seed = seed;
    cell.bring_up();
    const auto status = cell.run();
    ASSERT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
    for (const double height : {2e-3, 20e-3}) {
      double before = 0.0, after = 0.0, oracle = 0.0, scatter = 0.0;
      cell.compare("droplets.csv", height, before, scatter);
      cell.compare("droplets_after.csv", height, after, oracle);
      std::cout << "seed " << seed << ", " << 1e3 * height << " mm: before " << 1e6 * before << " um, after "
                << 1e6 * after << " um, oracle " << 1e6 * oracle << " um\n";
      EXPECT_GT(before, 4.0 * after);
      EXPECT_LT(after, 1.25 * oracle);
    }
    const auto model = compensation::load_trajectory(cell.folder / "out/dispenser_compensation.yaml");
    EXPECT_NEAR(1.0 / model.slowness, 2.0, 0.05);
    EXPECT_NEAR(model.delay, 3e-4, 5.0 * model.delay_sigma);
  }
}

TEST(Printing, FollowsAHeadThatSlowsDown) {
  Cell cell;
  cell.head.speed_decay = 8e-4;
  cell.parameters.prints[0].drift.prints = 12;
  cell.parameters.prints[0].drift.pause = 8.0;
  cell.bring_up();
  const auto status = cell.run();
  ASSERT_EQ(status.phase(), job::JOB_DONE) << status.text().c_str();
  // Error of the last three prints, and what it would have been with the model of the calibration.
  const auto first = compensation::load_trajectory(cell.folder / "out/dispenser_compensation.yaml");
  const auto last = compensation::load_trajectory(cell.folder / "out/compensation_drift.yaml");
  const auto table = recording::Table::read(cell.folder / "out/drift.csv");
  const auto x = table.in("landed_x", "m"), tx = table.in("target_x", "m");
  const auto jx = table.in("jetted_x", "m"), v = table.in("stage_velocity_x", "m/s");
  double tracked = 0.0, fixed = 0.0;
  for (std::size_t i = x.size() - 57; i < x.size(); ++i) {
    tracked += std::pow(x[i] - tx[i], 2) / 57.0;
    fixed += std::pow(x[i] - jx[i] - first.offset(20e-3, {v[i], 0.0}).x(), 2) / 57.0;
  }
  std::cout << "along the rows: " << 1e6 * std::sqrt(tracked) << " um tracked, " << 1e6 * std::sqrt(fixed)
            << " um with the first model; time of flight " << 100.0 * (last.slowness / first.slowness - 1.0)
            << " % longer\n";
  EXPECT_GT(fixed, 3.0 * tracked);
  EXPECT_LT(std::sqrt(tracked), 1.4 * std::hypot(8e-6, 20e-6));
}

TEST(Printing, FailsWithWhatTheUserCanMend) {
  const auto failure = [](const auto& spoil) {
    Cell cell;
    spoil(cell);
    cell.bring_up();
    const auto status = cell.run();
    EXPECT_EQ(status.phase(), job::JOB_FAILED);
    return std::string{status.text().c_str()};
  };
  EXPECT_THAT(failure([](Cell& c) { c.air_parameters.supply = 3e4; }),
              ::testing::HasSubstr("does not reach its band"));
  EXPECT_THAT(failure([](Cell& c) { c.parameters.prints[0].pattern = "logo"; }),
              ::testing::HasSubstr("`logo` is no pattern"));
  EXPECT_THAT(failure([](Cell& c) {
                c.dispenser_parameters.patterns[0].pitch = {4e-3, 1e-3};
              }),
              ::testing::HasSubstr("larger than what the camera sees"));
  EXPECT_THAT(failure([](Cell& c) {
                c.valve_parameters.velocity = {1e-3, 0.03};
              }),
              ::testing::HasSubstr("20 of 20 droplets were not jetted: the stage's velocity"));
  EXPECT_THAT(failure([](Cell& c) {
                c.head.speed_decay = 1e-2;
                c.parameters.prints[0].drift = {.prints = 40, .pause = 2.0};
              }),
              ::testing::HasSubstr("clean the nozzle"));
}

}  // namespace
}  // namespace invar::printing

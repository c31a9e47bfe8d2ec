// Error motions measured one by one, in the loop: they follow the temperature, and stand still without one.
#include <gmock/gmock.h>

#include <cmath>

#include "core/compensation/component_file.hpp"
#include "core/metrology/geometric/error_motion_identification.hpp"
#include "tests/unit/compensation/live_cell.hpp"

namespace invar::compensation {
namespace {

using ::testing::HasSubstr;
using testing::LiveCell;

/// X grows by 10 ppm/K about 22 degC, read between 20 and 28 degC, in a state of this name.
metrology::ErrorMotionNetworks growing(const std::string& state) {
  metrology::ErrorMotionNetworks model;
  model.chain = {{1, 0, 2}, 2};
  model.travel = {Range{0.0, 0.2}, Range{0.0, 0.2}, Range{0.0, 1.0}};
  model.states = {{state, {20.0, 28.0}}};
  metrology::ErrorMotionReadings readings;
  readings.position.resize(63);
  readings.state.resize(1, 63);
  readings.value.resize(63);
  for (Eigen::Index i = 0; i < 63; ++i) {
    readings.position[i] = 0.01 * static_cast<double>(i % 21);
    readings.state(0, i) = 20.0 + 4.0 * static_cast<double>(i / 21);
    readings.value[i] = 1e-5 * readings.position[i] * (readings.state(0, i) - 22.0);
  }
  model.components[0] = metrology::identify_error_motion(readings).motion;
  return model;
}

std::filesystem::path write(const LiveCell& cell, const metrology::ErrorMotionNetworks& model) {
  ModelText text{"components", {}};
  write_components(text, model);
  text.write(cell.folder / "components.yaml");
  return cell.folder / "components.yaml";
}

TEST(LiveComponents, ReadBackAsTheyWere) {
  const LiveCell cell;
  const auto model = growing("temperature");
  const auto yaml = config::Yaml::load(write(cell, model));
  (void)check_seal(yaml);
  for (const char* key : {"invar_compensation", "kind"}) yaml.root()[key].accept_all();
  const auto read = read_components(yaml.root());
  yaml.finish();
  EXPECT_EQ(read.components[0]->states, std::vector<std::size_t>{0});
  for (const double t : {19.0, 21.3, 27.9}) {
    const std::array<double, 1> state{t};
    const Eigen::Vector3d p{0.137, 0.02, 0.0};
    EXPECT_EQ(read.error(p, read.tool, state), model.error(p, model.tool, state));
    EXPECT_EQ(read.sigma_at(p, read.tool, state), model.sigma_at(p, model.tool, state));
  }
}

TEST(LiveComponents, FollowTheTemperatureAndStandStillWithoutOne) {
  LiveCell cell;
  cell.period = 1e-2;
  cell.temperature = 26.0;
  cell.parameters.temperature_hold = 20.0;
  cell.bring_up();
  ASSERT_EQ(cell.use(write(cell, growing("temperature"))).state(), MODEL_ACTIVE) << cell.said();
  for (const double t : {26.0, 21.0, 24.5}) {
    cell.temperature = t;
    const AxisCorrection& now = cell.run_for(150.0);
    EXPECT_NEAR(now.correction(), -1e-5 * 0.1 * (t - 22.0), 2e-8) << t;
    EXPECT_EQ(now.contribution()[2], 0.0);
    EXPECT_EQ(now.temperature(), t);
  }
  EXPECT_EQ(cell.status.latest()->condition(), TEMPERATURE_SOUND);
  (void)cell.said();
  const double sound = cell.correction.latest()->sigma();

  cell.temperature = 29.0;  // a kelvin outside: held at 28
  EXPECT_NEAR(cell.run_for(60.0).correction(), -1e-5 * 0.1 * 6.0, 2e-8);
  EXPECT_THAT(cell.said(), HasSubstr("outside what was calibrated"));
  EXPECT_GT(cell.correction.latest()->sigma(), 3.0 * sound);

  cell.temperature = 26.0;
  const double before = cell.run_for(60.0).correction();
  cell.thermometer_lives = false;
  EXPECT_EQ(cell.run_for(15.0).correction(), before);  // held
  EXPECT_EQ(cell.status.latest()->condition(), TEMPERATURE_HELD);
  EXPECT_GT(cell.correction.latest()->sigma(), sound);
  double last = before;
  double largest_step = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const double now = cell.cycle_once().correction();
    largest_step = std::max(largest_step, std::abs(now - last));
    last = now;
  }
  EXPECT_EQ(cell.status.latest()->condition(), TEMPERATURE_REFUSED);
  EXPECT_NEAR(last, -1e-5 * 0.1 * 2.0, 2e-8);  // the middle of the calibration, 24 degC
  EXPECT_LE(largest_step, 1.0001e-6);          // rate_limit times period
}

TEST(LiveComponents, WhatTheLoopCannotKnowIsRefused) {
  LiveCell cell;
  cell.bring_up();
  const auto refused = [&](const metrology::ErrorMotionNetworks& model, const std::string& words) {
    EXPECT_EQ(cell.use(write(cell, model)).state(), MODEL_REFUSED);
    EXPECT_THAT(cell.said(), HasSubstr(words));
  };
  refused(growing("temperature_base"), "needs the temperature of `base`");
  refused(growing("load"), "it depends on `load`, which the loop does not know");
  auto many =
      growing("temperature");  // beyond the bound at the end of one state of five, the others in the middle
  for (int s = 0; s < 4; ++s) many.states.push_back({"heating_rate", {-1.0, 1.0}});
  many.components[0]->network.output_scale *= 12.0;
  refused(many, "beyond the bound");
  auto other = growing("temperature");
  other.travel[0] = {0.0, 0.4};
  refused(other, "of another machine: its axis x has another travel");
  other = growing("temperature");
  other.components[0]->network.output_offset += 1e-4;
  refused(other, "beyond the bound");
  other = growing("temperature");
  other.components[0]->network.output_scale *= 1000.0;
  refused(other, "bend too much for the loop's tables");
  other = growing("temperature");
  other.components[0]->sigma = 1e-3;
  refused(other, "not certain enough");
}

}  // namespace
}  // namespace invar::compensation

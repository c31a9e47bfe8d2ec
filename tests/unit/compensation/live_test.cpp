// The compensation in the loop: what it applies, what it refuses, how it changes and how it takes changes back.
#include <gmock/gmock.h>

#include <chrono>
#include <sstream>
#include <thread>

#include "core/metrology/thermal/heat_trace.hpp"
#include "tests/support/real_time_guard.hpp"
#include "tests/unit/compensation/live_cell.hpp"

namespace invar::compensation {
namespace {

using testing::geometry;
using ::testing::HasSubstr;
using testing::heat;
using testing::LiveCell;
using testing::write;

std::string changed(const std::filesystem::path& file, const std::string& from, const std::string& to) {
  std::ostringstream text;
  text << std::ifstream{file}.rdbuf();
  std::string all = text.str();
  const auto at = all.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return all.replace(at, from.size(), to);
}

TEST(LiveCompensation, PutsAModelToUseWithoutAJumpAndGoesBackWithoutOne) {
  LiveCell cell;
  cell.bring_up();
  EXPECT_EQ(cell.run_for(0.1).correction(), 0.0);
  ASSERT_EQ(cell.use(write(cell.folder, "a.yaml", geometry(1e-4, 0.0))).state(), MODEL_ACTIVE);
  double last = cell.correction.latest()->correction();
  double largest_step = 0.0;
  for (int i = 0; i < 500; ++i) {
    const AxisCorrection& now = cell.cycle_once();
    largest_step = std::max(largest_step, std::abs(now.correction() - last));
    EXPECT_NEAR(now.contribution()[0] + now.contribution()[1] + now.contribution()[2], now.correction(),
                1e-18);
    last = now.correction();
  }
  EXPECT_LE(largest_step, 1.0001e-7);  // rate_limit times period
  // x' (1 + 1e-4) = x: e(P - e(P)) to the second step.
  EXPECT_NEAR(last, -1e-4 * 0.1 * (1.0 - 1e-4), 2e-9);
  EXPECT_NEAR(cell.correction.latest()->sigma(), 1e-7, 1e-12);
  EXPECT_EQ(cell.correction.latest()->layer_checksum()[0], testing::checksum_of(cell.folder / "a.yaml"));

  EXPECT_EQ(cell.tell(MODEL_ROLLBACK).state(), MODEL_NONE);
  EXPECT_NEAR(cell.cycle_once().correction(), last, 3e-7);
  EXPECT_NEAR(cell.run_for(1.0).correction(), 0.0, 1e-15);
}

// Lost motion over position: half of it to the side that the axis came from, and no step when it turns.
TEST(LiveCompensation, TakesHalfTheReversalToTheSideThatTheAxisCameFrom) {
  LiveCell cell;
  cell.bring_up();
  metrology::GeometricModel model = geometry(0.0, 0.0);
  model.reversal[0] = metrology::constant_reversal({0.0, 0.2}, 0.0, 1e-7);
  const auto& spline = model.reversal[0].spline;
  for (int i = 0; i < spline.size(); ++i)
    model.reversal[0].coefficients[i] = 4e-6 + 2e-5 * spline.place(i);  // 4 um at 0, 8 um at 0.2 m
  ASSERT_EQ(cell.use(write(cell.folder, "a.yaml", model)).state(), MODEL_ACTIVE);
  EXPECT_NEAR(cell.run_for(0.5).correction(), 0.0, 1e-12);  // it has not moved yet
  cell.velocity = 0.01;
  EXPECT_NEAR(cell.run_for(0.5).correction(), -3e-6, 1e-9);
  cell.velocity = 0.0;
  EXPECT_NEAR(cell.run_for(0.5).correction(), -3e-6, 1e-9);  // standing, it stays where it came from
  cell.velocity = -0.01;
  double last = cell.correction.latest()->correction();
  double largest_step = 0.0;
  for (int i = 0; i < 500; ++i) {
    const double now = cell.cycle_once().correction();
    largest_step = std::max(largest_step, std::abs(now - last));
    last = now;
  }
  EXPECT_NEAR(last, 3e-6, 1e-9);
  EXPECT_LE(largest_step, 1.0001e-7);  // rate_limit times period
  cell.x = 0.2;
  EXPECT_NEAR(cell.run_for(0.5).correction(), 4e-6, 1e-9);
  EXPECT_EQ(cell.correction_y.latest()->correction(), 0.0);
}

TEST(LiveCompensation, RefusesWhatMustNotMoveTheMachineAndTheLastGoodModelHolds) {
  LiveCell cell;
  cell.bring_up();
  const auto good = write(cell.folder, "good.yaml", geometry(1e-4, 0.0));
  ASSERT_EQ(cell.use(good).state(), MODEL_ACTIVE);
  const double before = cell.run_for(1.0).correction();
  const auto bad = cell.folder / "bad.yaml";
  const auto refused = [&](const std::string& words) {
    const ModelStatus& status = cell.tell(MODEL_STAGE, bad);
    EXPECT_EQ(status.state(), MODEL_REFUSED) << words;
    EXPECT_THAT(std::string{status.text().c_str()}, HasSubstr(words));
    EXPECT_THAT(cell.said(), HasSubstr(words));
    EXPECT_EQ(cell.run_for(0.2).correction(), before) << words;
    EXPECT_EQ(cell.status.latest()->geometric_checksum(), testing::checksum_of(good));
  };
  std::ofstream{bad} << changed(good, "0.2]", "0.3]");
  refused("checksum does not fit");
  std::ofstream{bad} << changed(good, "checksum", "# checksum");
  refused("carries no checksum");
  std::ofstream{bad} << changed(good, "kind", "kind: fusion\n#");
  refused("checksum does not fit");
  std::ofstream{bad} << "rubbish: [";
  refused("no YAML");
  std::filesystem::remove(bad);
  refused("cannot be read");
  write(cell.folder, "bad.yaml", geometry(1e-4, 0.0, 0.3));
  refused("of another machine: its axis x has another travel");
  auto other = geometry(1e-4, 0.0);
  other.chain.order = {0, 1, 2};
  write(cell.folder, "bad.yaml", other);
  refused("of another machine: its axes stand in another order");
  write(cell.folder, "bad.yaml", geometry(1e-3, 0.0));
  refused("beyond the bound");
  write(cell.folder, "bad.yaml", geometry(0.0, std::nan("")));
  refused("is not finite");
  write(cell.folder, "bad.yaml", heat(1e-5), {});
  refused("does not say which axis");
  write(cell.folder, "bad.yaml", heat(1e-5), {0, 0});
  refused("would count twice");
  write(cell.folder, "bad.yaml", heat(1e-5), {0, 0x1234});
  refused("measured above another geometric model");
  auto part = heat(1e-5);
  part.x = {0.0, 0.07};
  write(cell.folder, "bad.yaml", part, {0, testing::checksum_of(good)});
  refused("out of range");
  auto zoned = heat(1e-5);
  zoned.zones = {{"base", {20.0, 30.0}, 0.0}};
  write(cell.folder, "bad.yaml", zoned, {0, testing::checksum_of(good)});
  refused("needs the temperature of `base`");
}

TEST(LiveCompensation, FollowsTheTemperatureAndSaysWhenItIsOutsideStaleOrLost) {
  LiveCell cell;
  cell.period = 1e-2;
  cell.parameters.temperature_hold = 20.0;
  cell.bring_up();
  const auto model = heat(1e-5);
  const auto below = write(cell.folder, "geometry.yaml", geometry(5e-5, 0.0));
  ASSERT_EQ(cell.use(below).state(), MODEL_ACTIVE);
  ASSERT_EQ(cell.use(write(cell.folder, "heat.yaml", model, {0, testing::checksum_of(below)})).state(),
            MODEL_ACTIVE);
  for (const double t : {27.0, 28.5, 29.9}) {
    cell.temperature = t;
    const AxisCorrection& now = cell.run_for(150.0);  // until the step of the temperature is out of its rate
    const double corrected = cell.x + now.correction();
    EXPECT_NEAR(now.correction(), -5e-5 * corrected - model.value({corrected, t, 0.0}), 2e-8) << t;
    EXPECT_NEAR(now.contribution()[1], -1e-5 * 0.1 * (t - 28.0), 2e-8);
    EXPECT_NEAR(now.layer_sigma()[1], 5e-8, 1e-9);
    EXPECT_EQ(now.contribution()[2], 0.0);
  }
  EXPECT_EQ(cell.status.latest()->condition(), TEMPERATURE_SOUND);
  (void)cell.said();

  cell.temperature = 31.0;  // one kelvin outside: the end value is held, with a larger sigma
  AxisCorrection now = cell.run_for(60.0);
  EXPECT_NEAR(now.contribution()[1], -1e-5 * 0.1 * 2.0, 2e-8);
  EXPECT_NEAR(now.layer_sigma()[1], 1e-6, 1e-7);
  EXPECT_TRUE(now.outside());
  EXPECT_THAT(cell.said(), HasSubstr("outside what was calibrated"));
  cell.temperature = 35.0;  // too far
  now = cell.run_for(60.0);
  EXPECT_EQ(now.contribution()[1], 0.0);
  EXPECT_TRUE(now.refused());
  EXPECT_THAT(cell.said(), HasSubstr("taken out"));
  cell.temperature = 29.0;
  now = cell.run_for(120.0);
  EXPECT_NEAR(now.contribution()[1], -1e-5 * 0.1, 2e-8);
  EXPECT_FALSE(now.refused());

  cell.thermometer_lives = false;
  now = cell.run_for(3.0);
  EXPECT_TRUE(now.stale());
  EXPECT_EQ(cell.status.latest()->condition(), TEMPERATURE_HELD);
  EXPECT_NEAR(now.contribution()[1], -1e-5 * 0.1, 2e-8);
  const double sigma = now.layer_sigma()[1];
  now = cell.run_for(15.0);
  EXPECT_NEAR(now.contribution()[1], -1e-5 * 0.1, 2e-8);
  EXPECT_GT(now.layer_sigma()[1], 1.01 * sigma);
  now = cell.run_for(20.0);
  EXPECT_EQ(cell.status.latest()->condition(), TEMPERATURE_REFUSED);
  EXPECT_EQ(now.contribution()[1], 0.0);
  EXPECT_NEAR(now.correction(), -5e-5 * 0.1, 1e-9);  // the geometric layer stays
  EXPECT_THAT(cell.said(), HasSubstr("stale"));
  cell.thermometer_lives = true;
  now = cell.run_for(30.0);
  EXPECT_NEAR(now.contribution()[1], -1e-5 * 0.1, 2e-8);
}

TEST(LiveCompensation, ALagThatIsActivatedLateBeginsWhereTheBodyIs) {
  LiveCell cell;
  cell.period = 0.1;
  cell.parameters.rate_limit = 1e-3;
  cell.bring_up();
  const auto model = heat(1e-5, 300.0);
  cell.temperature = 26.5;
  std::vector<double> time;
  std::vector<double> temperature;
  const auto heating = [&](double seconds) {
    for (double t = 0.0; t < seconds; t += cell.period) {
      time.push_back(cell.tick().now.in_seconds());
      temperature.push_back(cell.temperature);
      cell.cycle_once();
      cell.temperature += 2e-3 * cell.period;
    }
  };
  heating(900.0);
  ASSERT_EQ(cell.use(write(cell.folder, "heat.yaml", model, {0, 0})).state(), MODEL_ACTIVE);
  time.insert(time.end(), {time.back() + 0.1, time.back() + 0.2});  // the two cycles of the commands
  temperature.insert(temperature.end(), {cell.temperature, cell.temperature});
  heating(300.0);
  const auto n = static_cast<Eigen::Index>(time.size());
  const double body =
      metrology::lagged_temperature(Eigen::Map<Eigen::VectorXd>(time.data(), n),
                                    Eigen::Map<Eigen::VectorXd>(temperature.data(), n), 300.0)(n - 1);
  EXPECT_LT(body, temperature.back() - 0.4);
  EXPECT_NEAR(cell.correction.latest()->contribution()[1], -1e-5 * 0.1 * (body - 28.0), 1e-9);
  EXPECT_NEAR(cell.correction.latest()->heating_rate(), 2e-3, 1e-5);
}

// What `invar diagnose` writes of the same axis: patched.yaml of plant error_map.
TEST(LiveCompensation, CorrectsByADiagnosedErrorMap) {
  LiveCell cell;
  const auto map = [&](const std::string& name, const std::string& axis, const std::string& coefficient) {
    cell.folder.write(name, "invar_model: 1\nplant: error_map\n" + axis +
                                "columns: {position: x, time: t, temperature: T, error: e}\n"
                                "range: {temperature: [26, 30]}\n"
                                "baseline: {positions: [0, 0.2], errors: [0, 0]}\n"
                                "parameters: {reference_temperature: {value: 26, unit: degC}}\n"
                                "terms: [{term: thermal_expansion, coefficient: {value: " +
                                coefficient + ", unit: 1/K, sigma: 1e-7}}]\n");
    return cell.folder / name;
  };
  cell.bring_up();
  cell.run_for(0.1);
  ASSERT_EQ(cell.use(map("patched.yaml", "axis: x\n", "1e-5")).state(), MODEL_ACTIVE)
      << cell.status.latest()->text().c_str();
  EXPECT_NEAR(cell.run_for(1.0).correction(), -1e-5 * 2.0 * 0.1, 5e-9);  // 28 degC at 100 mm
  EXPECT_NE(cell.correction.latest()->sigma(), 0.0);
  EXPECT_EQ(cell.tell(MODEL_STAGE, map("large.yaml", "axis: x\n", "1e-4")).state(), MODEL_REFUSED);
  EXPECT_THAT(cell.status.latest()->text().c_str(), HasSubstr("beyond the bound"));
  EXPECT_EQ(cell.tell(MODEL_STAGE, map("of-none.yaml", "", "1e-5")).state(), MODEL_REFUSED);
  EXPECT_THAT(cell.status.latest()->text().c_str(), HasSubstr("does not say which axis"));
  EXPECT_EQ(cell.tell(MODEL_ROLLBACK).state(), MODEL_NONE);
  EXPECT_NEAR(cell.run_for(1.0).correction(), 0.0, 1e-15);
}

TEST(LiveCompensation, TakesBackTheModelsOfATransactionWhoseOwnerFellSilent) {
  LiveCell cell;
  cell.period = 1e-2;
  cell.parameters.transaction_timeout = 10.0;
  cell.bring_up();
  const auto good = write(cell.folder, "good.yaml", geometry(5e-5, 0.0));
  const auto trial = write(cell.folder, "trial.yaml", geometry(1e-4, 1e-6));
  ASSERT_EQ(cell.use(good).state(), MODEL_ACTIVE);
  EXPECT_EQ(cell.tell(MODEL_CLEAR, {}, 7).transaction(), 7U);
  EXPECT_NEAR(cell.run_for(5.0).correction(), 0.0, 1e-15);
  ASSERT_EQ(cell.use(trial, 7).state(), MODEL_ACTIVE);
  for (int i = 0; i < 6; ++i) {  // kept alive for half a minute
    cell.run_for(5.0);
    cell.tell(MODEL_KEEP, {}, 7);
  }
  EXPECT_EQ(cell.status.latest()->geometric_checksum(), testing::checksum_of(trial));
  EXPECT_EQ(cell.tell(MODEL_CLEAR, {}, 8).state(), MODEL_REFUSED);  // somebody else
  EXPECT_EQ(cell.tell(MODEL_STAGE, good).state(), MODEL_REFUSED);
  cell.run_for(12.0);
  EXPECT_EQ(cell.status.latest()->transaction(), 0U);
  EXPECT_EQ(cell.status.latest()->geometric_checksum(), testing::checksum_of(good));
  EXPECT_NEAR(cell.run_for(2.0).correction(), -5e-5 * 0.1, 1e-9);
  EXPECT_THAT(cell.said(), HasSubstr("fell silent"));
  EXPECT_EQ(cell.tell(MODEL_COMMIT, {}, 7).state(), MODEL_REFUSED);

  // Committed, it stays; and a rollback without a transaction goes back to what was before all of it.
  ASSERT_EQ(cell.use(trial, 9).state(), MODEL_ACTIVE);
  EXPECT_EQ(cell.tell(MODEL_COMMIT, {}, 9).state(), MODEL_ACTIVE);
  cell.run_for(20.0);
  EXPECT_EQ(cell.status.latest()->geometric_checksum(), testing::checksum_of(trial));
  cell.tell(MODEL_ROLLBACK);
  EXPECT_EQ(cell.status.latest()->geometric_checksum(), testing::checksum_of(good));
}

TEST(LiveCompensation, StartedAgainInTheMiddleOfATransactionItStandsWhereThatBegan) {
  LiveCell cell;
  cell.bring_up();
  const auto good = write(cell.folder, "good.yaml", geometry(5e-5, 0.0));
  ASSERT_EQ(cell.use(good).state(), MODEL_ACTIVE);
  ASSERT_EQ(cell.use(write(cell.folder, "trial.yaml", geometry(1e-4, 0.0)), 7).state(), MODEL_ACTIVE);
  cell.run_for(1.0);
  const double before = cell.correction.latest()->correction();
  cell.compensation->deactivate();
  cell.compensation->activate();
  EXPECT_NEAR(cell.cycle_once().correction(), before, 1.01e-7);
  EXPECT_EQ(cell.status.latest()->transaction(), 0U);
  EXPECT_EQ(cell.status.latest()->geometric_checksum(), testing::checksum_of(good));
  EXPECT_NEAR(cell.run_for(1.0).correction(), -5e-5 * 0.1, 1e-9);
}

TEST(LiveCompensation, GrowsTheGeometryToTheSlidesTemperature) {
  LiveCell cell;
  cell.period = 1e-2;
  cell.parameters.rate_limit = 1e-3;
  cell.parameters.temperature_hold = 20.0;
  cell.bring_up();
  metrology::GeometricModel model = geometry(5e-5, 0.0);
  model.reference_temperature = 20.0;
  model.expansion = {11.5e-6, 0.0, 0.0};
  model.expansion_sigma = {0.2e-6, 0.0, 0.0};
  cell.temperature = 20.0;
  ASSERT_EQ(cell.use(write(cell.folder, "grown.yaml", model)).state(), MODEL_ACTIVE);
  EXPECT_NEAR(cell.run_for(2.0).correction(), -5e-5 * 0.1, 1e-9);
  cell.temperature = 28.0;
  cell.x = 0.18;
  AxisCorrection now = cell.run_for(5.0);
  // steel, 8 K above the reference, 180 mm from the origin: 16.6 um on top of 9 um
  EXPECT_NEAR(now.correction(), -(5e-5 + 11.5e-6 * 8.0) * 0.18, 5e-9);
  EXPECT_NEAR(now.sigma(), std::hypot(1e-7, 0.2e-6 * 8.0 * 0.08), 1e-9);  // the expansion's about mid travel
  EXPECT_EQ(cell.status.latest()->condition(), TEMPERATURE_SOUND);
  EXPECT_EQ(cell.correction_y.latest()->correction(), 0.0);
  cell.thermometer_lives = false;
  now = cell.run_for(10.0);
  EXPECT_TRUE(now.stale());
  EXPECT_NEAR(now.correction(), -(5e-5 + 11.5e-6 * 8.0) * 0.18, 5e-9);
  now = cell.run_for(30.0);  // lost: the field at the reference is what is known
  EXPECT_EQ(cell.status.latest()->condition(), TEMPERATURE_REFUSED);
  EXPECT_NEAR(now.correction(), -5e-5 * 0.18, 1e-9);
}

TEST(LiveCompensation, TakesOutAThermalLayerThatWasMeasuredAboveAnotherGeometry) {
  LiveCell cell;
  cell.bring_up();
  const auto first = write(cell.folder, "first.yaml", geometry(5e-5, 0.0));
  ASSERT_EQ(cell.use(first).state(), MODEL_ACTIVE);
  ASSERT_EQ(cell.use(write(cell.folder, "heat.yaml", heat(1e-5), {0, testing::checksum_of(first)})).state(),
            MODEL_ACTIVE);
  ASSERT_EQ(cell.use(write(cell.folder, "second.yaml", geometry(6e-5, 0.0))).state(), MODEL_ACTIVE);
  EXPECT_EQ(cell.status.latest()->thermal_checksum()[0], 0U);
  EXPECT_THAT(cell.said(), HasSubstr("taken out: it was measured above another"));
  cell.tell(MODEL_ROLLBACK);  // both layers again
  EXPECT_NE(cell.status.latest()->thermal_checksum()[0], 0U);
}

TEST(LiveCompensation, NeitherAllocatesNorLocksWhateverHappens) {
  LiveCell cell;
  cell.parameters.temperature_timeout = 0.2;
  cell.parameters.temperature_hold = 0.2;
  cell.parameters.transaction_timeout = 3.0;
  cell.parameters.state = (cell.folder / "state").string();
  cell.bring_up(false);
  const auto below = write(cell.folder, "geometry.yaml", geometry(5e-5, 1e-6));
  const auto above = write(cell.folder, "heat.yaml", heat(1e-5, 50.0), {0, testing::checksum_of(below)});
  std::ofstream{cell.folder / "bad.yaml"} << "rubbish";
  std::vector<ModelCommand> commands(9);
  const auto set = [&](std::size_t i, ModelCommandKind kind, const std::filesystem::path& path,
                       std::uint64_t transaction) {
    commands[i].id(i + 1);
    commands[i].kind(kind);
    commands[i].path(path.string());
    commands[i].transaction(transaction);
  };
  set(0, MODEL_STAGE, below, 0);
  set(1, MODEL_ACTIVATE, {}, 0);
  set(2, MODEL_STAGE, cell.folder / "bad.yaml", 0);
  set(3, MODEL_STAGE, above, 0);
  set(4, MODEL_ACTIVATE, {}, 5);
  set(5, MODEL_KEEP, {}, 5);
  set(6, MODEL_COMMIT, {}, 5);
  set(7, MODEL_CLEAR, {}, 6);
  set(8, MODEL_ROLLBACK, {}, 6);
  bool done = true;
  for (const ModelCommand& command : commands) {
    cell.command.write(command);
    const support::RealTimeGuard guard;
    bool answered = false;
    for (int i = 0; i < 2000; ++i) {
      cell.temperature += 1e-3;  // through the range and out of it
      cell.x = 0.1 + 0.09 * std::sin(1e-3 * i);
      cell.thermometer_lives = i % 1000 < 400;
      cell.cycle_once();
      answered = answered || cell.status.latest()->command_id() == command.id();
      if (i >= 1500 && !answered)
        std::this_thread::sleep_for(std::chrono::milliseconds(2));  // for the loader
    }
    done = done && (answered || command.kind() == MODEL_KEEP);
    EXPECT_EQ(guard.violations(), 0U) << "command " << command.id();
    if (cell.temperature > 33.0) cell.temperature = 27.0;
  }
  EXPECT_TRUE(done);
  EXPECT_NE(cell.status.latest()->thermal_checksum()[0], 0U);
  set(0, MODEL_CLEAR, {}, 7);
  cell.command.write(commands[0]);
  const support::RealTimeGuard guard;
  for (int i = 0; i < 4000; ++i) cell.cycle_once();  // nobody shows that he lives
  EXPECT_EQ(guard.violations(), 0U);
  EXPECT_NE(cell.status.latest()->thermal_checksum()[0], 0U);
  const std::string said = cell.said();
  EXPECT_THAT(said, HasSubstr("stale"));
  EXPECT_THAT(said, HasSubstr("taken out"));
  EXPECT_THAT(said, HasSubstr("fell silent"));
  cell.compensation->cleanup();  // what was committed stands in the folder
  EXPECT_EQ(KeptModels::read(cell.parameters.state).models.size(), 2U);
}

}  // namespace
}  // namespace invar::compensation

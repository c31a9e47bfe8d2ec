// Models that outlive the process: kept when committed, used at the next start, refused when they are not what was kept.
#include <gmock/gmock.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "tests/unit/compensation/live_cell.hpp"

namespace invar::compensation {
namespace {

namespace fs = std::filesystem;
using testing::checksum_of;
using testing::geometry;
using ::testing::HasSubstr;
using testing::heat;
using testing::LiveCell;
using testing::write;

std::string seal_of(const fs::path& model) { return config::Yaml::load(model).root().text("checksum"); }

struct KeptCell : LiveCell {
  KeptCell() { parameters.state = (folder / "state").string(); }
  /// The cell ends, with all that was loaded, and begins anew.
  void start_again() {
    compensation->deactivate();
    compensation->cleanup();
    (void)said();
    compensation->configure();
    compensation->activate();
    cycle_once();
  }
  [[nodiscard]] std::uint32_t geometric() { return status.latest()->geometric_checksum(); }
  [[nodiscard]] fs::path copy_of(const fs::path& model) const {
    return fs::path{parameters.state} / ("geometric-" + seal_of(model) + ".yaml");
  }
};

TEST(KeptModels, WhatWasCommittedIsInUseAtTheNextStartThoughItsFileIsGone) {
  KeptCell cell;
  cell.bring_up();
  const auto below = write(cell.folder, "geometry.yaml", geometry(1e-4, 0.0));
  const std::uint32_t checksum = checksum_of(below);
  const auto above = write(cell.folder, "heat.yaml", heat(1e-5), {0, checksum});
  ASSERT_EQ(cell.use(below, 7).state(), MODEL_ACTIVE);
  ASSERT_EQ(cell.use(above, 7).state(), MODEL_ACTIVE);
  EXPECT_FALSE(KeptModels::read(cell.parameters.state).any);  // on trial
  ASSERT_EQ(cell.tell(MODEL_COMMIT, {}, 7).state(), MODEL_ACTIVE);
  const double before = cell.run_for(3.0).correction();
  fs::remove(below);
  fs::remove(above);

  cell.start_again();
  EXPECT_EQ(cell.status.latest()->state(), MODEL_ACTIVE);
  EXPECT_EQ(cell.geometric(), checksum);
  EXPECT_NE(cell.status.latest()->thermal_checksum()[0], 0U);
  EXPECT_NEAR(cell.run_for(3.0).correction(), before, 1e-15);
  EXPECT_EQ(cell.said(), "the temperature is sound: its correction is in use\n");
}

TEST(KeptModels, ATrialThatWasNeverCommittedIsForgotten) {
  KeptCell cell;
  cell.bring_up();
  const auto good = write(cell.folder, "good.yaml", geometry(5e-5, 0.0));
  ASSERT_EQ(cell.use(good).state(), MODEL_ACTIVE);
  ASSERT_EQ(cell.use(write(cell.folder, "trial.yaml", geometry(1e-4, 0.0)), 7).state(), MODEL_ACTIVE);
  cell.start_again();
  EXPECT_EQ(cell.geometric(), checksum_of(good));
}

TEST(KeptModels, ARollbackGoesBackOverARestartAndIsRefusedWhereNothingIsKnown) {
  KeptCell cell;
  cell.bring_up();
  EXPECT_EQ(cell.tell(MODEL_ROLLBACK).state(), MODEL_REFUSED);
  const auto first = write(cell.folder, "first.yaml", geometry(5e-5, 0.0));
  const auto second = write(cell.folder, "second.yaml", geometry(6e-5, 0.0));
  cell.use(first);
  ASSERT_EQ(cell.use(second, 7).state(), MODEL_ACTIVE);
  ASSERT_EQ(cell.tell(MODEL_COMMIT, {}, 7).state(), MODEL_ACTIVE);
  fs::remove(first);
  cell.start_again();
  EXPECT_EQ(cell.geometric(), checksum_of(second));
  EXPECT_EQ(cell.tell(MODEL_ROLLBACK).state(), MODEL_ACTIVE);
  const auto seal = cell.geometric();
  EXPECT_NE(seal, checksum_of(second));
  EXPECT_EQ(cell.tell(MODEL_ROLLBACK).state(), MODEL_REFUSED);
  EXPECT_EQ(cell.geometric(), seal) << "a refusal changes nothing";
  cell.start_again();
  EXPECT_EQ(cell.geometric(), seal);
  EXPECT_EQ(cell.tell(MODEL_ROLLBACK).state(), MODEL_REFUSED);
  EXPECT_EQ(cell.geometric(), seal);
}

TEST(KeptModels, WhatWasTakenOutStaysOutAndOnlyCopiesInUseAndBeforeStay) {
  KeptCell cell;
  cell.bring_up();
  const auto first = write(cell.folder, "first.yaml", geometry(5e-5, 0.0));
  const auto second = write(cell.folder, "second.yaml", geometry(6e-5, 0.0));
  cell.use(first);
  EXPECT_TRUE(fs::exists(cell.copy_of(first)));
  cell.use(second);
  EXPECT_TRUE(fs::exists(cell.copy_of(first)));  // a rollback goes back to it
  const auto third = write(cell.folder, "third.yaml", geometry(7e-5, 0.0));
  cell.use(third);
  EXPECT_FALSE(fs::exists(cell.copy_of(first)));
  EXPECT_TRUE(fs::exists(cell.copy_of(second)));
  EXPECT_TRUE(fs::exists(cell.copy_of(third)));
  EXPECT_EQ(cell.tell(MODEL_CLEAR).state(), MODEL_NONE);
  cell.parameters.model = second;  // the cell file's: for a folder that holds nothing yet
  cell.start_again();
  EXPECT_EQ(cell.status.latest()->state(), MODEL_NONE);
  EXPECT_EQ(cell.run_for(1.0).correction(), 0.0);
}

TEST(KeptModels, RefusesWhatIsDamagedOrOfAnotherMachineAndSaysSo) {
  KeptCell cell;
  cell.bring_up();
  const auto good = write(cell.folder, "good.yaml", geometry(5e-5, 0.0));
  const auto other = write(cell.folder, "other.yaml", geometry(6e-5, 0.0));
  cell.use(good);
  const fs::path copy = cell.copy_of(good);
  const fs::path list = fs::path{cell.parameters.state} / "models.yaml";
  const auto starts_without = [](KeptCell& again, const std::string& words) {
    EXPECT_EQ(again.status.latest()->state(), MODEL_NONE) << words;
    EXPECT_EQ(again.run_for(0.5).correction(), 0.0) << words;
    const std::string said = again.said();
    EXPECT_THAT(said, HasSubstr("the kept model is refused"));
    EXPECT_THAT(said, HasSubstr(words));
  };
  const auto refused = [&](const std::string& words) {
    cell.start_again();
    starts_without(cell, words);
  };
  const auto cut = [](const fs::path& file) { fs::resize_file(file, fs::file_size(file) / 2); };
  cut(copy);
  refused("geometric-");
  fs::copy_file(other, copy, fs::copy_options::overwrite_existing);
  refused("not the one that was kept");
  fs::remove(copy);
  refused("cannot be read");
  fs::copy_file(good, copy);
  cell.start_again();
  EXPECT_EQ(cell.geometric(), checksum_of(good));
  // The cell file's own model stands in.
  cell.parameters.model = other;
  cut(copy);
  cell.start_again();
  EXPECT_EQ(cell.geometric(), checksum_of(other));
  cell.parameters.model.clear();
  std::ofstream{list, std::ios::app} << "# edited\nchecksum: \"00000000\"\n";
  refused("models.yaml");
  std::ofstream{list} << "";
  refused("models.yaml");
  // Sound in itself, but kept of another machine.
  cell.use(good);
  KeptCell longer;
  longer.parameters.state = cell.parameters.state;
  std::ofstream{longer.folder.machine()}
      << "invar_machine: 1\nchain: [y, x]\ntravel: {x: [0, 0.3], y: [0, 0.2]}\n";
  longer.bring_up();
  longer.cycle_once();
  starts_without(longer, "of another machine: its axis x has another travel");
}

TEST(ModelLoader, WhatWasLoadedWhileTheComponentEndedIsNotStagedAtTheNextStart) {
  KeptCell cell;
  const auto model = write(cell.folder, "model.yaml", geometry(5e-5, 0.0));
  cell.bring_up(false);  // loading takes its time on a thread
  cell.tell(MODEL_STAGE, model);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  cell.start_again();
  EXPECT_EQ(cell.tell(MODEL_ACTIVATE).state(), MODEL_REFUSED);
  EXPECT_EQ(cell.geometric(), 0U);
}

TEST(KeptModels, AFolderThatCannotBeWrittenIsAFault) {
  KeptCell cell;
  std::ofstream{cell.parameters.state} << "a file, not a folder";
  cell.bring_up();
  cell.use(write(cell.folder, "good.yaml", geometry(5e-5, 0.0)));
  cell.cycle_once();
  EXPECT_THAT(cell.said(), HasSubstr("could not be written"));
}

}  // namespace
}  // namespace invar::compensation

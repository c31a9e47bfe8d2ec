#include "components/supervisor/supervisor.hpp"

#include <gmock/gmock.h>

namespace invar::supervisor {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A cell of a motion, a servo that needs it and a calibration that needs that; a step every 50 ms.
struct Cell {
  Supervisor::Parameters parameters;
  Supervisor supervisor{parameters};
  std::set<std::string> alive;
  std::map<std::string, CellView::Seen> components;
  std::vector<std::string> deactivated, told;
  std::int64_t cycle = 0;

  CellView view;

  Cell() {
    view.processes = {"motion", "jobs", "heat"};
    view.process_of = {
        {"world", "motion"}, {"stage", "motion"}, {"calibration", "jobs"}, {"thermal", "heat"}};
    view.dependents = {{"world", {"stage"}}, {"stage", {"calibration"}}};
    view.heard = [this] { return alive; };
    view.components = [this] { return components; };
    view.deactivate = [this](const std::string& component) {
      deactivated.push_back(component);
      return std::string{};
    };
    view.notify = [this](bool is_fault, const std::string&, const std::string& text) {
      told.push_back((is_fault ? "! " : "") + text);
    };
    supervisor.connect(view);
    step_once([this](const Tick&) { supervisor.activate(); });
  }
  template <class Do>
  void step_once(Do what) {
    const Tick tick{Instant{50'000'000 * cycle}, 0.05, static_cast<std::uint64_t>(cycle)};
    ++cycle;
    supervisor.set_now(tick.now);
    what(tick);
  }
  void run(double seconds) {
    for (int i = 0; i < seconds / 0.05; ++i) step_once([this](const Tick& tick) { supervisor.step(tick); });
  }
};

TEST(Supervisor, AProcessThatStartsIsNotLost) {
  Cell cell;
  cell.alive = {"jobs", "heat"};
  cell.run(29.0);  // motion takes its time
  EXPECT_THAT(cell.told, IsEmpty());
  cell.alive.insert("motion");
  cell.run(60.0);
  EXPECT_THAT(cell.told, IsEmpty());
  EXPECT_THAT(cell.deactivated, IsEmpty());
}

TEST(Supervisor, OneThatNeverCameIsSaid) {
  Cell cell;
  cell.alive = {"jobs", "heat"};
  cell.run(31.0);
  ASSERT_FALSE(cell.told.empty());
  EXPECT_THAT(cell.told.front(), HasSubstr("! process `motion` is lost: not heard of for 30 s"));
}

TEST(Supervisor, WhatNeedsALostProcessIsDeactivatedOnceAndItsReturnIsSaid) {
  Cell cell;
  cell.alive = {"motion", "jobs", "heat"};
  cell.run(5.0);
  cell.alive.erase("motion");
  cell.run(1.9);
  EXPECT_THAT(cell.told, IsEmpty());
  cell.run(10.0);
  EXPECT_THAT(cell.deactivated,
              ElementsAre("calibration"));  // stage went with its process; thermal needs nothing of it
  EXPECT_THAT(cell.told, ElementsAre(HasSubstr("! process `motion` is lost"),
                                     HasSubstr("`calibration` was deactivated")));
  cell.alive.insert("motion");
  cell.run(1.0);
  EXPECT_THAT(cell.told,
              ElementsAre(HasSubstr("lost"), HasSubstr("deactivated"), "process `motion` is back"));
}

TEST(Supervisor, OneThatWasStoppedItselfWaitsAnewForTheOthers) {
  Cell cell;
  cell.alive = {"motion", "jobs", "heat"};
  cell.run(5.0);
  // Ten seconds without a step, as by SIGSTOP: nothing of the others was read meanwhile, nor directly after.
  cell.cycle += 200;
  cell.alive.clear();
  cell.run(1.9);
  EXPECT_THAT(cell.told, ElementsAre(HasSubstr("the supervisor itself was stopped for 10")));
  EXPECT_THAT(cell.deactivated, IsEmpty());
  cell.alive = {"motion", "jobs", "heat"};
  cell.run(60.0);
  EXPECT_EQ(cell.told.size(), 1U);
  // One that is lost indeed is still found.
  cell.alive.erase("heat");
  cell.run(2.5);
  EXPECT_THAT(cell.told.back(), HasSubstr("! process `heat` is lost"));
}

TEST(Supervisor, AComponentInErrorTakesDownWhatNeedsItFurthestFirst) {
  Cell cell;
  cell.alive = {"motion", "jobs", "heat"};
  cell.components["world"] = {"no such machine", true};
  cell.run(1.0);
  EXPECT_THAT(cell.deactivated, ElementsAre("calibration", "stage"));
  EXPECT_THAT(cell.told.front(), HasSubstr("! component `world` is in error: no such machine"));
}

TEST(Supervisor, WhatItDeactivatedIsActiveAgainWhenAllThatItNeedsIsBack) {
  for (const bool held : {false, true}) {
    Cell cell;
    std::vector<std::string> activated;
    CellView view = cell.view;
    view.activate = [&](const std::string& component) {
      activated.push_back(component);
      return std::string{};
    };
    if (held) view.held = {"calibration"};
    cell.supervisor.connect(view);
    cell.components = {{"stage", {"", false, true}}, {"calibration", {"", false, true}}};
    cell.alive = {"motion", "jobs", "heat"};
    cell.run(5.0);
    cell.alive.erase("motion");
    cell.run(5.0);
    ASSERT_THAT(cell.deactivated, ElementsAre("calibration"));
    cell.components["calibration"].active = false;
    EXPECT_THAT(activated, IsEmpty());
    cell.components["stage"].active = false;  // it starts
    cell.alive.insert("motion");
    cell.run(1.0);
    EXPECT_THAT(activated, IsEmpty()) << "its stage is not active yet";
    cell.components["stage"].active = true;
    cell.run(1.0);
    if (held) {
      EXPECT_THAT(activated, IsEmpty());
      EXPECT_THAT(cell.told.back(), HasSubstr("`invar lifecycle CELL calibration activate`"));
    } else {
      EXPECT_THAT(activated, ElementsAre("calibration"));
      EXPECT_THAT(cell.told.back(), HasSubstr("is active again"));
    }
  }
}

}  // namespace
}  // namespace invar::supervisor

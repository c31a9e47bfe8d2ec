// Models that commands bring: each that is used no more is given back, and none that is used.
#include "core/component/model_loader.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "core/base/temporary_folder.hpp"

namespace invar {
namespace {

struct Model {
  Model() { ++alive; }
  ~Model() {
    payload = 0;
    --alive;
  }
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;
  std::uint64_t id = 0;
  std::string refusal;
  int payload = 42;
  static inline std::atomic<int> alive{0};
};

struct Owner : Component {
  void step(const Tick&) noexcept override {}
};

struct Loop {
  explicit Loop(bool simulated) {
    owner.simulated_time = simulated;
    loader.open();
  }
  /// The command's answer, which always comes.
  ModelLoader<Model>::Loaded loaded(const std::string& file) {
    EXPECT_TRUE(loader.request(++command, file));
    ModelLoader<Model>::Loaded answer;
    while (!loader.take(answer)) std::this_thread::sleep_for(std::chrono::microseconds(100));
    EXPECT_EQ(answer.command, command);
    return answer;
  }
  Owner owner;
  ModelLoader<Model> loader{owner, [](const std::filesystem::path&, Model&) {}};
  std::uint64_t command = 0;
};

class Loading : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Time, Loading, ::testing::Values(false, true),
                         [](const auto& simulated) { return simulated.param ? "Simulated" : "Real"; });

TEST_P(Loading, SixHundredModelsInTurnHoldNoMoreThanAFew) {
  {
    Loop loop{GetParam()};
    Model *active = nullptr, *before = nullptr;
    int most = 0;
    std::set<std::uint64_t> ids;
    for (int i = 0; i < 600; ++i) {
      Model* model = loop.loaded("a.yaml").model;
      EXPECT_TRUE(ids.insert(model->id).second) << "an id is used once";
      before = active;
      active = model;
      loop.loader.use({active, before});
      most = std::max(most, Model::alive.load());
      EXPECT_EQ(active->payload, 42);
      if (before != nullptr) {
        EXPECT_EQ(before->payload, 42);
      }
    }
    EXPECT_LE(most, 12);
    // A thread of its own looks every 5 ms.
    for (int i = 0; i < 1000 && !GetParam() && Model::alive > 2; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_LE(Model::alive, 3);
  }
  EXPECT_EQ(Model::alive, 0);
}

TEST_P(Loading, WhatTheLoopHasNotSpokenOfYetIsKept) {
  Loop loop{GetParam()};
  const auto first = loop.loaded("a.yaml");
  loop.loader.use({first.model});
  const auto second = loop.loaded("b.yaml");
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(second.model->payload, 42) << "taken, and not spoken of";
  loop.loader.close();
  EXPECT_EQ(Model::alive, 0);
  loop.loader.open();
  Model* named = loop.loader.load("c.yaml");
  const auto third = loop.loaded("d.yaml");
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(named->payload, 42) << "what was said before the restart is over";
  EXPECT_EQ(third.model->payload, 42);
}

TEST_P(Loading, AFileOutsideOfTheCellsFoldersIsRefusedAsOneThatIsNotThere) {
  const TemporaryFolder folder{"invar-test"};
  std::filesystem::create_directories(folder / "cell");
  std::ofstream{folder / "cell/a.yaml"} << "invar_model: 1\n";
  std::ofstream{folder / "secret.yaml"} << "invar_model: 1\n";
  Loop loop{GetParam()};
  loop.loader.close();
  loop.owner.folders =
      std::make_shared<CellFolders>(CellFolders::Places{folder / "cell"}, CellFolders::Places{});
  loop.loader.open();
  EXPECT_EQ(loop.loaded((folder / "cell/a.yaml").string()).model->refusal, "");
  const std::string outside = loop.loaded((folder / "secret.yaml").string()).model->refusal;
  const std::string nowhere = loop.loaded((folder / "nowhere.yaml").string()).model->refusal;
  EXPECT_EQ(outside, nowhere);
  EXPECT_EQ(outside, CellFolders::no_model);
  EXPECT_EQ(loop.loaded("/etc/passwd").model->refusal, outside);
}

}  // namespace
}  // namespace invar

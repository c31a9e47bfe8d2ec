// Bridge: into a secured cell, with the certificate and the rights that `invar keys` gives it.
#include <gmock/gmock.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <regex>
#include <thread>

#include "core/base/fault.hpp"
#include "idl/job.h"
#include "idl/stage.h"
#include "tests/support/temporary_folder.hpp"
#include "tests/unit/dds/domain.hpp"
#include "tools/cell/bridge.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/keys/key_ring.hpp"

namespace invar::tools {
namespace {

using dds::testing::eventually;

/// A cell with an axis and a job, its keys, and its bridge to a plant that has no certificates.
class SecuredBridge : public ::testing::Test {
 protected:
  static constexpr const char* bridged =
      "bridge:\n  domain: 232\n  out: [{port: stage_x.state, topic: line1/x, rate: 50}]\n"
      "  in: [{topic: line1/order, port: trial.job, rate: 50}]\nsecurity: {keys: keys}\n";

  SecuredBridge() {
    const std::filesystem::path source = std::filesystem::path{INVAR_SOURCE_DIR} / "tests/data/invalid/cell";
    std::filesystem::copy(source, folder.path(), std::filesystem::copy_options::recursive);
    std::ifstream stream{folder.path() / "bridge_of_nothing.yaml"};
    std::string text{std::istreambuf_iterator<char>{stream}, {}};
    text = std::regex_replace(text, std::regex{"bridge: .*\n"}, bridged);
    text = std::regex_replace(text, std::regex{"domain: 7\n"}, "domain: " + std::to_string(here) + "\n");
    std::ofstream{folder.path() / "cell.yaml"} << text;
    loaded = std::make_unique<LoadedCell>(load_cell(folder.path() / "cell.yaml"));
    KeyOrder order;
    order.folder = keys.path;
    (void)make_keys(*loaded, order);
  }
  [[nodiscard]] dds::NodeOptions member(const char* name) const {
    dds::NodeOptions options = dds::testing::local(name);
    options.domain = here;
    options.shared_memory = false;
    options.raw_by_general = true;
    options.identity = dds::Identity{keys, name, false};
    return options;
  }
  [[nodiscard]] dds::NodeOptions of_plant(const char* name) const {
    dds::NodeOptions options = dds::testing::local(name);
    options.domain = there;
    options.shared_memory = false;
    return options;
  }

  testing::TemporaryFolder folder;
  const dds::KeyFolder keys{folder.path() / "keys"};
  const std::uint32_t here = dds::testing::test_domain(), there = dds::testing::claim_domain();
  std::unique_ptr<LoadedCell> loaded;
  dds::Profiles profiles = dds::standard_profiles();
};

TEST_F(SecuredBridge, PassesItsLinesAndMayDoNothingElse) {
  dds::Node in_cell{member("bridge"), profiles}, motion{member("motion"), profiles},
      trials{member("trials"), profiles};
  dds::Node in_plant{of_plant("bridge-to-plant"), profiles}, plant{of_plant("mes"), profiles};
  Bridge bridge{read_bridge(*loaded), loaded->cell->id, in_cell, in_plant};
  std::atomic<bool> stopping{false};
  std::thread passing{[&] {
    while (!stopping) {
      bridge.pass();
      std::this_thread::sleep_for(std::chrono::milliseconds{2});
    }
  }};
  std::atomic<int> states{0}, orders{0};
  dds::Profile without_deadline = profiles.at("realtime");  // the bridge offers none
  without_deadline.deadline = {};
  const auto shown =
      plant.reader<stage::AxisState>("line1/x", without_deadline, [&](const stage::AxisState&) { ++states; });
  const auto worker = trials.reader<job::JobCommand>("cell/cell_a/trial/job", "command",
                                                     [&](const job::JobCommand&) { ++orders; });
  auto axis = motion.writer<stage::AxisState>("cell/cell_a/stage_x/state", "realtime");
  auto order = plant.writer<job::JobCommand>("line1/order", "command");
  stage::AxisState state;
  state.cell(loaded->cell->id);
  job::JobCommand command;
  command.cell(loaded->cell->id);
  command.name("move");
  EXPECT_TRUE(eventually([&] { return axis.write(state) && states > 0; })) << "out";
  EXPECT_TRUE(eventually([&] {
    command.id(command.id() + 1);
    return order.write(command) && orders > 0;
  })) << "in";
  stopping = true;
  passing.join();
  EXPECT_THROW((void)in_cell.raw_writer("cell/cell_a/stage_x/command", "invar::stage::AxisCommand",
                                        profiles.at("command")),
               InputError);
  EXPECT_THROW((void)in_cell.raw_reader("cell/cell_a/trial/status", "invar::job::JobStatus",
                                        profiles.at("state"), [](const dds::RawSample&) {}),
               InputError);
}

}  // namespace
}  // namespace invar::tools

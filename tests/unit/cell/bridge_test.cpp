// Bridge: between two domains with programs on both sides that do what they must not.
#include "tools/cell/bridge.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "core/base/clock.hpp"
#include "idl/job.h"
#include "idl/stage.h"
#include "tests/unit/dds/domain.hpp"

namespace invar::tools {
namespace {

using dds::testing::eventually;

/// The domain of the plant; the cell's is the program's own.
std::uint32_t plant_domain() {
  static const std::uint32_t claimed = dds::testing::claim_domain();
  return claimed;
}

dds::NodeOptions options(std::uint32_t domain, const char* process) {
  dds::NodeOptions options = dds::testing::local(process);
  options.domain = domain;
  options.shared_memory = false;
  return options;
}

/// A cell that shows the state of an axis and takes jobs, a plant, and the bridge between them.
class BetweenDomains : public ::testing::Test {
 protected:
  BetweenDomains() {
    file.lines = {
        {Direction::out, "cell/test/stage/state", "plant/state", "invar::stage::AxisState", "state", 20.0},
        {Direction::in, "cell/test/work/job", "plant/order", "invar::job::JobCommand", "command", 50.0}};
    bridge = std::make_unique<Bridge>(file, 7, in_cell, in_plant);
    passing = std::thread{[this] {
      while (!stopping) {
        bridge->pass();
        std::this_thread::sleep_for(std::chrono::milliseconds{2});
      }
    }};
  }
  ~BetweenDomains() override {
    stopping = true;
    passing.join();
  }
  static stage::AxisState state(double position, std::uint32_t cell = 7) {
    stage::AxisState sample;
    sample.cell(cell);
    sample.position(position);
    return sample;
  }
  static job::JobCommand order(std::uint64_t id, std::uint32_t cell = 7) {
    job::JobCommand sample;
    sample.cell(cell);
    sample.id(id);
    sample.name("print");
    return sample;
  }

  dds::Profiles profiles = dds::standard_profiles();
  const std::uint32_t here = dds::testing::test_domain(), there = plant_domain();
  dds::Node in_cell{options(here, "bridge"), profiles}, in_plant{options(there, "bridge"), profiles};
  dds::Node cell{options(here, "motion"), profiles}, plant{options(there, "plant"), profiles};
  BridgeFile file;
  std::unique_ptr<Bridge> bridge;
  std::atomic<bool> stopping{false};
  std::thread passing;
};

TEST_F(BetweenDomains, TheNewestStatePassesOutAtNoMoreThanItsRate) {
  std::atomic<int> came{0};
  std::atomic<double> last{0.0};
  const auto reader =
      plant.reader<stage::AxisState>("plant/state", "state", [&](const stage::AxisState& sample) {
        ++came;
        last = sample.position();
      });
  auto writer = cell.writer<stage::AxisState>("cell/test/stage/state", "state");
  ASSERT_TRUE(eventually([&] { return writer.write(state(-1.0)) && came > 0; }));
  const int before = came;
  const Instant begun = monotonic_now();
  for (int i = 1; i <= 1000; ++i) {
    (void)writer.write(state(i));
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
  EXPECT_TRUE(eventually([&] { return last == 1000.0; }))
      << "the newest came through though others were left out";
  const double seconds = (monotonic_now() - begun).in_seconds();
  EXPECT_LE(came - before, 20.0 * seconds + 2.0);
  EXPECT_GT(bridge->count(0).left_out, 500U);
}

TEST_F(BetweenDomains, NothingGoesAgainstItsDirection) {
  std::atomic<int> states{0}, orders{0}, sound{0};
  const auto in_the_cell = cell.reader<stage::AxisState>("cell/test/stage/state", "state",
                                                         [&](const stage::AxisState&) { ++states; });
  const auto in_the_plant =
      plant.reader<job::JobCommand>("plant/order", "command", [&](const job::JobCommand&) { ++orders; });
  const auto worker =
      cell.reader<job::JobCommand>("cell/test/work/job", "command", [&](const job::JobCommand&) { ++sound; });
  auto forged = plant.writer<stage::AxisState>("plant/state", "state");
  auto command = cell.writer<job::JobCommand>("cell/test/work/job", "command");
  auto order_of_plant = plant.writer<job::JobCommand>("plant/order", "command");
  std::uint64_t id = 0;
  ASSERT_TRUE(eventually([&] { return order_of_plant.write(order(++id)) && sound > 0; }))
      << "the bridge stands";
  ASSERT_TRUE(eventually([&] { return orders == static_cast<int>(id); }));
  const int orders_of_plant = orders;
  for (int i = 0; i < 100; ++i) {
    (void)forged.write(state(1.0));
    (void)command.write(order(1000 + static_cast<std::uint64_t>(i)));
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  EXPECT_EQ(states, 0) << "the plant forged the state of an axis";
  EXPECT_EQ(orders, orders_of_plant) << "what the cell orders itself stays in it";
}

TEST_F(BetweenDomains, OrdersOfAnotherCellAndNonsenseAreRefusedAndAFloodIsBounded) {
  std::atomic<int> taken{0}, foreign{0};
  const auto worker =
      cell.reader<job::JobCommand>("cell/test/work/job", "command", [&](const job::JobCommand& sample) {
        ++taken;
        if (sample.cell() != 7) ++foreign;
      });
  auto writer = plant.writer<job::JobCommand>("plant/order", "command");
  std::uint64_t id = 0;
  ASSERT_TRUE(eventually([&] { return writer.write(order(++id)) && taken > 0; }));
  for (int i = 0; i < 50; ++i) (void)writer.write(order(++id, 8));
  const auto raw = plant.raw_writer("plant/order", "invar::job::JobCommand", profiles.at("command"));
  const std::vector<std::byte> nonsense(200, std::byte{0xff});
  const std::span<const std::byte> bytes{nonsense};
  ASSERT_TRUE(eventually([&] {
    (void)raw->write(&bytes);
    return bridge->count(1).refused >= 51;
  })) << bridge->count(1).refused;
  const int before = taken;
  const Instant begun = monotonic_now();
  for (int i = 0; i < 3000; ++i) (void)writer.write(order(++id));
  std::this_thread::sleep_for(std::chrono::milliseconds{500});
  EXPECT_LE(taken - before, 50.0 * (monotonic_now() - begun).in_seconds() + 2.0);
  EXPECT_EQ(foreign, 0);
}

TEST_F(BetweenDomains, AnOrderThatWaitsLongerThanItsLifespanIsLeftOut) {
  BridgeFile slow;
  slow.lines = {
      {Direction::in, "cell/test/slow/job", "plant/slow", "invar::job::JobCommand", "command", 0.5}};
  Bridge passing_slowly{slow, 7, in_cell, in_plant};
  std::atomic<int> taken{0};
  const auto worker =
      cell.reader<job::JobCommand>("cell/test/slow/job", "command", [&](const job::JobCommand&) { ++taken; });
  auto writer = plant.writer<job::JobCommand>("plant/slow", "command");
  std::uint64_t id = 0;
  ASSERT_TRUE(eventually([&] {
    if (taken == 0 && passing_slowly.count(0).came == 0) (void)writer.write(order(++id));
    passing_slowly.pass();
    return taken > 0;
  }));
  for (int i = 0; i < 5; ++i) (void)writer.write(order(++id));
  const Instant until = monotonic_now() + Duration::seconds(3.0);
  while (monotonic_now() < until) {
    passing_slowly.pass();
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  EXPECT_LE(taken, 2) << "the next turn came two seconds later, and orders live for one";
  EXPECT_GE(passing_slowly.count(0).left_out, 4U);
}

}  // namespace
}  // namespace invar::tools

#include "core/executor/dependency.hpp"

#include <gmock/gmock.h>

namespace invar {
namespace {

using ::testing::ElementsAre;

struct Node final : Component {
  explicit Node(std::string n) { name = std::move(n); }
  Input<int> in{*this, "in"};
  Input<int> feedback{*this, "feedback"};
  Output<int> out{*this, "out"};
  void step(const Tick&) noexcept override {}
};

TEST(Dependency, WhoFeedsStandsBeforeWhoIsFed) {
  Node driver{"driver"}, servo{"servo"}, fusion{"fusion"}, encoder{"encoder"};
  encoder.out.connect(fusion.in);
  fusion.out.topic = servo.in.topic = "cell/a/fusion/out";  // joined by name only
  servo.out.connect(driver.in);
  EXPECT_THAT(upstream_first({&driver, &servo, &fusion, &encoder}), ElementsAre(3U, 2U, 1U, 0U));
}

TEST(Dependency, TheGivenOrderDecidesWhereNothingElseDoes) {
  Node a{"a"}, b{"b"}, c{"c"};
  EXPECT_THAT(upstream_first({&a, &b, &c}), ElementsAre(0U, 1U, 2U));
}

TEST(Dependency, AControlLoopIsOpenedWhereTheGivenOrderBegins) {
  Node world{"world"}, stage{"stage"}, watcher{"watcher"};
  world.out.connect(stage.in);
  stage.out.connect(world.feedback);
  stage.out.connect(watcher.in);
  EXPECT_THAT(upstream_first({&watcher, &world, &stage}), ElementsAre(1U, 2U, 0U));
  EXPECT_THAT(upstream_first({&stage, &world, &watcher}), ElementsAre(0U, 1U, 2U));
}

}  // namespace
}  // namespace invar

// After Ctrl-C a command ends by itself, or is ended.
#include "tools/live/patience.hpp"

#include <gtest/gtest.h>
#include <signal.h>

#include <cstdlib>

#include "tools/live/interrupt.hpp"

namespace invar::tools {
namespace {

using std::chrono::milliseconds;

/// Told to stop by Ctrl-C; then works on for so long, which a search that is stuck in one step does.
void work_on(milliseconds patience, milliseconds more) {
  (void)interrupted();
  {
    const Patience held{"nothing to say yet", patience};
    raise(SIGINT);
    std::this_thread::sleep_for(more);
  }
  std::_Exit(7);
}

TEST(Patience, EndsWhatDoesNotEndByItself) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(work_on(milliseconds{20}, milliseconds{600'000}), ::testing::ExitedWithCode(130),
              "nothing to say yet");
}

TEST(Patience, LeavesAloneWhatEndsInTime) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(work_on(milliseconds{600'000}, milliseconds{0}), ::testing::ExitedWithCode(7), "^$");
}

TEST(Patience, WaitsForCtrlC) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto undisturbed = [] {
    (void)interrupted();
    {
      const Patience held{"nothing to say yet", milliseconds{5}};
      std::this_thread::sleep_for(milliseconds{60});
    }
    std::_Exit(7);
  };
  EXPECT_EXIT(undisturbed(), ::testing::ExitedWithCode(7), "^$");
}

}  // namespace
}  // namespace invar::tools

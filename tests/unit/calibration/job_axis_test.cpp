// The rule by which a job enables its axes, against an axis that the test lets answer, refuse, trip or keep silent.
#include "components/calibration/job_axis.hpp"

#include <gmock/gmock.h>

#include <stdexcept>

namespace invar::calibration {
namespace {

using ::testing::HasSubstr;

struct Device final : Component {
  Output<stage::AxisState> state{*this, "state"};
  Inbox<stage::AxisCommand> command{*this, "command"};
  void step(const Tick&) noexcept override {}
};
struct Runner final : Component {
  std::int64_t number = 1;
  JobAxis axis{*this, number, "state", "command"};
  void step(const Tick&) noexcept override {}
};

enum class Answer { silent, refuses, enables, trips };

/// A job that enables one axis; a step each 10 ms.
struct Enabling {
  Device device;
  Runner runner;
  std::uint64_t id = 0;
  int asked = 0;
  double passed = 0.0;  // s

  Enabling() {
    device.state.connect(*static_cast<InputPort*>(runner.find_port("state")));
    static_cast<OutputPort*>(runner.find_port("command"))->connect(device.command);
  }
  void answer(const Answer how) {
    stage::AxisCommand command;
    stage::AxisState state;
    const bool fresh = device.command.take(command);
    if (fresh) {
      ++asked;
      EXPECT_EQ(command.kind(), stage::AXIS_COMMAND_ENABLE);
      EXPECT_EQ(command.axis(), 1U);
      state.command_id(command.id());
    }
    if (!fresh || how == Answer::silent) return;
    state.command_refused(how != Answer::enables);
    state.enabled(how == Answer::enables);
    state.mode(how == Answer::trips     ? stage::AXIS_MODE_FAULT
               : how == Answer::enables ? stage::AXIS_MODE_HOLDING
                                        : stage::AXIS_MODE_MOVING);
    device.state.write(state);
  }
  /// Answers `first` for as long [s], then `then`; what the job failed with, or "".
  std::string run(Answer first, double as_long, Answer then) {
    std::vector<JobAxis*> axes{&runner.axis};
    job::Task task = enable_axes(
        axes, [this] { return ++id; }, Duration::seconds(10.0));
    Instant now;
    try {
      while (task.running()) {
        runner.set_now(now);
        device.set_now(now);
        task.resume();
        answer(passed < as_long ? first : then);
        now = now + Duration::milliseconds(10);
        passed += 0.01;
        if (passed > 60.0) return "goes on for ever";
      }
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
};

TEST(EnableAxes, AsksOnceWhereTheAxisAnswers) {
  Enabling job;
  EXPECT_EQ(job.run(Answer::enables, 1.0, Answer::enables), "");
  EXPECT_EQ(job.asked, 1);
  EXPECT_LT(job.passed, 0.1);
}

TEST(EnableAxes, NeverAsksAnAxisAgainThatTripped) {
  Enabling job;
  EXPECT_THAT(job.run(Answer::trips, 20.0, Answer::trips), HasSubstr("axis y tripped before the job: mend"));
  EXPECT_EQ(job.asked, 1);
  EXPECT_LT(job.passed, 0.1);
  Enabling late;  // trips as it is enabled at last
  EXPECT_THAT(late.run(Answer::refuses, 3.0, Answer::trips),
              HasSubstr("axis y tripped before the job: mend"));
  EXPECT_EQ(late.asked, 3);
}

TEST(EnableAxes, AsksAnAxisThatRefusesSeldomAndGivesUp) {
  Enabling job;
  EXPECT_THAT(job.run(Answer::refuses, 20.0, Answer::refuses), HasSubstr("axis y does not take `enable`"));
  EXPECT_EQ(job.asked, 6);  // at 0, 2, 4, 6, 8 and 10 s: each is a notice
  Enabling late;
  EXPECT_EQ(late.run(Answer::refuses, 3.0, Answer::enables), "");
  EXPECT_EQ(late.asked, 3);
}

TEST(EnableAxes, WaitsForAStageThatComesUpLaterAndGivesUp) {
  Enabling job;
  EXPECT_EQ(job.run(Answer::silent, 3.2, Answer::enables), "");
  EXPECT_LT(job.passed, 3.7);
  Enabling never;
  EXPECT_THAT(never.run(Answer::silent, 20.0, Answer::silent), HasSubstr("nothing is heard from axis y"));
  EXPECT_NEAR(never.passed, 10.0, 0.1);
}

}  // namespace
}  // namespace invar::calibration

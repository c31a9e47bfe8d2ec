#include "tools/cell/notice_log.hpp"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <sstream>

namespace invar::tools {
namespace {

/// The lines of the log while this lives, without time and level.
class Lines {
 public:
  Lines() {
    auto logger =
        std::make_shared<spdlog::logger>("lines", std::make_shared<spdlog::sinks::ostream_sink_mt>(text_));
    logger->set_pattern("%v");
    spdlog::set_default_logger(logger);
  }
  ~Lines() { spdlog::set_default_logger(before_); }
  Lines(const Lines&) = delete;
  Lines& operator=(const Lines&) = delete;
  [[nodiscard]] std::string text() const { return text_.str(); }

 private:
  std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
  std::ostringstream text_;
};

event::Notice fault(const std::string& source, const std::string& text) {
  event::Notice notice;
  notice.level(event::SEVERITY_FAULT);
  notice.source(source);
  notice.text(text);
  return notice;
}

TEST(NoticeLog, TellsATextOnceAndHowOftenItWasSaidAgainAlsoWhereItIsNeverSaidLater) {
  const Lines lines;
  NoticeLog log{false};
  for (int i = 0; i < 4; ++i) log.write(fault("motion", "no link"));
  log.write(fault("heat", "no link"));
  log.write_waiting();
  EXPECT_EQ(lines.text(), "motion: no link\nheat: no link\n");
  log.write_last();
  log.write_last();
  EXPECT_EQ(lines.text(),
            "motion: no link\nheat: no link\nmotion: no link (3 times more since the last line)\n");
}

}  // namespace
}  // namespace invar::tools

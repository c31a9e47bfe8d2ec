// Tables that fit the terminal: wrapped, never cut.
#include "tools/live/text_table.hpp"

#include <gmock/gmock.h>

#include <sstream>

namespace invar::tools {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

std::vector<std::string> lines_of(const TextTable& table, std::size_t width) {
  std::ostringstream out;
  table.print(out, width);
  std::vector<std::string> lines;
  std::istringstream in{out.str()};
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

TEST(TextTable, IsAsWideAsItsCellsWhereTheyFit) {
  TextTable table{{"name", "steps>"}};
  table.add({"stage_x", "12"});
  EXPECT_THAT(lines_of(table, 80), ElementsAre("name     steps", "stage_x     12"));
}

TEST(TextTable, WrapsTextsAndLosesNothing) {
  TextTable table{{"a topic", "rate [Hz]>", "what"}};
  const std::string topic = "cell/with_a_very_long_name/component_of_the_second_line/an_output_port";
  const std::string text = "one two three four five six seven eight nine ten eleven twelve thirteen";
  table.add({topic, "1234567890", text});
  for (const std::size_t width : {40U, 60U, 80U}) {
    std::string left, right;
    for (const std::string& line : lines_of(table, width)) {
      EXPECT_LE(line.size(), width);
      right += line;
    }
    for (const char c : right)
      if (c != ' ') left += c;
    for (const char* word : {"thirteen", "1234567890", "rate"})
      EXPECT_NE(left.find(word), std::string::npos) << left;
  }
  EXPECT_THAT(lines_of(table, 1000), SizeIs(2));
}

TEST(Wrapped, BreaksAtSpacesThenBehindSignsThenAnywhere) {
  EXPECT_THAT(wrapped("one two three", 8), ElementsAre("one two", "three"));
  EXPECT_THAT(wrapped("cell/name/port", 10), ElementsAre("cell/name/", "port"));
  EXPECT_THAT(wrapped("abcdefghij", 4), ElementsAre("abcd", "efgh", "ij"));
  EXPECT_THAT(wrapped("", 4), ElementsAre(""));
}

}  // namespace
}  // namespace invar::tools

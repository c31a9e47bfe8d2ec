// Readings as people have them: Renishaw's .rtl, deviations, preambles, decimal commas, no column of directions; one axis.
#include "tools/geometric/positioning.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "core/base/fault.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tools/geometric/lines_file.hpp"
#include "tools/geometric/rotary_readings.hpp"
#include "tools/geometric/rtl_file.hpp"
#include "tools/geometric/sense_of_motion.hpp"

namespace invar::tools {
namespace {

using metrology::Iso230Figure;

metrology::Machine one_axis() {
  metrology::Machine machine;
  machine.chain = {{0, 1, 2}, 1};
  machine.travel[0] = {0.0, 0.1};
  return machine;
}

/// Deviation in um at target i (of 0, 20, 40 mm) in cycle j: a slope of 2 um a target, 3 um of reversal, cycles half a um apart.
double deviation(int i, int j, int way) { return 2.0 * i + 1.5 * way + 0.5 * j; }

std::string rtl(const std::string& kind, const std::string& axis) {
  std::ostringstream text;
  text << "HEADER::\r\nFile Type: " << kind
       << "\r\n\r\nTARGET DATA::\r\nTarget-count: 3\r\nTargets :\r\n0 20\r\n40\r\n"
       << "\r\nUSER-TEXT::\r\nAxis: " << axis
       << "\r\n\r\nRUNS::\r\nRun-count: 4\r\n\r\nDEVIATIONS::\r\nRun Target Data:\r\n";
  for (int run = 0; run < 4; ++run)
    for (int step = 0; step < 3; ++step) {
      const int way = run % 2 == 0 ? 1 : -1;
      const int i = way > 0 ? step : 2 - step;
      text << "  " << run + 1 << " " << i + 1 << " " << deviation(i, run / 2, way) << "\r\n";
    }
  return text.str() + "\r\nENVIRONMENT::\r\nAir temp: 20.1\r\n";
}

/// The same as lines.csv of people: a preamble, semicolons, decimal commas, no direction.
std::string csv(const std::string& column) {
  std::ostringstream text;
  text << "Machine: 4711\nOperator; A. B.\n\nline;x [mm];" << column << " ["
       << (column == "deviation" ? "um" : "mm") << "]\n";
  const double first = deviation(0, 0, 1);
  for (int run = 0; run < 4; ++run)
    for (int step = 0; step < 3; ++step) {
      const int way = run % 2 == 0 ? 1 : -1;
      const int i = way > 0 ? step : 2 - step;
      const double off = deviation(i, run / 2, way) - (column == "deviation" ? 0.0 : first);
      const double value = column == "deviation" ? off : 20.0 * i + 1e-3 * off;
      std::string cell = std::to_string(value);
      cell.replace(cell.find('.'), 1, ",");
      text << "X;" << 20 * i << ",0;" << cell << "\n";
    }
  return text.str();
}

class Positioning : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    std::ofstream{folder / name} << text;
    return folder / name;
  }
  void expect_figures(const LinesFile& input, bool absolute) {
    ASSERT_EQ(input.lines.size(), 1U);
    const auto test = test_of(input.lines.front(), {});
    ASSERT_TRUE(test);
    EXPECT_EQ(test->axis, "X");
    EXPECT_EQ(test->cycles, 2);
    EXPECT_NEAR(test->figures[Iso230Figure::B], 3e-6, 1e-12);
    EXPECT_NEAR(test->figures[Iso230Figure::M], 4e-6, 1e-12);
    EXPECT_NEAR(test->figures[Iso230Figure::E], 7e-6, 1e-12);
    EXPECT_NEAR(test->figures[Iso230Figure::R_forward], 4e-6 * 0.5 / std::sqrt(2.0), 1e-12);
    if (absolute) {
      EXPECT_NEAR(test->figures.targets[0].mean_forward, 1.75e-6, 1e-12);
    }
  }
  invar::testing::TemporaryFolder folder;
};

TEST_F(Positioning, ARtlFileGivesItsFigures) {
  expect_figures(read_lines(write("axis.rtl", rtl("linear", "X")), one_axis()), true);
}

TEST_F(Positioning, DeviationsWithAPreambleAndDecimalCommasGiveTheSame) {
  expect_figures(read_lines(write("deviations.csv", csv("deviation")), one_axis()), true);
}

TEST_F(Positioning, DirectionsThatNoColumnTellsAreThoseOfTheMotion) {
  const auto input = read_lines(write("lines.csv", csv("displacement")), one_axis());
  EXPECT_FALSE(input.tells_direction);
  expect_figures(input, false);
}

TEST(SenseOfMotion, IsThatOfTheStepAndAfterAReturnThatOfTheNextPass) {
  EXPECT_EQ(senses_of_motion({0, 1, 2, 2, 1, 0, 0}), (std::vector<int>{1, 1, 1, -1, -1, -1, 1}));
  EXPECT_EQ(senses_of_motion({0, 1, 2, 3, 0, 1, 2, 3}), (std::vector<int>{1, 1, 1, 1, 1, 1, 1, 1}));
  EXPECT_EQ(senses_of_motion({3, 2, 1, 0, 3, 2, 1, 0}), (std::vector<int>{-1, -1, -1, -1, -1, -1, -1, -1}));
  EXPECT_EQ(senses_of_motion({0, 1, 0, 1}), (std::vector<int>{1, 1, -1, 1}));  // two targets: no return
  EXPECT_TRUE(senses_of_motion({}).empty());
  EXPECT_EQ(senses_of_motion({5}), (std::vector<int>{1}));
}

TEST_F(Positioning, ARotaryRtlFileIsInAnglesAndNoLine) {
  const auto file = write("axis.rtl", rtl("rotary", "C"));
  const RtlFile found = load_rtl(file);
  EXPECT_TRUE(found.rotary);
  EXPECT_NEAR(found.targets[1], 20.0 * 3.14159265358979 / 180.0, 1e-12);
  const auto test = test_of("C", targets_of(read_rotary_readings(file, "c").readings), {});
  ASSERT_TRUE(test);
  EXPECT_NEAR(test->figures[Iso230Figure::B], 3.0 * 4.84813681109536e-6, 1e-12);
  EXPECT_THROW(read_lines(file, one_axis()), InputError);
}

TEST_F(Positioning, ABrokenRtlFileIsOneLineWithItsPlace) {
  std::string text = rtl("linear", "X");
  text.replace(text.find("  2 3 "), 6, "  2 9 ");
  const auto file = write("axis.rtl", text);
  try {
    (void)read_lines(file, one_axis());
    FAIL();
  } catch (const InputError& error) {
    const std::string words = error.what();
    EXPECT_NE(words.find("axis.rtl:"), std::string::npos) << words;
    EXPECT_NE(words.find("names a target that is not there"), std::string::npos) << words;
  }
  EXPECT_THROW(read_lines(write("y.rtl", rtl("linear", "Y")), one_axis()), InputError);
}

TEST_F(Positioning, ATolerancePassesOrFailsOnlyBeyondTheUncertainty) {
  const auto input = read_lines(write("axis.rtl", rtl("linear", "X")), one_axis());
  const auto test = *test_of(input.lines.front(), {0.0, 0.5e-6});
  const double doubt = test.figures.uncertainty[static_cast<std::size_t>(Iso230Figure::B)];
  EXPECT_GT(doubt, 1e-6);
  const auto verdict = [&](double limit) { return verdict_of(test, {Iso230Figure::B, limit}); };
  EXPECT_EQ(verdict(3e-6 + 1.01 * doubt), Verdict::within);
  EXPECT_EQ(verdict(3e-6 + 0.5 * doubt), Verdict::open);
  EXPECT_EQ(verdict(3e-6 - 0.5 * doubt), Verdict::open);
  EXPECT_EQ(verdict(3e-6 - 1.01 * doubt), Verdict::beyond);
  const auto tolerances = read_tolerances({"A=10 um", "R_forward=4e-6"}, false);
  EXPECT_NEAR(tolerances[0].limit, 10e-6, 1e-18);
  EXPECT_EQ(tolerances[1].figure, Iso230Figure::R_forward);
  EXPECT_NEAR(read_tolerances({"E=8 arcsec"}, true)[0].limit, 8 * 4.84813681109536e-6, 1e-12);
  for (const char* bad : {"Q=1 um", "A=1 kg", "A=-1 um", "A", "A=x"})
    EXPECT_THROW(read_tolerances({bad}, false), InputError) << bad;
}

}  // namespace
}  // namespace invar::tools

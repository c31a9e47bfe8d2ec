#include "core/recording/table.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <thread>

namespace invar::recording {
namespace {

using ::testing::HasSubstr;

class TableTest : public ::testing::Test {
 protected:
  std::filesystem::path make(const std::string& text) const {
    std::ofstream{folder / "in.csv"} << text;
    return folder / "in.csv";
  }
  static std::string fault_of(const std::filesystem::path& file) {
    return invar::testing::fault_of([&] { Table::read(file); });
  }
  invar::testing::TemporaryFolder folder;
};

TEST_F(TableTest, ReadsUnitsEmptyCellsAndTextColumns) {
  const auto table = Table::read(make("line,x [mm],t [s]\nA,1.5,0\nB,,1e-3\n"), {"line"});
  EXPECT_EQ(table.rows(), 2U);
  EXPECT_EQ(table.find("line")->texts[1], "B");
  EXPECT_DOUBLE_EQ(table.in("x", "m")[0], 1.5e-3);
  EXPECT_TRUE(std::isnan(table.in("x", "m")[1]));
  EXPECT_FALSE(table.optionally_in("missing", "m").has_value());
}

TEST_F(TableTest, TellsAnIndexInANameFromAUnit) {
  const auto table = Table::read(make("volts[0] [V],grid[1][2],ratio [1],x[mm]\n1,2,3,4\n"));
  EXPECT_EQ(table.columns[0].name, "volts[0]");
  EXPECT_EQ(table.columns[0].unit, "V");
  EXPECT_EQ(table.columns[1].name, "grid[1][2]");
  EXPECT_EQ(table.columns[1].unit, "");
  EXPECT_EQ(table.columns[2].unit, "1");
  EXPECT_EQ(table.columns[3].unit, "mm");
}

TEST_F(TableTest, WritesWhatItReadsBackExactly) {
  Table table;
  table.add("x", "m", {0.1, 1.0 / 3.0, -2e-300});
  for (const char* name : {"out.csv", "out.csv.gz"}) {
    table.write(folder / name);
    EXPECT_EQ(Table::read(folder / name).in("x", "m"), table.columns[0].values);
  }
}

TEST_F(TableTest, ReadsALongFileLineByLineAcrossItsBlocks) {
  Table table;
  std::vector<double> x, y;
  for (int i = 0; i < 60000; ++i) x.push_back(i), y.push_back(std::sin(i) * std::pow(10.0, i % 17 - 8));
  table.add("x", "1", x);
  table.add("y", "m", y);
  for (const char* name : {"long.csv", "long.csv.gz"}) {
    table.write(folder / name);
    const auto read = Table::read(folder / name);
    EXPECT_EQ(read.columns[0].values, x) << name;
    EXPECT_EQ(read.columns[1].values, y) << name;
  }
  EXPECT_EQ(Table::read(make("\xEF\xBB\xBFx [m]\r\n1\r\n\r\n2")).columns[0].values,
            (std::vector<double>{1.0, 2.0}));
  EXPECT_THAT(fault_of(make(std::string(300000, '\n') + "x,y\n1,2\n3\n")),
              HasSubstr("in.csv:300003: this row has 1"));
  EXPECT_THAT(fault_of(make("x\n1\n" + std::string(1, '\0') + "\n")), HasSubstr("is not a text file"));
}

TEST_F(TableTest, SaysOfAPackedFileThatItIsCutOffRatherThanWhatItsLastLineLacks) {
  Table table;
  std::vector<double> x;
  for (int i = 0; i < 100000; ++i) x.push_back(std::sin(i));
  table.add("x", "m", x);
  table.add("y", "m", x);
  table.write(folder / "whole.csv.gz");
  for (const double share : {0.2, 0.7, 0.999}) {
    std::filesystem::copy_file(folder / "whole.csv.gz", folder / "cut.csv.gz",
                               std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(
        folder / "cut.csv.gz",
        static_cast<std::uintmax_t>(share *
                                    static_cast<double>(std::filesystem::file_size(folder / "cut.csv.gz"))));
    EXPECT_THAT(fault_of(folder / "cut.csv.gz"), HasSubstr("cut.csv.gz: is cut off")) << share;
  }
}

TEST_F(TableTest, NamesLineColumnAndMendOfEachFault) {
  EXPECT_THAT(fault_of(make("x [m],y [m]\n1,2\n3\n")), HasSubstr("in.csv:3: this row has 1 cells"));
  EXPECT_THAT(fault_of(make("x [m]\n1\nabc\n")), HasSubstr("in.csv:3: column `x`: `abc` is not a number"));
  EXPECT_THAT(fault_of(make("x [m]\n1\n" + std::string(400, '9') + "\n")),
              HasSubstr("`" + std::string(20, '9') + "...` is not a number"));
  EXPECT_THAT(fault_of(make("x,x\n1,2\n")), HasSubstr("stands twice"));
  EXPECT_THAT(fault_of(make("x [m]\n")), HasSubstr("no rows"));
  EXPECT_THAT(fault_of(make("")), HasSubstr("is empty"));
  EXPECT_THAT(fault_of(make("x [m],y [m]\r1,2\r3,4\r")),
              HasSubstr("in.csv:1: the lines end in a carriage return"));
  EXPECT_EQ(fault_of(make("x [m],y [m]\r\n1,2\r\n")), "accepted");
  EXPECT_THAT(fault_of(folder / "none.csv"), HasSubstr("cannot be read"));
}

TEST_F(TableTest, ReadsAPipeAndDoesNotWaitForOneIntoWhichNobodyWrites) {
  const auto pipe = folder / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::thread writer{[&] { std::ofstream{pipe} << "x [m]\n1\n2\n"; }};
  EXPECT_EQ(Table::read(pipe).rows(), 2U);
  writer.join();
  EXPECT_THAT(fault_of(pipe), HasSubstr("pipe: is a pipe into which nobody has written"));
}

TEST_F(TableTest, SaysWhichColumnIsMissingOrMeasuresSomethingElse) {
  const auto table = Table::read(make("x [s]\n1\n"));
  EXPECT_THROW((void)table.in("y", "m"), InputError);
  EXPECT_THROW((void)table.in("x", "m"), InputError);
}

TEST_F(TableTest, AUnitThatNobodyKnowsIsAFaultOnlyWhereAUnitIsAskedFor) {
  const auto table = Table::read(make("x [furlong]\n1\n"));
  EXPECT_EQ(table.find("x")->unit, "furlong");
  try {
    (void)table.in("x", "m");
    ADD_FAILURE() << "no fault";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("`furlong` is no unit"));
  }
}

}  // namespace
}  // namespace invar::recording

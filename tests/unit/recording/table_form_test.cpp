// One table in each form in which loggers write it: the same numbers come out, or one clear line says why none do.
#include "core/recording/table.hpp"
#include "core/recording/time_stamp.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <functional>

namespace invar::recording {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pointwise;

class TableForm : public ::testing::Test {
 protected:
  TableForm() {
    for (int i = 0; i < 120; ++i) {
      time.push_back(2.4 + 3.0 * i);
      heat.push_back(std::round(4.0 * (27.0 + 200.0 * (1.0 - std::exp(-0.01 * i)))) / 4.0);
      power.push_back(i < 90 ? 40.0 : 0.0);
    }
  }
  [[nodiscard]] std::filesystem::path make(const std::string& text) const {
    std::ofstream{folder / "in.csv"} << text;
    return folder / "in.csv";
  }
  using Cell = std::function<std::string(double)>;
  static std::string point(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.10g", value);
    return text;
  }
  static std::string comma(double value) {
    auto text = point(value);
    std::replace(text.begin(), text.end(), '.', ',');
    return text;
  }
  /// The rows below what stands before them; the time as `stamp` says.
  [[nodiscard]] std::string rows(const std::string& before, const std::string& separator, const Cell& number,
                                 const Cell& stamp, const std::string& after = "") const {
    std::string text = before;
    for (std::size_t i = 0; i < time.size(); ++i)
      text += stamp(time[i]) + separator + number(heat[i]) + separator + number(power[i]) + after + "\n";
    return text;
  }
  void expect_same(const std::string& text, const std::vector<std::string>& names,
                   double origin = 0.0) const {
    const auto table = Table::read_columns(make(text), names);
    const auto head = text.substr(0, 60);
    ASSERT_EQ(table.rows(), time.size()) << head;
    ASSERT_NE(table.find(names[0]), nullptr) << head;
    ASSERT_NE(table.find(names[2]), nullptr) << head;
    auto from = time;
    for (double& t : from) t -= origin;
    EXPECT_THAT(table.in(names[0], "s"), Pointwise(DoubleNear(1e-9), from)) << head;
    EXPECT_EQ(table.in(names[1], "degC"), heat) << head;
    EXPECT_EQ(table.in(names[2], "W"), power) << head;
  }
  [[nodiscard]] std::string fault_of(const std::string& text,
                                     std::vector<std::string> wanted = {"a", "b"}) const {
    const auto file = make(text);
    return invar::testing::fault_of([&] { Table::read_columns(file, wanted); });
  }
  /// 09:00:00 and these seconds.
  static std::string clock(double seconds, const char* form) {
    const int whole = static_cast<int>(seconds),
              ms = static_cast<int>(std::lround(1000.0 * (seconds - whole)));
    char text[64];
    std::snprintf(text, sizeof text, form, 9 + whole / 3600, whole / 60 % 60, whole % 60, ms);
    return text;
  }
  invar::testing::TemporaryFolder folder;
  std::vector<double> time, heat, power;
};

TEST_F(TableForm, SeparatorsAndDecimalMarksAreFound) {
  const std::vector<std::string> names{"t", "T", "P"};
  for (const std::string separator : {",", ";", "\t", "|", "  "}) {
    const auto header = "t [s]" + separator + "T [degC]" + separator + "P [W]\n";
    expect_same(rows(header, separator, point, point), names);
    if (separator != ",") expect_same(rows(header, separator, comma, comma), names);
  }
  const auto quoted = [](double value) { return '"' + comma(value) + '"'; };
  expect_same(rows("t [s],T [degC],P [W]\n", ",", quoted, quoted), names);
  expect_same(rows("t [s];T [degC];P [W];\r\n", ";", comma, comma, ";\r"), names);
}

TEST_F(TableForm, HeadersUnitsAndComments) {
  const std::vector<std::string> names{"t", "T", "P"};
  expect_same(rows("t (s),T (C),P (W)\n", ",", point, point), names);
  expect_same(rows("t (s),T (C),P (W)\n", ",", point, point), {"t (s)", "T (C)", "P (W)"});
  expect_same(rows("t,T,P\ns,degC,W\n", ",", point, point), names);
  expect_same(rows("# by me\n% of today\n// a third\nt [s],T [degC],P [W]\n", ",", point, point), names);
  expect_same(rows("# by me\n# t [s], T [degC], P [W]\n", ", ", point, point), names);
  expect_same(rows("# t T P\n", " ", point, point), names);
  expect_same(rows("", ",", point, point), {"1", "2", "3"});
  expect_same(rows("", ";", comma, comma), {"1", "2", "3"});
  expect_same(rows("# no header at all\n", " ", point, point), {"1", "2", "3"});
  const auto table =
      Table::read_columns(make("axis (left),n (2),F (N)\n1,2,3\n"), {"axis (left)", "n (2)", "F"});
  EXPECT_EQ(table.find("F")->unit, "N");
  EXPECT_EQ(table.find("n (2)")->unit, "");
}

TEST_F(TableForm, TimesAreSecondsSinceTheFirst) {
  const std::vector<std::string> names{"t", "T", "P"};
  const std::string header = "t,T [degC],P [W]\n";
  for (const char* form :
       {"2024-03-01T%02d:%02d:%02d.%03d", "2024-03-01 %02d:%02d:%02d.%03dZ", "2024/03/01-%02d:%02d:%02d.%03d",
        "01.03.2024 %02d:%02d:%02d.%03d", "2024-03-01T%02d:%02d:%02d.%03d+01:00", "%02d:%02d:%02d.%03d",
        "03/04/2024 %02d:%02d:%02d.%03d"})
    expect_same(rows(header, ",", point, [&](double t) { return clock(t, form); }), names, time[0]);
  expect_same(rows("t;T [degC];P [W]\n", ";", comma,
                   [](double t) { return clock(t, "2024-03-01T%02d:%02d:%02d,%03d"); }),
              names, time[0]);
  expect_same(rows("", ",", point, [](double t) { return clock(t, "2024-03-01T%02d:%02d:%02d.%03d"); }),
              {"1", "2", "3"}, time[0]);
  const auto over = Table::read_columns(make("t,x\n23:59:58,1\n00:00:01,2\n"), {"t"});
  EXPECT_THAT(over.in("t", "s"), ElementsAre(0.0, 3.0));
  const auto day =
      Table::read_columns(make("t,x\n2024-02-28T23:00:00,1\n2024-03-01T00:30:00+01:00,2\n"), {"t"});
  EXPECT_THAT(day.in("t", "s"), ElementsAre(0.0, 86400.0 + 1800.0));
}

TEST_F(TableForm, ATimeStampIsOneOfTheCalendar) {
  EXPECT_EQ(parse_time_stamp("1970-01-02T00:00:00.25")->ns, 86'400'250'000'000);
  EXPECT_EQ(parse_time_stamp("2000-02-29 00:00:00")->ns,
            951'782'400'000'000'000);  // date -u -d 2000-02-29 +%s
  EXPECT_EQ(parse_time_stamp("2026-11-26T12:00:00-05:30")->ns, 1'795'714'200'000'000'000);
  for (const char* none :
       {"2023-02-29", "2024-13-01", "25:00:00x", "9:00", "1.2.3", "2024-03-01T", "12", "", "5-3"})
    EXPECT_FALSE(parse_time_stamp(none).has_value()) << none;
}

TEST_F(TableForm, WhatMayBeReadInTwoWaysIsRefused) {
  EXPECT_THAT(fault_of("a;b\n1,5;2\n2.5;3\n"),
              HasSubstr("in.csv:3: column `a`: `2.5` has a decimal point, and a"));
  EXPECT_THAT(fault_of("a;b\n1.5;2\n2,5;3\n"),
              HasSubstr("`2,5` has a decimal comma, and a number before it"));
  EXPECT_THAT(fault_of("a,b\n\"1,234\",2\n"),
              HasSubstr("may have a decimal comma or one that parts thousands"));
  EXPECT_THAT(fault_of("a;b\n1.234,5;2\n"), HasSubstr("`1.234,5` is not a number"));
  EXPECT_THAT(fault_of("a,b\n1,5,2,5\n"),
              HasSubstr("where numbers have decimal commas, part cells by semicolons"));
  EXPECT_THAT(fault_of("a,b\n03/04/2024 09:00,1\n03/05/2024 09:00,1\n"),
              HasSubstr("in.csv:3: column `a`: of `03/05/2024` day and month may be either way round"));
  EXPECT_THAT(fault_of("a,b\n2024-03-01T09:00:00,1\n7,1\n"), HasSubstr("`7` is not a time"));
  EXPECT_THAT(fault_of("a,b;c\nx,y;z\n", {"c"}), HasSubstr("may be parted by commas or by semicolons"));
}

TEST_F(TableForm, OnlyColumnsThatAreWantedMustHoldNumbers) {
  const auto table =
      Table::read_columns(make("mode,x [m],note,\nhold,1,\"a, b\",\nrun,2,c,\n"), {"x", "none"});
  EXPECT_EQ(table.columns.size(), 1U);
  EXPECT_THAT(table.in("x", "m"), ElementsAre(1.0, 2.0));
  EXPECT_EQ(table.names(), "x, mode, note");
  EXPECT_THAT(fault_of("a,b\n1,x\n"), HasSubstr("in.csv:2: column `b`: `x` is not a number"));
  EXPECT_EQ(fault_of("a,b\n1,x\n", {"a"}), "accepted");
}

TEST_F(TableForm, ANameMayBeginAsACommentDoes) {
  const auto table = Table::read(make("line,x [m]\n#1,1\n# of today\n#2,2\n"), {"line"});
  EXPECT_THAT(table.find("line")->texts, ElementsAre("#1", "#2"));
}

}  // namespace
}  // namespace invar::recording

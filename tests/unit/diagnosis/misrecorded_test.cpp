// Recordings in which a column is dead, or was put beside the others some rows off.
#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "core/base/fault.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/physics/simulation.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using ::testing::HasSubstr;

constexpr const char* two_stores =
    "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: in}\n"
    "states:\n  x: {derivative: '5*(u - x)', initial: {value: 0, unit: V, sigma: 0}}\n"
    "  y: {derivative: 'a*(x - y)', initial: {value: 0, unit: V, sigma: 0}}\n"
    "outputs: {x: {column: first, expression: x}, y: {column: second, expression: y}}\n"
    "parameters: {a: {value: 2, unit: 1/s, sigma: 0.1}}\nnoise: {x: 0.001, y: 0.001}\n";

struct Columns {
  recording::Table table;
  physics::Model model;
};

/// `early`: rows by which the outputs come too early beside what drives them.
Columns recorded(std::size_t early) {
  Columns made{{}, test::model_of(two_stores)};
  constexpr unsigned seed = 5;
  std::cout << "seed " << seed << '\n';
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 0.001};
  std::uniform_real_distribution<double> level{-1.0, 1.0};
  physics::Record inputs;
  auto& u = inputs.signals["u"];
  for (std::size_t i = 0; i < 900; ++i) {
    inputs.time.push_back(0.02 * static_cast<double>(i));
    u.push_back(i % 40 == 0 ? level(random) : u.back());
  }
  physics::Outputs out;
  physics::prepare(made.model, inputs)->run(made.model, out);
  for (auto& column : out)
    for (double& v : column) v += noise(random);
  const std::size_t rows = inputs.rows() - early;
  for (auto& column : out) column.erase(column.begin(), column.begin() + static_cast<std::ptrdiff_t>(early));
  for (auto* column : {&inputs.time, &u}) column->resize(rows);
  made.table.file = "run.csv";
  made.table.add("t", "s", inputs.time);
  made.table.add("in", "V", u);
  made.table.add("first", "V", out[0]);
  made.table.add("second", "V", out[1]);
  return made;
}

Diagnosis diagnosed(Case& data) {
  return diagnose(data, [](double, const std::string&) {});
}

TEST(Misrecorded, AColumnThatComesEarlyIsSaidAndMoved) {
  const auto [table, model] = recorded(3);
  auto data = make_case(model, {table});
  const auto d = diagnosed(data);
  EXPECT_THAT(beside_the_verdict(data, d), HasSubstr("column `first` comes 3 rows (60 ms) too early"));
  EXPECT_THAT(d.findings, ::testing::IsEmpty()) << "no physics acts before its cause";
}

TEST(Misrecorded, OfWhatStandsWhereItShouldNothingIsSaid) {
  const auto [table, model] = recorded(0);
  auto data = make_case(model, {table});
  const auto d = diagnosed(data);
  EXPECT_EQ(beside_the_verdict(data, d), "");
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
}

TEST(Misrecorded, AnOutputOfOneValueIsLeftOutAndSaid) {
  auto [table, model] = recorded(0);
  table.columns.back().values.assign(table.rows(), 0.25);
  auto data = make_case(model, {table});
  const auto d = diagnosed(data);
  EXPECT_THAT(beside_the_verdict(data, d), HasSubstr("column `second` reads one value in every row"));
  EXPECT_THAT(d.findings, ::testing::IsEmpty());
}

TEST(Misrecorded, AnOutputThatDiesIsLeftOutFromThereAndSaid) {
  auto [table, model] = recorded(0);
  auto& values = table.columns.back().values;
  std::fill(values.begin() + 600, values.end(), values[600]);
  auto data = make_case(model, {table});
  const auto d = diagnosed(data);
  EXPECT_THAT(beside_the_verdict(data, d),
              HasSubstr("run.csv: column `second` reads one value from 12 s on and is left out there"));
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
}

TEST(Misrecorded, AnOutputThatRestsAtALimitHasNotDied) {
  auto [table, model] = recorded(0);
  auto& values = table.columns.back().values;
  const double highest = *std::max_element(values.begin(), values.end());
  std::fill(values.begin() + 600, values.end(), highest);
  EXPECT_THAT(make_case(model, {table}).doubts, ::testing::IsEmpty());
}

TEST(Misrecorded, AnOutputThatRestsWithTheWholeMachineHasNotDied) {
  auto [table, model] = recorded(0);
  for (std::size_t c = 1; c < table.columns.size(); ++c) {
    auto& values = table.columns[c].values;
    std::fill(values.begin() + 600, values.end(), values[600]);
  }
  EXPECT_THAT(make_case(model, {table}).doubts, ::testing::IsEmpty());
}

TEST(Misrecorded, WhereAllOutputsAreDeadNothingIsDiagnosed) {
  auto [table, model] = recorded(0);
  for (const std::size_t dead : {2U, 3U}) table.columns[dead].values.assign(table.rows(), 0.25);
  EXPECT_THAT([&] { (void)make_case(model, {table}); },
              ::testing::ThrowsMessage<InputError>(
                  HasSubstr("run.csv: column `first`: reads one value in every row")));
}

}  // namespace
}  // namespace invar::diagnosis

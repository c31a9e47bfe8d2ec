// What the user's equations count a column in, where its header speaks of another unit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/base/fault.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

physics::Model reactor(const std::string& feed) {
  return test::model_of(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {q: " + feed +
      "}\n"
      "states: {z: {derivative: '-D*z + g*(q - 1)', initial: {value: 0, unit: mol/L, sigma: 0}}}\n"
      "outputs: {z: {column: z, expression: z}}\n"
      "parameters:\n  D: {value: 0.02, unit: 1/s, sigma: 0.0005}\n"
      "  g: {value: 0.024, sigma: 0.001}\n");
}

/// Exact for a feed that is held. `leaves` [1/s]: what goes beside D with the square of z.
recording::Table recorded(double leaves) {
  std::mt19937 random{11};
  std::normal_distribution<double> noise{0.0, 0.002};
  std::vector<double> time, feed, out;
  double z = 0.0, q = 1.0;
  for (int i = 0; i < 600; ++i) {
    if (i % 40 == 0) q = 1.0 + 0.8 * std::sin(1.7 * i);
    time.push_back(i), feed.push_back(q), out.push_back(z + noise(random));
    for (int part = 0; part < 200; ++part)
      z += 5e-3 * (-0.02 * z - leaves * z * std::abs(z) + 0.024 * (q - 1.0));
  }
  recording::Table table;
  table.file = "feed.csv";
  table.add("t", "s", time);
  table.add("feed", "mL/s", feed);
  table.add("z", "mol/L", out);
  return table;
}

TEST(OwnUnits, AnInputThatTheEquationsCountInItsOwnUnitIsNoPhysics) {
  auto data = make_case(reactor("feed"), {recorded(0.0)});
  try {
    (void)diagnose(data, [](double, const std::string&) {});
    FAIL() << "in SI the feed is a millionth of what the equations count";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("feed.csv: column `feed`: is in `mL/s`"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("inputs: {q: {column: feed, unit: mL/s}}"));
  }
}

TEST(OwnUnits, AreTakenAsTheModelSays) {
  auto data = make_case(reactor("{column: feed, unit: mL/s}"), {recorded(0.0)});
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_EQ(d.findings.size(), 0U) << summary(data, d);
  auto in_litres = make_case(reactor("{column: feed, unit: L/s}"), {recorded(0.0)});
  EXPECT_NEAR(in_litres.recordings[0].inputs.signals.at("q")[0], 1e-3, 1e-12);
}

TEST(OwnUnits, LeaveRoomForPhysics) {
  auto data = make_case(reactor("{column: feed, unit: mL/s}"), {recorded(0.05)});
  const auto d = diagnose(data, [](double, const std::string&) {});
  ASSERT_EQ(d.findings.size(), 1U) << summary(data, d);
  EXPECT_EQ(d.findings[0].term.info->name, "quadratic");
  auto table = recorded(0.05);  // a feed that is in SI by its header, of a machine that counts in SI
  for (double& q : table.columns[1].values) q *= 1e6;
  auto in_si = make_case(reactor("feed"), {table});
  const auto same = diagnose(in_si, [](double, const std::string&) {});
  ASSERT_EQ(same.findings.size(), 1U) << summary(in_si, same);
  EXPECT_EQ(same.findings[0].term.info->name, "quadratic");
}

TEST(OwnUnits, AreUnitsThatAreKnown) {
  EXPECT_EQ(testing::fault_of([] { (void)reactor("{column: feed, unit: buckets}"); }),
            "model.yaml:4: inputs.q.unit: `buckets` is no unit that is known; write one like `mL/s`, or "
            "leave it out");
}

}  // namespace
}  // namespace invar::diagnosis

// No trick: names, cuts and sampling do not change what a diagnosis says; without the right term it does not make one up.
#include <gmock/gmock.h>

#include "tests/support/mismatch/claims.hpp"
#include "tests/support/mismatch/marks.hpp"
#include "tools/diagnose/shorten.hpp"

namespace invar::test::mismatch {
namespace {

diagnose::Diagnosis diagnosed(const Machine& machine, const diagnose::Options& options = {}) {
  auto data = case_of(machine);
  return diagnose::search(
      data, [](double, const std::string&) {}, options);
}

std::vector<std::string> names(const diagnose::Diagnosis& d) {
  std::vector<std::string> all{diagnose::name_of(d.verdict)};
  for (const auto& finding : d.findings) all.emplace_back(finding.term.info->name);
  return all;
}

/// Rows from `first` on, one in `every`.
Machine recut(Machine machine, double first, double last, std::size_t every) {
  for (auto& table : machine.recordings) {
    const std::size_t rows = table.rows();
    for (auto& column : table.columns) {
      std::vector<double> kept;
      for (auto i = static_cast<std::size_t>(first * static_cast<double>(rows));
           static_cast<double>(i) < last * static_cast<double>(rows); i += every)
        kept.push_back(column.values[i]);
      column.values = std::move(kept);
    }
  }
  return machine;
}

struct Known {
  const char *plant, *effect;
  unsigned seed;
};
constexpr Known known[] = {{"thermal", "sensor_lag", 3},
                           {"error_map", "periodic_error", 5},
                           {"droplet", "lens_distortion", 4},
                           {"sensor", "latency", 8}};

TEST(NoTrick, OtherNamesOfColumnsAndCasesChangeNothing) {
  for (const auto& k : known) {
    const auto plain = make(k.plant, k.effect, 1.0, k.seed);
    Trouble trouble;
    trouble.renamed = true;
    auto renamed = make(k.plant, k.effect, 1.0, k.seed, trouble);
    for (auto& table : renamed.recordings) table.file = "zzz.csv";
    ASSERT_NE(plain.yaml, renamed.yaml);
    const auto one = diagnosed(plain), other = diagnosed(renamed);
    EXPECT_THAT(names(one), ::testing::Contains(k.effect)) << k.plant;
    EXPECT_EQ(names(one), names(other)) << k.plant << ' ' << k.effect;
    for (std::size_t i = 0; i < one.findings.size(); ++i)
      EXPECT_EQ(one.findings[i].term.values, other.findings[i].term.values) << k.plant << ' ' << k.effect;
  }
}

TEST(NoTrick, AnotherCutOfTheRecordingSaysTheSame) {
  for (const auto& k : known) {
    const auto machine = make(k.plant, k.effect, 1.0, k.seed);
    EXPECT_THAT(names(diagnosed(recut(machine, 0.0, 0.7, 1))), ::testing::Contains(k.effect)) << k.plant;
    const std::string plant{k.plant};
    // Where each row stands for itself or says where the machine is, a later part does as well, and every second row.
    if (plant == "error_map" || plant == "droplet" || plant == "sensor") {
      EXPECT_THAT(names(diagnosed(recut(machine, 0.3, 1.0, 1))), ::testing::Contains(k.effect)) << k.plant;
    }
    if (plant == "error_map" || plant == "droplet") {
      EXPECT_THAT(names(diagnosed(recut(machine, 0.0, 1.0, 2))), ::testing::Contains(k.effect)) << k.plant;
    }
  }
}

TEST(NoTrick, WithoutTheRightTermNoOtherIsClaimedWithConfidence) {
  for (const auto& k : known) {
    const auto machine = make(k.plant, k.effect, 1.0, k.seed);
    diagnose::Options options;
    options.without = {k.effect};
    const auto d = diagnosed(machine, options);
    for (const auto& finding : d.findings) {
      const std::string name{finding.term.info->name};
      EXPECT_NE(name, k.effect);
      EXPECT_TRUE(name == "unmodelled" || credit(machine, name) > 0.0)
          << k.plant << ' ' << k.effect << ": " << name;
    }
  }
}

// What comes nearest among the other names explains most of these; a free course, or what is left over, tells.
TEST(NoTrick, ANearNameIsNotClaimedWithConfidence) {
  constexpr Known near[] = {{"error_map", "sag", 6},
                            {"error_map", "thermal_expansion", 7},
                            {"error_map", "refractive_index", 9},
                            {"droplet", "stage_velocity_carry", 3},
                            {"droplet", "valve_delay", 7},
                            {"thermal", "radiation", 3},
                            {"thermal", "node_coupling", 7}};
  for (const auto& k : near) {
    const auto machine = make(k.plant, k.effect, 1.0, k.seed);
    ASSERT_THAT(names(diagnosed(machine)), ::testing::Contains(k.effect)) << k.plant;
    diagnose::Options options;
    options.without = {k.effect};
    for (const auto& finding : diagnosed(machine, options).findings) {
      const std::string name{finding.term.info->name};
      EXPECT_TRUE(name == "unmodelled" || credit(machine, name) > 0.0 || finding.probability < confident)
          << k.plant << ' ' << k.effect << ": " << name << ' ' << finding.probability;
    }
  }
}

TEST(NoTrick, WhatFollowsTheInputsIsNotCalledNoise) {
  diagnose::Options options;
  options.without = {"sensor_lag"};
  for (const unsigned seed : {1006U, 2006U})
    EXPECT_EQ(names(diagnosed(make("thermal", "sensor_lag", 1.0, seed), options)).front(), "unknown_physics")
        << seed;
}

physics::Record long_record(std::size_t rows, double step) {
  physics::Record record;
  for (std::size_t i = 0; i < rows; ++i) {
    record.time.push_back(step * static_cast<double>(i));
    const bool moves = (i / 1000) % 2 == 1;  // a second of rest, a second of travel
    const auto& r = record.signals["reference"];
    record.signals["reference"].push_back((r.empty() ? 0.0 : r.back()) + (moves ? 1e-4 : 0.0));
    record.signals["pad"].push_back(i % 7 == 0 ? 70.0 : 0.0);
    record.signals["slide"].push_back(20.0 + 1e-3 * static_cast<double>(i));
  }
  return record;
}

TEST(LongRecordings, AnAxisIsCutIntoStretchesThatBeginAtRest) {
  physics::Model model;
  model.plant = physics::Plant::axis;
  model.controller.emplace();
  const auto stretches = diagnose::shortened(model, long_record(200000, 1e-3), 30000);
  ASSERT_EQ(stretches.size(), 5U);
  std::size_t rows = 0;
  double until = -1.0;
  for (const auto& stretch : stretches) {
    rows += stretch.record.rows();
    EXPECT_GT(stretch.record.time.front(), until);
    until = stretch.record.time.back();
    const auto& r = *stretch.record.find("reference");
    EXPECT_EQ(r[0], r[1]);
    EXPECT_EQ(stretch.forget > 0, stretch.record.time.front() > 0.0);
  }
  EXPECT_LE(rows, 30000U);
  EXPECT_GT(until, 160.0);  // the end is seen too
}

TEST(LongRecordings, HeatIsKeptInMeans) {
  physics::Model model;
  model.plant = physics::Plant::thermal;
  model.signals = {{"slide", "", "degC", true}};
  const auto stretches = diagnose::shortened(model, long_record(70000, 0.1), 10000);
  ASSERT_EQ(stretches.size(), 1U);
  const auto& record = stretches[0].record;
  ASSERT_EQ(record.rows(), 10000U);
  for (const double p : *record.find("pad")) EXPECT_DOUBLE_EQ(p, 10.0);
  for (std::size_t i = 0; i < record.rows(); i += 100)
    EXPECT_NEAR((*record.find("slide"))[i], 20.0 + 1e-2 * record.time[i], 1e-9);
}

TEST(LongRecordings, AShortOneStaysAsItIs) {
  physics::Model model;
  const auto stretches = diagnose::shortened(model, long_record(500, 1e-3), 500);
  ASSERT_EQ(stretches.size(), 1U);
  EXPECT_EQ(stretches[0].record.rows(), 500U);
  EXPECT_EQ(stretches[0].forget, 0U);
}

}  // namespace
}  // namespace invar::test::mismatch

// The figures of ISO 230-2: against its formulas worked by hand, and against a published report where its readings lie.
#include "core/metrology/geometric/iso230.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <random>
#include <string>

namespace invar::metrology {
namespace {

using F = Iso230Figure;

/// Two targets, three cycles, whole micrometres: each figure worked by hand from the standard's formulas.
std::vector<TargetReadings> by_hand() {
  return {{0.0, {1e-6, 2e-6, 3e-6}, {-2e-6, -2e-6, -2e-6}}, {0.1, {10e-6, 12e-6, 14e-6}, {7e-6, 8e-6, 9e-6}}};
}

TEST(Iso230, IsWhatTheFormulasGiveByHand) {
  const Iso230 found = iso230(by_hand());
  // Means 2 and -2, 12 and 8; s 1 and 0, 2 and 1; B 4 and 4.
  EXPECT_NEAR(found.targets[0].mean, 0.0, 1e-15);
  EXPECT_NEAR(found.targets[1].mean, 10e-6, 1e-15);
  EXPECT_NEAR(found.targets[1].s_forward, 2e-6, 1e-15);
  EXPECT_NEAR(found.targets[0].repeatability, 6e-6, 1e-15);   // 2 + 0 + 4 against 4 and 0
  EXPECT_NEAR(found.targets[1].repeatability, 10e-6, 1e-15);  // 4 + 2 + 4 against 8 and 4
  EXPECT_NEAR(found[F::B], 4e-6, 1e-15);
  EXPECT_NEAR(found[F::B_mean], 4e-6, 1e-15);
  EXPECT_NEAR(found[F::R_forward], 8e-6, 1e-15);
  EXPECT_NEAR(found[F::R_backward], 4e-6, 1e-15);
  EXPECT_NEAR(found[F::R], 10e-6, 1e-15);
  EXPECT_NEAR(found[F::E_forward], 10e-6, 1e-15);
  EXPECT_NEAR(found[F::E_backward], 10e-6, 1e-15);
  EXPECT_NEAR(found[F::E], 14e-6, 1e-15);  // 12 - (-2)
  EXPECT_NEAR(found[F::M], 10e-6, 1e-15);
  EXPECT_NEAR(found[F::A_forward], 16e-6, 1e-15);   // 12 + 4 - (2 - 2)
  EXPECT_NEAR(found[F::A_backward], 12e-6, 1e-15);  // 8 + 2 - (-2)
  EXPECT_NEAR(found[F::A], 18e-6, 1e-15);           // 16 - (-2)
}

TEST(Iso230, OneDirectionGivesNoFigureOfTwo) {
  std::vector<TargetReadings> readings = by_hand();
  for (auto& one : readings) one.backward.clear();
  const Iso230 found = iso230(readings);
  EXPECT_NEAR(found[F::A_forward], 16e-6, 1e-15);
  for (const F figure : {F::B, F::R, F::E, F::M, F::A, F::A_backward}) EXPECT_TRUE(std::isnan(found[figure]));
  EXPECT_TRUE(std::isnan(found.uncertainty[static_cast<std::size_t>(F::A)]));
}

// Of tests drawn from one machine the figures scatter; the expanded uncertainty of one test tells by how much.
TEST(Iso230, ItsUncertaintyIsTheScatterOfTestsAndTheConditions) {
  std::mt19937_64 random{7};
  RecordProperty("seed", 7);
  std::normal_distribution<double> normal;
  double sum = 0.0;
  double square = 0.0;
  double told = 0.0;
  constexpr int tests = 300;
  for (int t = 0; t < tests; ++t) {
    std::vector<TargetReadings> readings;
    for (int i = 0; i < 5; ++i) {
      readings.push_back({0.05 * i, {}, {}});
      for (int j = 0; j < 5; ++j) {
        readings.back().forward.push_back(i * 1e-6 + 1e-6 * normal(random));
        readings.back().backward.push_back(i * 1e-6 + 2e-6 + 1e-6 * normal(random));
      }
    }
    const Iso230 found = iso230(readings);
    sum += found[F::M] / tests;
    square += found[F::M] * found[F::M] / tests;
    told += found.uncertainty[static_cast<std::size_t>(F::M)] / tests;
    if (t > 0) continue;
    const Iso230 doubtful = iso230(readings, {1e-5, 3e-6});
    const auto m = static_cast<std::size_t>(F::M);
    EXPECT_NEAR(doubtful.uncertainty[m],
                std::sqrt(std::pow(found.uncertainty[m], 2) + 4.0 * (std::pow(1e-5 * 0.2, 2) + 9e-12)),
                1e-12);
  }
  EXPECT_NEAR(told / (2.0 * std::sqrt(square - sum * sum)), 1.0, 0.2);
}

/// Readings as the public reports of ecmccfg list them: TGT_DATA[i], REF_DATA_FWD[i,j], REF_DATA_BWD[i,j], in mm.
std::vector<TargetReadings> read_report(const std::filesystem::path& file) {
  std::map<int, TargetReadings> targets;
  std::ifstream stream{file};
  std::string line;
  while (std::getline(stream, line)) {
    int i = 0;
    int j = 0;
    double value = 0.0;
    if (std::sscanf(line.c_str(), "TGT_DATA[%d]=%lf", &i, &value) == 2) targets[i].position = 1e-3 * value;
    // Their program calls backward what the report shows as forward.
    if (std::sscanf(line.c_str(), "REF_DATA_FWD[%d,%d]=%lf", &i, &j, &value) == 3)
      targets[i].backward.push_back(1e-3 * value - targets[i].position);
    if (std::sscanf(line.c_str(), "REF_DATA_BWD[%d,%d]=%lf", &i, &j, &value) == 3)
      targets[i].forward.push_back(1e-3 * value - targets[i].position);
  }
  std::vector<TargetReadings> result;
  for (auto& [i, one] : targets) result.push_back(std::move(one));
  return result;
}

TEST(Iso230, EqualsThePublishedReportToTheLastDigit) {
  const char* named = std::getenv("INVAR_SHARED");
  const auto shared = named != nullptr ? std::filesystem::path{named}
                                       : std::filesystem::path{INVAR_SOURCE_DIR}.parent_path() / "shared";
  const auto file = shared / "cases" / "renishaw-rtl" / "mcu1025_ISO230.dat";
  if (!std::filesystem::exists(file)) {
    std::cout << "no report in " << file << "; set INVAR_SHARED to the folder that holds cases/\n";
    return;
  }
  const Iso230 found = iso230(read_report(file));
  ASSERT_EQ(found.targets.size(), 5U);
  const auto in_mm = [](double value) { return std::round(1e3 * value * 1e5) / 1e5; };  // five digits
  const std::array<double, 5> mean_forward{0.01242, 0.00319, -0.03154, -0.00933, 0.04323};
  const std::array<double, 5> reversal{0.01079, -0.02102, -0.0099, 0.01259, 0.04346};
  const std::array<double, 5> s_backward{0.05119, 0.02163, 0.00174, 0.00257, 0.00284};
  const std::array<double, 5> repeatability{0.20476, 0.08651, 0.01872, 0.01978, 0.05828};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_DOUBLE_EQ(in_mm(found.targets[i].mean_forward), mean_forward[i]);
    EXPECT_DOUBLE_EQ(in_mm(found.targets[i].reversal), reversal[i]);
    EXPECT_DOUBLE_EQ(in_mm(found.targets[i].s_backward), s_backward[i]);
    EXPECT_DOUBLE_EQ(in_mm(found.targets[i].repeatability), repeatability[i]);
  }
  EXPECT_DOUBLE_EQ(in_mm(found[F::B]), 0.04346);
  EXPECT_DOUBLE_EQ(in_mm(found[F::B_mean]), 0.00718);
  EXPECT_DOUBLE_EQ(in_mm(found[F::R_forward]), 0.0183);
  EXPECT_DOUBLE_EQ(in_mm(found[F::R_backward]), 0.20476);
  EXPECT_DOUBLE_EQ(in_mm(found[F::R]), 0.20476);
  EXPECT_DOUBLE_EQ(in_mm(found[F::E_forward]), 0.07477);
  EXPECT_DOUBLE_EQ(in_mm(found[F::E_backward]), 0.04612);
  EXPECT_DOUBLE_EQ(in_mm(found[F::M]), 0.04809);
  EXPECT_DOUBLE_EQ(in_mm(found[F::A_forward]), 0.08927);
  EXPECT_DOUBLE_EQ(in_mm(found[F::A]), 0.20476);
  // Their E takes the forward mean's highest less the backward mean's lowest; the standard takes either of both.
  EXPECT_DOUBLE_EQ(in_mm(found[F::E]), 0.07477);
}

}  // namespace
}  // namespace invar::metrology

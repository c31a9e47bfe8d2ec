// Error motions measured one by one at several states of the machine: which states they depend on, the field they make,
// and the loop's tables of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/metrology/geometric/error_motion_identification.hpp"
#include "core/metrology/geometric/error_motion_tables.hpp"
#include "tests/support/real_time_guard.hpp"

namespace invar::metrology {
namespace {

/// True error motions of a machine that warms up: growth, bending with temperature, tilt with the heating rate.
ErrorMotions truth(const Eigen::Vector3d& p, double temperature, double rate) {
  ErrorMotions m;
  const double warmer = temperature - 28.0;
  m[0].translation.x() = 3e-6 * std::sin(20.0 * p.x()) + 12e-6 * p.x() * warmer;
  m[1].translation.z() = 2e-6 * std::sin(15.0 * p.y());
  m[1].rotation.x() = 10e-6 * p.y() * warmer + 4e-3 * rate * p.y();
  m[2].rotation.y() = 20e-6 * p.z();
  return m;
}

struct Calibration {
  Calibration() {
    networks.chain = {{0, 2, 1}, 3};  // any order
    networks.travel = {Range{0.0, 0.2}, Range{0.0, 0.2}, Range{0.0, 0.2}};
    networks.tool = {0.02, -0.01, -0.05};
    networks.squareness = {1e-4, -5e-5, 2e-5};
    networks.states = {{"temperature", {26.0, 30.0}}, {"heating_rate", {-1e-3, 1e-3}}};
    for (const int component : {translation(0, 0), translation(2, 1), rotation(0, 1), rotation(1, 2)}) {
      fits[static_cast<std::size_t>(component)] = identify_error_motion(measure(component));
      networks.components[static_cast<std::size_t>(component)] =
          fits[static_cast<std::size_t>(component)].motion;
    }
  }

  /// What an instrument of 50 nm and 0.05 urad reads of one component, over positions, temperatures, and heating, resting,
  /// cooling; one reading in a hundred is 5 um or 5 urad off.
  ErrorMotionReadings measure(int component) {
    std::vector<Eigen::Vector4d> rows;  // position, temperature, rate, value
    std::normal_distribution<double> normal;
    for (int i = 0; i <= 20; ++i)
      for (int t = 0; t <= 4; ++t)
        for (int r = 0; r <= 2; ++r) {
          const double q = 0.01 * i;
          const double temperature = 26.0 + t;
          const double rate = 1e-3 * (r - 1);
          const ErrorMotions all = truth(Eigen::Vector3d::Constant(q), temperature, rate);
          const auto& motion = all[static_cast<std::size_t>(axis_of(component))];
          const double value =
              (is_rotation(component) ? motion.rotation : motion.translation)[direction_of(component)];
          rows.emplace_back(q, temperature, rate,
                            value + 5e-8 * normal(random) + (rows.size() % 100 == 57 ? 5e-6 : 0.0));
        }
    Eigen::MatrixXd table(4, static_cast<Eigen::Index>(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) table.col(static_cast<Eigen::Index>(i)) = rows[i];
    return {table.row(0), table.middleRows<2>(1), table.row(3)};
  }

  std::mt19937_64 random{31};
  ErrorMotionNetworks networks;
  std::array<ErrorMotionFit, error_motion_count> fits;
};

class ComponentNetworksTest : public ::testing::Test {
 protected:
  ComponentNetworksTest() { RecordProperty("seed", 31); }
  static const Calibration& calibration() {
    static const Calibration once;
    return once;
  }

  Eigen::Vector3d somewhere() { return {0.2 * part(random), 0.2 * part(random), 0.2 * part(random)}; }
  std::array<double, 2> some_state() {
    return {26.0 + 4.0 * part(random), 1e-3 * (2.0 * part(random) - 1.0)};
  }

  std::mt19937_64 random{32};
  std::uniform_real_distribution<double> part;
  const ErrorMotionNetworks& networks = calibration().networks;
  const std::array<ErrorMotionFit, error_motion_count>& fits = calibration().fits;
};

TEST_F(ComponentNetworksTest, DependOnWhatTheReadingsDoAndOnNothingElse) {
  using States = std::vector<std::size_t>;
  const auto states = [&](int component) {
    States found = fits[static_cast<std::size_t>(component)].motion.states;
    std::sort(found.begin(), found.end());
    return found;
  };
  EXPECT_EQ(states(translation(0, 0)), States{0});
  EXPECT_EQ(states(translation(2, 1)), States{});
  EXPECT_EQ(states(rotation(0, 1)), (States{0, 1}));
  EXPECT_EQ(states(rotation(1, 2)), States{});
  for (const int component : {translation(0, 0), rotation(1, 2)}) {
    EXPECT_EQ(fits[static_cast<std::size_t>(component)].rejected, 3U);
    EXPECT_NEAR(fits[static_cast<std::size_t>(component)].noise, 5e-8, 1e-8);
  }
}

// A fit takes the cube of the number of readings: without means, 80 GB here.
TEST(IdentifyComponent, TakesALogOfAHundredThousandReadings) {
  constexpr Eigen::Index count = 100'000;
  const auto value = [](double x, double warmer) { return 3e-6 * std::sin(20.0 * x) + 12e-6 * x * warmer; };
  std::mt19937_64 random{33};
  std::uniform_real_distribution<double> part;
  std::normal_distribution<double> normal;
  ErrorMotionReadings log{Eigen::VectorXd(count), Eigen::MatrixXd(1, count), Eigen::VectorXd(count)};
  for (Eigen::Index i = 0; i < count; ++i) {
    log.position[i] = 0.2 * part(random);
    log.state(0, i) = 26.0 + 4.0 * static_cast<double>(i) / count;
    log.value[i] = value(log.position[i], log.state(0, i) - 28.0) + 5e-8 * normal(random);
  }
  const ErrorMotionFit fit = identify_error_motion(log);
  ASSERT_EQ(fit.motion.states, std::vector<std::size_t>{0});
  for (int i = 0; i <= 20; ++i)
    for (const double t : {26.0, 27.3, 30.0})
      EXPECT_NEAR(fit.motion.value(0.01 * i, std::array{t}), value(0.01 * i, t - 28.0), 3e-8)
          << i << ' ' << t;
}

TEST_F(ComponentNetworksTest, GiveTheFieldOfAWarmMachineAtStatesThatWereNotMeasured) {
  const auto directions = axis_directions(networks.chain, networks.squareness);
  double square = 0.0;
  double before = 0.0;
  double inside = 0.0;
  constexpr int count = 400;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d p = somewhere();
    const auto state = some_state();
    const Eigen::Vector3d exact =
        exact_error(networks.chain, directions, p, truth(p, state[0], state[1]), networks.tool);
    const Eigen::Vector3d left = exact - networks.error(p, networks.tool, state);
    square += left.squaredNorm() / count;
    const Eigen::Vector3d skew = exact_error(networks.chain, directions, p, {}, networks.tool);
    before += (exact - skew).squaredNorm() / count;
    const Eigen::Vector3d sigma = networks.sigma_at(p, networks.tool, state);
    for (int k = 0; k < 3; ++k) inside += std::abs(left[k]) <= 2.0 * sigma[k] ? 1.0 / (3.0 * count) : 0.0;
  }
  EXPECT_LT(std::sqrt(square), 5e-8);  // below one reading's noise
  EXPECT_GT(std::sqrt(before), 1e-6);
  EXPECT_GT(inside, 0.85);
}

TEST_F(ComponentNetworksTest, AreHeldOutsideWhatWasCalibratedWithALargerSigma) {
  const Eigen::Vector3d p{0.2, 0.1, 0.1};
  const std::array<double, 2> end{30.0, 0.0};
  const std::array<double, 2> beyond{33.0, 0.0};
  EXPECT_TRUE(networks.knows(end));
  EXPECT_FALSE(networks.knows(beyond));
  EXPECT_EQ(networks.error(p, networks.tool, beyond), networks.error(p, networks.tool, end));
  const double truly = 12e-6 * 0.2 * 3.0;  // what the scale grows from 30 to 33 degC
  const double sigma = networks.sigma_at(p, networks.tool, beyond).x();
  EXPECT_GT(sigma, 0.3 * truly);
  EXPECT_LT(sigma, 3.0 * truly);
}

TEST_F(ComponentNetworksTest, TablesDifferByNoMoreThanTheirBound) {
  ErrorMotionTables tables{networks};
  EXPECT_LT(tables.bound(), 2e-7);
  double worst = 0.0;
  double largest_sigma = 0.0;
  std::uint64_t violations = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = somewhere();
    const auto state = some_state();
    Eigen::Vector3d fast;
    {
      const support::RealTimeGuard guard;
      for (std::size_t s = 0; s < 2; ++s) tables.set(s, state[s]);
      fast = tables.error(p);
      largest_sigma = std::max(largest_sigma, tables.sigma(p).maxCoeff());
      tables.forget();
      violations += guard.violations();
    }
    worst = std::max(worst, (fast - networks.error(p, networks.tool, state)).norm());
  }
  EXPECT_LE(worst, tables.bound());
  EXPECT_GT(worst, 0.0);
  EXPECT_LT(largest_sigma, 1e-7);
  EXPECT_EQ(violations, 0U);
  const std::array<double, 2> usual{28.0, 0.0};
  const Eigen::Vector3d p = somewhere();
  EXPECT_LE((tables.error(p) - networks.error(p, networks.tool, usual)).norm(), tables.bound());
}

TEST(ErrorMotionNetworks, AComponentThatIsNotThereIsZero) {
  EXPECT_EQ(ErrorMotionNetworks{}.error({0.1, 0.1, 0.1}, Eigen::Vector3d::Zero(), {}),
            Eigen::Vector3d::Zero());
}

}  // namespace
}  // namespace invar::metrology

#include "core/metrology/component_networks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

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

class ComponentNetworksTest : public ::testing::Test {
 protected:
  /// What an instrument of 50 nm and 0.05 urad reads of one component on a grid of positions and states.
  ComponentNetwork measure(int component, const std::vector<int>& states, std::vector<int> counts) {
    std::vector<Eigen::Vector4d> rows;  // position, temperature, rate, value
    std::normal_distribution<double> normal;
    for (int i = 0; i <= 20; ++i)
      for (int t = 0; t <= (states.empty() ? 0 : 4); ++t)
        for (int r = 0; r <= (states.size() > 1 ? 2 : 0); ++r) {
          const double q = 0.01 * i;
          const double temperature = 26.0 + t;
          const double rate = 1e-3 * (r - 1);
          const ErrorMotions all = truth(Eigen::Vector3d::Constant(q), states.empty() ? 28.0 : temperature,
                                         states.size() > 1 ? rate : 0.0);
          const auto& motion = all[static_cast<std::size_t>(axis_of(component))];
          const double value =
              (is_rotation(component) ? motion.rotation : motion.translation)[direction_of(component)];
          rows.emplace_back(q, temperature, rate, value + 5e-8 * normal(random));
        }
    Eigen::MatrixXd table(4, static_cast<Eigen::Index>(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) table.col(static_cast<Eigen::Index>(i)) = rows[i];
    numerics::RidgeOptions options;
    options.counts = std::move(counts);
    return fit_component(table.row(0), table.middleRows<2>(1), states, table.row(3), options);
  }

  std::mt19937_64 random{31};
};

TEST_F(ComponentNetworksTest, GiveTheFieldOfAWarmMachineAtStatesThatWereNotMeasured) {
  RecordProperty("seed", 31);
  ComponentNetworks networks;
  networks.chain = {{0, 2, 1}, 3};  // any order
  networks.squareness = {1e-4, -5e-5, 2e-5};
  const auto put = [&](int component, const std::vector<int>& states, std::vector<int> counts) {
    networks.components[static_cast<std::size_t>(component)] = measure(component, states, std::move(counts));
  };
  put(translation(0, 0), {0}, {12, 4});    // EXX over position and temperature
  put(translation(2, 1), {}, {12});        // EZY over position
  put(rotation(0, 1), {0, 1}, {8, 4, 3});  // EAY over position, temperature and heating rate
  put(rotation(1, 2), {}, {8});            // EBZ
  const auto directions = axis_directions(networks.chain, networks.squareness);
  const Eigen::Vector3d tool{0.02, -0.01, -0.05};
  std::uniform_real_distribution<double> part;
  double square = 0.0;
  double before = 0.0;
  constexpr int count = 400;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d p{0.2 * part(random), 0.2 * part(random), 0.2 * part(random)};
    const Eigen::Vector2d state{26.0 + 4.0 * part(random), 1e-3 * (2.0 * part(random) - 1.0)};
    const Eigen::Vector3d exact =
        exact_error(networks.chain, directions, p, truth(p, state[0], state[1]), tool);
    square += (exact - networks.error(p, tool, state)).squaredNorm() / count;
    const Eigen::Vector3d skew = exact_error(networks.chain, directions, p, {}, tool);
    before += (exact - skew).squaredNorm() / count;
  }
  EXPECT_LT(std::sqrt(square), 1.5e-7);
  EXPECT_GT(std::sqrt(before), 1e-6);
}

TEST_F(ComponentNetworksTest, AComponentThatIsNotThereIsZero) {
  ComponentNetworks networks;
  EXPECT_EQ(networks.error({0.1, 0.1, 0.1}, Eigen::Vector3d::Zero(), Eigen::VectorXd{}),
            Eigen::Vector3d::Zero());
}

}  // namespace
}  // namespace invar::metrology

#include "core/compensation/geometric_file.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>
#include <random>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/line_plan.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/unit/metrology/geometric/simulated_machine.hpp"

namespace invar::compensation {
namespace {

class GeometricFileTest : public ::testing::Test {
 protected:
  GeometricFileTest() {
    std::mt19937_64 random{11};
    machine = metrology::testing::random_machine({{1, 0, 2}, 2}, {0.2, 0.2, 0.0}, random);
    std::vector<metrology::DisplacementLine> lines;
    metrology::testing::Laser laser;
    laser.temperature = 20.0;
    laser.warming = 1.0;
    for (const auto& one : metrology::recipe_lines(machine, 1))
      lines.push_back(
          metrology::testing::measure(machine, one.name, one.from, one.to, 11, one.tool, random, laser));
    model = metrology::identify(machine, lines).model;
    ModelText text{"geometric", {}};
    write_geometric(text, model);
    text.write(folder / "compensation.yaml");
  }
  GeometricFileTest(const GeometricFileTest&) = delete;
  GeometricFileTest& operator=(const GeometricFileTest&) = delete;

  std::string text() const {
    std::ifstream stream{folder / "compensation.yaml"};
    return {std::istreambuf_iterator<char>{stream}, {}};
  }

  invar::testing::TemporaryFolder folder;
  metrology::Machine machine;
  metrology::GeometricModel model;
};

TEST_F(GeometricFileTest, ReadsBackTheSameField) {
  const auto read = load_geometric(folder / "compensation.yaml");
  for (const double x : {-0.01, 0.0, 0.013, 0.111, 0.2}) {
    const Eigen::Vector3d position{x, 0.2 - x, 0.0};
    EXPECT_LT((read.error(position, model.tool) - model.error(position, model.tool)).norm(), 1e-15);
    EXPECT_EQ(read.sigma_at(position, model.tool).head<2>(), model.sigma_at(position, model.tool).head<2>());
  }
  for (const double x : {0.0, 0.07, 0.2})
    EXPECT_EQ(read.reversal_at({x, x, 0.0}, {1, -1, 0}), model.reversal_at({x, x, 0.0}, {1, -1, 0}));
  ASSERT_TRUE(read.reference_temperature);
  EXPECT_EQ(*read.reference_temperature, *model.reference_temperature);
  EXPECT_EQ(read.expansion_at({0.1, 0.05, 0.0}, 25.0), model.expansion_at({0.1, 0.05, 0.0}, 25.0));
  EXPECT_GT(read.expansion_sigma_at({0.2, 0.0, 0.0}, 25.0).x(), 0.0);
}

TEST_F(GeometricFileTest, RefusesADamagedFile) {
  std::string damaged = text();
  damaged[damaged.find("coefficients: [") + 18] ^= 1;
  std::ofstream{folder / "damaged.yaml"} << damaged;
  EXPECT_THROW(load_geometric(folder / "damaged.yaml"), InputError);
  std::ofstream{folder / "cut.yaml"} << text().substr(0, text().size() / 2);
  EXPECT_THROW(load_geometric(folder / "cut.yaml"), InputError);
  std::ofstream{folder / "other.yaml"} << "invar_compensation: 1\nkind: thermal\n";
  EXPECT_THROW(load_geometric(folder / "other.yaml"), InputError);
}

}  // namespace
}  // namespace invar::compensation

// A model reads back as it was written, and a damaged one is refused.
#include "core/compensation/thermal_file.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

namespace invar::compensation {
namespace {

using ::testing::HasSubstr;

class ThermalFile : public ::testing::Test {
 protected:
  ThermalFile() {
    model.x = {0.0, 0.2};
    model.temperature = {26.9, 30.1};
    model.heating_rate = {0.0, 0.0};
    model.noise = 2e-7;
    model.slope_temperature = 1.7e-6;
    for (const auto factor :
         {metrology::ThermalFactor::geometry, metrology::ThermalFactor::temperature_curve}) {
      metrology::ThermalTerm term{factor, -0.05, 0.05, Eigen::MatrixXd(7, factor_count(factor))};
      for (Eigen::Index i = 0; i < term.weights.size(); ++i)
        term.weights.reshaped()(i) = 1e-6 / (3.0 + static_cast<double>(i));
      model.terms.push_back(term);
    }
    model.sigma_table = {{numerics::GridAxis{model.x, 2}, numerics::GridAxis{model.temperature, 2},
                          numerics::GridAxis{model.heating_rate, 1}},
                         std::vector<double>{1e-7, 2e-7, 3e-7, 4e-7}};
  }
  ThermalFile(const ThermalFile&) = delete;
  ThermalFile& operator=(const ThermalFile&) = delete;

  std::filesystem::path write() const {
    ModelText text{"thermal", {}};
    write_thermal(text, model);
    text.write(folder / "compensation.yaml");
    return folder / "compensation.yaml";
  }
  static metrology::ThermalError read(const std::filesystem::path& file) {
    const auto yaml = config::Yaml::load(file);
    (void)yaml.root().integer("invar_compensation", 1, 1);
    (void)yaml.root().text("kind");
    check_seal(yaml);
    auto result = read_thermal(yaml.root());
    yaml.finish();
    return result;
  }
  static std::string fault_of(const std::filesystem::path& file) {
    return invar::testing::fault_of([&] { (void)read(file); });
  }

  invar::testing::TemporaryFolder folder;
  metrology::ThermalError model;
};

TEST_F(ThermalFile, ReadsBackBitForBit) {
  const metrology::ThermalError back = read(write());
  for (double x = -0.01; x < 0.22; x += 0.013)
    for (const double t : {26.0, 27.7, 31.0}) {
      EXPECT_EQ(back.value({x, t, 0.0}), model.value({x, t, 0.0}));
      EXPECT_EQ(back.sigma({x, t, 0.0}), model.sigma({x, t, 0.0}));
    }
}

TEST_F(ThermalFile, IsRefusedWhenADigitIsChanged) {
  const auto file = write();
  std::ostringstream text;
  text << std::ifstream{file}.rdbuf();
  std::string changed = text.str();
  changed.replace(changed.find("30.1"), 4, "30.2");
  std::ofstream{file} << changed;
  EXPECT_THAT(fault_of(file), HasSubstr("checksum"));
}

TEST_F(ThermalFile, NamesTheLineOfAFactorThatIsNone) {
  const auto file = write();
  std::ostringstream text;
  text << std::ifstream{file}.rdbuf();
  std::string changed = text.str();
  changed.replace(changed.find("\"geometry\""), 10, "\"humidity\"");
  changed.resize(changed.find("checksum"));
  std::ofstream{file} << changed;
  EXPECT_THAT(fault_of(file), HasSubstr("is no factor of a thermal term"));
}

TEST_F(ThermalFile, KnowsTheChecksumOfThePublishedTestString) {
  EXPECT_EQ(checksum("123456789"), "cbf43926");
}

}  // namespace
}  // namespace invar::compensation

// The model files to begin with are models, and simulate.
#include "tools/diagnose/example.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/physics/library.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

class Example : public ::testing::TestWithParam<physics::Plant> {};

TEST_P(Example, IsAModelThatSimulatesAndNamesEveryTerm) {
  const auto text = example_model(GetParam());
  const auto model = test::model_of(text);
  EXPECT_EQ(model.plant, GetParam());
  for (const auto* info : physics::terms_of(GetParam()))
    EXPECT_THAT(text, ::testing::HasSubstr("#   " + std::string{info->name} + " (")) << info->name;
  recording::Table table;
  for (const auto& signal : model.signals) {
    std::vector<double> values(50, signal.name == "height" ? 0.01 : 0.0);
    if (signal.name == "time")
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = 0.001 * static_cast<double>(i);
    table.add(signal.column, signal.unit, values);
  }
  const auto inputs = model::to_record(table, model, true);
  physics::Outputs outputs;
  physics::prepare(model, inputs.record)->run(model, outputs);
  ASSERT_EQ(outputs.size(), model.outputs().size());
  for (const auto& output : outputs)
    for (const double v : output) ASSERT_TRUE(std::isfinite(v));
}

TEST(ExampleOfAnAxis, SaysWhatItsControllerComputes) {
  const auto text = example_model(physics::Plant::axis);
  for (const auto* said : {"u = clamp(kp e + ki sum(e) / rate + kd d, +-limit)", "kd acts on the error",
                           "a = 1 - exp(-2 pi velocity_filter_hz / rate)",
                           "u = clamp(kv (kp e - v), +-limit)", "not added where u clamps"})
    EXPECT_THAT(text, ::testing::HasSubstr(said));
}

INSTANTIATE_TEST_SUITE_P(EveryPlant, Example,
                         ::testing::Values(physics::Plant::axis, physics::Plant::thermal,
                                           physics::Plant::error_map, physics::Plant::droplet,
                                           physics::Plant::sensor, physics::Plant::equations));

}  // namespace
}  // namespace invar::diagnosis

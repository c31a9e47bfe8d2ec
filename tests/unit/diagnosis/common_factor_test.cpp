// The factor that all forces, or all heat flows, may share: it changes no output, and belief alone chooses it.
#include "core/diagnosis/estimate/common_factor.hpp"
#include "core/diagnosis/estimate/freedom.hpp"
#include "core/physics/simulation.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

using test::model_of;

double far(const physics::Model& model, const physics::Model& believed) {
  double sum = 0.0;
  for (const auto& f : freedoms(model, believed))
    if (f.sigma > 0.0) sum += 2.0 * std::log1p(std::pow((get(model, f) - f.center) / f.sigma, 2) / 3.0);
  return sum;
}

void expect_same(const physics::Model& one, const physics::Model& other, const physics::Record& inputs) {
  physics::Outputs a, b;
  physics::prepare(one, inputs)->run(one, a);
  physics::prepare(other, inputs)->run(other, b);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t o = 0; o < a.size(); ++o)
    for (std::size_t i = 0; i < a[o].size(); ++i)
      ASSERT_NEAR(a[o][i], b[o][i], 1e-9 * (1.0 + std::abs(a[o][i]))) << "output " << o << ", row " << i;
}

const std::string axis =
    "invar_model: 1\nplant: axis\ncolumns: {time: t, reference: r, position: x, current: i}\n"
    "controller: {kind: pid, rate: 1000, kp: 4000, ki: 20000, kd: 60, velocity_filter_hz: 200, limit: 8}\n"
    "parameters:\n"
    "  mass: {value: 3.2, unit: kg, sigma: 0.06}\n"
    "  motor_constant: {value: 20, unit: N/A, sigma: SIGMA}\n"
    "  viscous_damping: {value: 8, unit: N s/m, sigma: 2}\n"
    "terms:\n"
    "  - {term: stribeck_friction, coulomb: {value: 2, unit: N, sigma: 9}, static: {value: 3.5, unit: N, "
    "sigma: 9},"
    " velocity: {value: 0.01, unit: m/s, sigma: 0.01}}\n"
    "  - {term: magnetic_saturation, coefficient: {value: 0.001, unit: 1/A2, sigma: 0.1}}\n";

std::string with_sigma(const char* sigma) {
  auto text = axis;
  return text.replace(text.find("SIGMA"), 5, sigma);
}

TEST(CommonFactor, OfAllForcesComesBackToWhatWasBelieved) {
  const auto believed = model_of(with_sigma("0.2"));
  auto fitted = believed;  // as a fit may leave it: six times everything, and the motor 1 % beside
  fitted.parameters[1].value *= 1.01;
  for (const auto& f : freedoms(fitted, believed))
    if (f.where == Freedom::Where::parameter || (f.term == 0 && f.index < 2))
      set(fitted, f, 6.0 * get(fitted, f));
  const auto before = fitted;
  const auto prior = [&](const physics::Model& m) { return far(m, believed); };
  const double factor = take_common_factor(fitted, freedoms(fitted, believed), prior);
  EXPECT_NEAR(factor, 1.0 / 6.0, 0.003);
  EXPECT_LT(far(fitted, believed), 1.0);
  physics::Record inputs;
  for (int i = 0; i < 1000; ++i) {
    inputs.time.push_back(0.001 * i);
    inputs.signals["reference"].push_back(0.02 * std::sin(0.01 * i));
  }
  expect_same(before, fitted, inputs);
}

TEST(CommonFactor, IsNotChosenWhereOneForceIsKnown) {
  const auto believed = model_of(with_sigma("0"));
  auto fitted = believed;
  fitted.parameters[0].value *= 6.0;
  EXPECT_TRUE(with_common_factor(fitted, freedoms(fitted, believed)).empty());
  EXPECT_EQ(take_common_factor(fitted, freedoms(fitted, believed),
                               [&](const physics::Model& m) { return far(m, believed); }),
            1.0);
}

TEST(CommonFactor, OfHeatFlowsAndCapacitiesChangesNoTemperature) {
  const auto believed = model_of(
      "invar_model: 1\nplant: thermal\ncolumns: {time: t}\n"
      "nodes: {slide: {column: T, capacity: {value: 800, unit: J/K, sigma: 40},"
      " loss: {value: 9, unit: W/K, sigma: 0.5}}}\n"
      "heaters: {pad: {node: slide, column: P, gain: {value: 1, unit: W/W, sigma: 0.02}}}\n"
      "ambient: {value: 22, unit: degC, sigma: 0.05}\n"
      "terms: [{term: hidden_node, node: slide, capacity: {value: 300, unit: J/K, sigma: 900},"
      " conductance: {value: 2, unit: W/K, sigma: 9}}]\n");
  auto fitted = believed;
  for (const auto& f : freedoms(fitted, believed))
    if (f.where == Freedom::Where::term || fitted.parameters[f.index].name != "ambient")
      set(fitted, f, 3.0 * get(fitted, f));
  const auto before = fitted;
  EXPECT_NEAR(take_common_factor(fitted, freedoms(fitted, believed),
                                 [&](const physics::Model& m) { return far(m, believed); }),
              1.0 / 3.0, 0.01);
  physics::Record inputs;
  for (int i = 0; i < 500; ++i) {
    inputs.time.push_back(2.0 * i);
    inputs.signals["pad"].push_back((i / 100) % 2 == 0 ? 90.0 : 20.0);
  }
  expect_same(before, fitted, inputs);
}

}  // namespace
}  // namespace invar::diagnosis

// A number of which the user wrote 0 and nothing else is found, whatever its size: it is his model's, no physics left out.
#include "core/diagnosis/estimate/unknown_sizes.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/recording/table.hpp"
#include "tests/support/model_of.hpp"

namespace invar::diagnosis {
namespace {

/// A tank with a heater and a leak: x' = -0.4 x + gain u - leak, exactly solved where u is held; two cells are empty.
Case tank(double gain, double leak, const std::string& numbers) {
  std::mt19937 random{4};
  std::normal_distribution<double> noise{0.0, 0.002 * gain};
  recording::Table table;
  std::vector<double> t, u, y;
  double x = 0.0;
  constexpr double step = 0.05, rate = 0.4;
  for (int k = 0; k < 1500; ++k) {
    t.push_back(step * k), u.push_back((k / 150) % 2 == 1 ? 1.0 : 0.2);
    y.push_back(x + noise(random));
    const double end = (gain * u.back() - leak) / rate;
    x = end + (x - end) * std::exp(-rate * step);
  }
  y[40] = y[700] = std::numeric_limits<double>::quiet_NaN();
  table.add("t", "s", t);
  table.add("u", "1", u);
  table.add("y", "1", y);
  return make_case(test::model_of("invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
                                  "states: {x: {derivative: '-a*x + b*u', initial: {value: 0, sigma: 0}}}\n"
                                  "outputs: {y: {column: y, expression: x}}\n"
                                  "parameters: {a: {value: 0.41, sigma: 0.02}, " +
                                  numbers),
                   {table});
}

TEST(UnknownSizes, AGainOfWhichNothingIsKnownIsFoundWhateverItsSize) {
  for (const double gain : {3e-7, 0.5, 4e6}) {
    auto data = tank(gain, 0.0, "b: {value: 0}}\n");
    const auto d = diagnose(data, [](double, const std::string&) {});
    EXPECT_TRUE(d.findings.empty()) << gain;
    EXPECT_NEAR(d.best.model.value("b"), gain, 0.01 * gain);
    EXPECT_NEAR(d.best.model.value("a"), 0.4, 0.004) << gain;
  }
}

TEST(UnknownSizes, ALawThatStandsInTheModelWithoutItsNumberIsFound) {
  auto data =
      tank(4e5, 9e4, "b: {value: 400000, sigma: 10}}\nterms: [{term: constant, on: x, value: {value: 0}}]\n");
  const auto d = diagnose(data, [](double, const std::string&) {});
  EXPECT_TRUE(d.findings.empty());
  EXPECT_NEAR(d.best.model.terms[0].values[0], -9e4, 1e3);
}

}  // namespace
}  // namespace invar::diagnosis

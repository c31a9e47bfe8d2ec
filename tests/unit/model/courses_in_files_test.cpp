// Courses of friction and damping over the position, as model.yaml carries them.
#include <gmock/gmock.h>

#include "core/model/model_file.hpp"
#include "core/physics/library.hpp"
#include "tests/support/fault_of.hpp"

namespace invar::model {
namespace {

config::Yaml axis(const std::string& terms) {
  return config::Yaml::parse(
      "invar_model: 1\nplant: axis\ncolumns: {time: t, current: i, position: y}\nparameters:\n"
      "  mass: {value: 2, unit: kg}\n  motor_constant: {value: 10, unit: N/A}\n"
      "  viscous_damping: {value: 4, unit: N s/m}\nterms: " +
          terms + "\n",
      "model.yaml");
}

physics::Model read_all(const config::Yaml& yaml) {
  auto model = read(yaml);
  yaml.finish();
  return model;
}

TEST(CoursesInFiles, WhatAForceGoesWithComesBack) {
  for (const char* with : {"", "direction", "velocity", "acceleration"}) {
    const auto empty = axis("[]");
    auto model = read_all(empty);
    auto& term = model.terms.emplace_back();
    term.info = physics::unmodelled(physics::Plant::axis, "force");
    term.with = with;
    term.curve = {"position", {0.0, 0.1}, {1.0, 2.0}};
    const auto again = read_all(config::Yaml::parse(patched(empty, model), "patched.yaml"));
    ASSERT_EQ(again.terms.size(), 1U);
    EXPECT_EQ(again.terms[0].with, with);
    EXPECT_EQ(again.terms[0].curve.values, term.curve.values);
  }
}

TEST(CoursesInFiles, OnlyAForceGoesWithTheMotion) {
  using ::testing::HasSubstr;
  const auto fault = [](const std::string& term) {
    return testing::fault_of([&] { (void)read_all(axis("[" + term + "]")); });
  };
  EXPECT_THAT(
      fault("{term: unmodelled, site: force, with: speed, over: position, knots: [0, 1], values: [1, 2]}"),
      HasSubstr("`direction`, `velocity` or `acceleration`"));
  EXPECT_THAT(fault("{term: unmodelled, site: actuator, with: velocity, over: position, knots: [0, 1], "
                    "values: [1, 2]}"),
              HasSubstr("nothing of site `actuator` goes with `velocity`"));
  EXPECT_THAT(fault("{term: constant_force, with: velocity, force: {value: 1, unit: N}}"),
              HasSubstr("nothing of site `force` goes with `velocity`"));
}

TEST(CoursesInFiles, WhatACurveRemembersComesBack) {
  for (const auto memory : {physics::Curve::Memory::stop, physics::Curve::Memory::relaxation}) {
    const auto empty = axis("[]");
    auto model = read_all(empty);
    auto& term = model.terms.emplace_back();
    term.info = physics::unmodelled(physics::Plant::axis, "force");
    term.curve = {"position", {0.01, 0.1}, {1.0, 2.0}};
    term.curve.memory = memory;
    const auto again = read_all(config::Yaml::parse(patched(empty, model), "patched.yaml"));
    ASSERT_EQ(again.terms.size(), 1U);
    EXPECT_EQ(again.terms[0].curve.memory, memory);
    EXPECT_EQ(again.terms[0].curve.knots, term.curve.knots);
  }
}

TEST(CoursesInFiles, WhatCannotRememberIsRefused) {
  using ::testing::HasSubstr;
  const auto fault = [](const std::string& rest) {
    return testing::fault_of([&] {
      (void)read_all(axis("[{term: unmodelled, site: force, over: " + rest + ", values: [1, 2]}]"));
    });
  };
  EXPECT_THAT(fault("position, memory: long, knots: [0.1, 1]"), HasSubstr("`stop` or `relaxation`"));
  EXPECT_THAT(fault("velocity, memory: stop, knots: [0.1, 1]"), HasSubstr("a force over `position`"));
  EXPECT_THAT(fault("position, memory: stop, knots: [0, 1]"), HasSubstr("each above 0"));
}

config::Yaml tank(const std::string& term) {
  return config::Yaml::parse(
      "invar_model: 1\nplant: equations\ncolumns: {time: t}\ninputs: {u: u}\n"
      "states: {x: {derivative: 'u - x', initial: {value: 0, unit: m, sigma: 0}}}\n"
      "outputs: {level: {column: h, expression: x}}\nparameters: {}\nterms: [" +
          term + "]\n",
      "model.yaml");
}

TEST(CoursesInFiles, WhatAnOutputReadsWrongComesBack) {
  const auto empty = tank("");
  auto model = read_all(empty);
  auto& term = model.terms.emplace_back();
  term.info = physics::unmodelled(physics::Plant::equations, "output");
  term.on = "level";
  term.curve = {"t", {0.0, 10.0}, {0.0, 2.0}};
  const auto again = read_all(config::Yaml::parse(patched(empty, model), "patched.yaml"));
  ASSERT_EQ(again.terms.size(), 1U);
  EXPECT_EQ(again.terms[0].info, term.info);
  EXPECT_EQ(again.terms[0].on, "level");
  EXPECT_EQ(again.terms[0].curve.over, "t");
}

TEST(CoursesInFiles, AnOutputReadsWrongOverOneVariableOfTheModel) {
  using ::testing::HasSubstr;
  const auto fault = [](const std::string& term) {
    return testing::fault_of([&] { (void)read_all(tank(term)); });
  };
  const std::string numbers = ", knots: [0, 1], values: [1, 2]}";
  EXPECT_THAT(fault("{term: unmodelled, site: output, on: level, over: z" + numbers),
              HasSubstr("no state, no input and not t"));
  EXPECT_THAT(fault("{term: unmodelled, site: output, on: level, over: t, with: x" + numbers),
              HasSubstr("leave `with` out"));
  EXPECT_THAT(fault("{term: unmodelled, site: output, on: x, over: t" + numbers),
              HasSubstr("name an output"));
  EXPECT_THAT(fault("{term: unmodelled, site: state, on: level, over: t" + numbers),
              HasSubstr("no state and no output"));
}

}  // namespace
}  // namespace invar::model

// What holds for every term of the library: units are units, bounds hold the defaults, zero has no effect.
#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "core/base/unit.hpp"
#include "core/physics/library.hpp"
#include "core/physics/simulation.hpp"

namespace invar::physics {
namespace {

constexpr std::array plants{Plant::axis,    Plant::thermal, Plant::error_map,
                            Plant::droplet, Plant::sensor,  Plant::equations};

Model small_model(Plant plant) {
  Model model;
  model.plant = plant;
  if (plant == Plant::axis) {
    model.signals = {{"position", "", "m", true}};
    model.parameters = {{"mass", "kg", 2.0, {}, {}},
                        {"motor_constant", "N/A", 10.0, {}, {}},
                        {"viscous_damping", "N s/m", 5.0, {}, {}}};
  } else {
    model.signals = {{"a", "", "degC", true}, {"b", "", "degC", true}};
    model.thermal.nodes = {"a", "b"};
    model.thermal.heaters = {{"pad", "a"}};
    model.parameters = {{"a.capacity", "J/K", 500.0, {}, {}}, {"a.loss", "W/K", 5.0, {}, {}},
                        {"b.capacity", "J/K", 900.0, {}, {}}, {"b.loss", "W/K", 3.0, {}, {}},
                        {"pad.gain", "1", 1.0, {}, {}},       {"ambient", "degC", 22.0, {}, {}}};
  }
  return model;
}

Record excitation(Plant plant) {
  Record record;
  for (int i = 0; i < 1500; ++i) {
    const double t = plant == Plant::axis ? 1e-3 * i : 1.0 * i;
    record.time.push_back(t);
    record.signals["current"].push_back(std::sin(20.0 * t) + 0.2 * std::sin(170.0 * t));
    record.signals["pad"].push_back(i % 500 < 300 ? 60.0 : 0.0);
    record.signals["speed"].push_back(i % 400 < 200 ? 0.3 : 0.0);
    record.signals["motor_current"].push_back(i % 300 < 100 ? 2.0 : 0.5);
  }
  return record;
}

double largest_difference(const Outputs& a, const Outputs& b) {
  double most = 0.0;
  for (std::size_t o = 0; o < a.size(); ++o)
    for (std::size_t i = 0; i < a[o].size(); ++i) most = std::max(most, std::abs(a[o][i] - b[o][i]));
  return most;
}

TEST(EveryTerm, SaysItsNameSiteUnitBoundsAndSource) {
  for (const auto plant : plants) {
    std::set<std::string_view> names;
    for (const auto* info : terms_of(plant)) {
      EXPECT_TRUE(names.insert(info->name).second) << info->name;
      EXPECT_EQ(info->plant, plant) << info->name;
      EXPECT_FALSE(info->site.empty() || info->description.empty() || info->source.empty()) << info->name;
      for (std::size_t i = 0; i < info->parameter_count(); ++i) {
        const auto& p = info->parameters[i];
        EXPECT_TRUE(p.unit == "*" || parse_unit(p.unit).has_value())
            << info->name << '.' << p.name << " [" << p.unit << ']';
        EXPECT_LT(p.bounds.lower, p.bounds.upper) << info->name << '.' << p.name;
        EXPECT_TRUE(p.bounds.contains(p.starts[0])) << info->name << '.' << p.name;
        EXPECT_TRUE(p.role != Role::amplitude || p.bounds.contains(0.0)) << info->name << '.' << p.name;
      }
      EXPECT_EQ(find_term(plant, info->name), info);
    }
  }
}

class DynamicTerm : public ::testing::TestWithParam<const TermInfo*> {};

TEST_P(DynamicTerm, HasNoEffectAtZeroAndASmoothOneBesideIt) {
  const auto& info = *GetParam();
  const auto record = excitation(info.plant);
  auto model = small_model(info.plant);
  const auto simulation = prepare(model, record);
  Outputs nominal, zero, once, twice;
  simulation->run(model, nominal);
  Term term;
  term.info = &info;
  term.on = "a", term.with = "b";
  const auto with = [&](double share, Outputs& out) {
    auto changed = model;
    for (std::size_t i = 0; i < info.parameter_count(); ++i) {
      const auto& p = info.parameters[i];
      term.values[i] = p.role == Role::amplitude ? share * p.starts[0] : p.starts[0];
    }
    if (info.name == "heater_saturation") term.values[0] = 60.0 - 10.0 * share;
    changed.terms.push_back(term);
    simulation->run(changed, out);
  };
  with(0.0, zero);
  EXPECT_LT(largest_difference(zero, nominal), 1e-9) << info.name;  // sub-steps may be split otherwise
  with(1e-3, once);
  with(2e-3, twice);
  const double effect = largest_difference(once, nominal);
  EXPECT_GT(effect, 0.0) << info.name;
  EXPECT_LT(largest_difference(twice, nominal), 4.0 * effect) << info.name;  // no jump at zero
  with(1.0, once);
  EXPECT_TRUE(std::isfinite(largest_difference(once, nominal))) << info.name;
}

std::vector<const TermInfo*> dynamic_terms() {
  auto all = terms_of(Plant::axis);
  for (const auto* info : terms_of(Plant::thermal)) all.push_back(info);
  return all;
}

INSTANTIATE_TEST_SUITE_P(Library, DynamicTerm, ::testing::ValuesIn(dynamic_terms()),
                         [](const auto& of) { return std::string{of.param->name}; });

}  // namespace
}  // namespace invar::physics

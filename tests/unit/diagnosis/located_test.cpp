// A loop hides an effect in what its controller does; with the law of the controller known it is told where it enters.
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <string_view>

#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "tests/support/mismatch/marks.hpp"

namespace invar::test::mismatch {
namespace {

struct Entry {
  const char *effect, *site;
};

class Located : public ::testing::TestWithParam<Entry> {};

TEST_P(Located, InALoopActuatorPlantAndSensorAreToldApart) {
  const auto& [effect, site] = GetParam();
  for (const auto colour : {Colour::white, Colour::memory}) {
    Trouble trouble;
    trouble.colour = colour;
    trouble.rows = 6000;
    const auto machine = make("axis", effect, 1.0, 351, trouble);
    auto data = case_of(machine);
    const auto d = diagnosis::diagnose(data, [](double, const std::string&) {});
    ASSERT_FALSE(d.findings.empty()) << diagnosis::summary(data, d);
    for (const auto& finding : d.findings) {
      // What comes late by less than a millisecond may be late in the motor or in the encoder: then both must be said.
      std::set<std::string> said{diagnosis::site_of(data, finding.term)};
      if (d.verdict == diagnosis::Verdict::ambiguous && std::string_view{effect} == "amplifier_lag")
        for (const auto& other : finding.alternatives) said.insert(diagnosis::site_of(data, other.term));
      EXPECT_TRUE(said.contains(site)) << diagnosis::summary(data, d);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Axis, Located,
                         ::testing::Values(Entry{"dead_zone", "axis.actuator"},
                                           Entry{"magnetic_saturation", "axis.actuator"},
                                           Entry{"amplifier_lag", "axis.actuator"},
                                           Entry{"coulomb_friction", "axis.force"},
                                           Entry{"quadratic_drag", "axis.force"},
                                           Entry{"encoder_periodic_error", "axis.measurement"},
                                           Entry{"backlash", "axis.measurement"}),
                         [](const auto& entry) { return std::string{entry.param.effect}; });

}  // namespace
}  // namespace invar::test::mismatch

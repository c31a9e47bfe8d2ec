#include "core/dds/profile.hpp"

#include <gmock/gmock.h>

#include "core/base/fault.hpp"

namespace invar::dds {
namespace {

using ::testing::HasSubstr;

std::string fault_of(const std::string& body) {
  try {
    (void)parse_profiles("invar_profiles: 1\nprofiles:\n  p:\n    for: test\n" + body, "p.yaml");
  } catch (const InputError& error) {
    return error.faults().front().line();
  }
  return "no fault";
}

TEST(Profiles, TheStandardOnesHaveTheNamesOfTheArchitectureAndMatchThemselves) {
  for (const char* name : {"realtime", "command", "state", "calibration", "image", "event", "request"}) {
    ASSERT_TRUE(standard_profiles().contains(name)) << name;
    const Profile& p = standard_profiles().at(name);
    EXPECT_TRUE(mismatches(p, p).empty()) << name;
    EXPECT_EQ(p.name, name);
  }
  EXPECT_EQ(standard_profiles().at("realtime").traffic, Traffic::realtime);
  EXPECT_EQ(standard_profiles().at("calibration").traffic, Traffic::general);
}

TEST(Profiles, ADeadlineIsReadInItsUnit) {
  const auto profiles = parse_profiles(
      "invar_profiles: 1\nprofiles:\n  p:\n    for: test\n    reliability: reliable\n    keep_last: 5\n"
      "    durability: volatile\n    deadline: {value: 20, unit: ms}\n    lifespan: 0.5\n",
      "p.yaml");
  EXPECT_EQ(profiles.at("p").deadline.ns, 20'000'000);
  EXPECT_EQ(profiles.at("p").lifespan.ns, 500'000'000);
}

TEST(Profiles, AFaultNamesItsLineAndTheMend) {
  const std::string good = "    reliability: best_effort\n    keep_last: 1\n    durability: volatile\n";
  EXPECT_EQ(fault_of(good), "no fault");
  EXPECT_THAT(fault_of("    reliability: best_effort\n    keep_last: 1\n    durability: transient_local\n"),
              AllOf(HasSubstr("p.yaml:7"), HasSubstr("needs reliability: reliable")));
  EXPECT_THAT(fault_of(good + "    keep_all: 10\n"), HasSubstr("beside keep_all"));
  EXPECT_THAT(fault_of(good + "    strength: 3\n"), AllOf(HasSubstr("p.yaml:8"), HasSubstr("exclusive")));
  EXPECT_THAT(fault_of(good + "    liveliness: manual_by_topic\n"), HasSubstr("no lease"));
  EXPECT_THAT(fault_of(good + "    flow_bytes_per_second: 100000\n"), HasSubstr("spinning"));
  EXPECT_THAT(fault_of(good + "    lifespan: 0.1\n    deadline: 0.2\n"),
              HasSubstr("shorter than the deadline"));
  EXPECT_THAT(fault_of(good + "    deadlin: 0.2\n"), HasSubstr("deadlin"));
  EXPECT_THAT(fault_of("    reliability: besteffort\n    keep_last: 1\n    durability: volatile\n"),
              HasSubstr("p.yaml:5"));
}

/// One row a rule of DDS 1.4, table in section 2.2.3: what a writer offers, what a reader asks for, the
/// policy.
TEST(Mismatches, FollowTheRulesOfOfferAndRequest) {
  const auto policies = [](auto&& change_writer, auto&& change_reader) {
    Profile writer, reader;
    change_writer(writer);
    change_reader(reader);
    std::string all;
    for (const auto& mismatch : mismatches(writer, reader)) all += mismatch.policy + " ";
    return all;
  };
  const auto same = [](Profile&) {};
  const auto reliable = [](Profile& p) { p.reliable = true; };
  const auto kept = [](Profile& p) { p.durability = Durability::transient_local; };
  const auto deadline = [](std::int64_t ms) {
    return [ms](Profile& p) { p.deadline = Duration::milliseconds(ms); };
  };
  const auto lease = [](std::int64_t ms) {
    return [ms](Profile& p) { p.lease = Duration::milliseconds(ms); };
  };
  const auto by_topic = [](Profile& p) { p.liveliness = Liveliness::manual_by_topic; };
  const auto exclusive = [](Profile& p) { p.exclusive = true; };
  const auto in = [](std::vector<std::string> names) {
    return [names](Profile& p) { p.partitions = names; };
  };
  const auto encoded = [](std::vector<std::int16_t> kinds) {
    return [kinds](Profile& p) { p.representations = kinds; };
  };

  EXPECT_EQ(policies(same, same), "");
  EXPECT_EQ(policies(same, reliable), "reliability ");
  EXPECT_EQ(policies(reliable, same), "");
  EXPECT_EQ(policies(same, kept), "durability ");
  EXPECT_EQ(policies(kept, same), "");
  EXPECT_EQ(policies(deadline(100), deadline(50)), "deadline ");
  EXPECT_EQ(policies(deadline(50), deadline(100)), "");
  EXPECT_EQ(policies(same, deadline(100)), "deadline ");
  EXPECT_EQ(policies(deadline(100), same), "");
  EXPECT_EQ(policies(same, by_topic), "liveliness ");
  EXPECT_EQ(policies(by_topic, same), "");
  EXPECT_EQ(policies(lease(1000), lease(500)), "liveliness lease ");
  EXPECT_EQ(policies(lease(500), lease(1000)), "");
  EXPECT_EQ(policies(exclusive, same), "ownership ");
  EXPECT_EQ(policies(same, exclusive), "ownership ");
  EXPECT_EQ(policies(in({"line1"}), same), "partition ");
  EXPECT_EQ(policies(in({"line1"}), in({"line2", "line1"})), "");
  EXPECT_EQ(policies(in({"line1"}), in({"line*"})), "");
  EXPECT_EQ(policies(in({"line*"}), in({"line?"})), "partition ");
  EXPECT_EQ(policies(encoded({2}), same), "data representation ");
  EXPECT_EQ(policies(same, encoded({2})), "data representation ");
  EXPECT_EQ(policies(same, encoded({2, 0})), "");
  EXPECT_EQ(policies(same, [&](Profile& p) { reliable(p), kept(p); }), "reliability durability ");
}

TEST(Mismatches, SayBothEnds) {
  Profile writer, reader;
  writer.deadline = Duration::milliseconds(100);
  reader.deadline = Duration::milliseconds(50);
  EXPECT_EQ(mismatches(writer, reader).front().text(),
            "deadline: writer offers 100 ms, reader asks for 50 ms");
}

}  // namespace
}  // namespace invar::dds

// What `mismatches` predicts, against what Fast DDS itself does: random pairs of writer and reader.
#include <gmock/gmock.h>

#include <iostream>
#include <random>

#include "core/dds/node.hpp"
#include "domain.hpp"
#include "idl/types.hpp"

namespace invar::dds {
namespace {

using testing::eventually;
using testing::local;

Profile random_profile(std::mt19937& random) {
  const auto pick = [&random](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  Profile p;
  p.name = "random";
  p.reliable = pick(4) != 0;
  p.durability = p.reliable && pick(2) == 0 ? Durability::transient_local : Durability::volatile_;
  p.deadline = Duration::milliseconds(1000 * pick(3));  // 0: none
  p.lease = Duration::milliseconds(10'000 * (1 + pick(2)));
  p.liveliness = static_cast<Liveliness>(pick(3));
  p.exclusive = pick(6) == 0;
  const std::vector<std::vector<std::string>> partitions{{}, {}, {"line1"}, {"line1", "line2"}, {"line*"}};
  p.partitions = partitions[random() % partitions.size()];
  return p;
}

TEST(Mismatches, AgreeWithWhatFastDdsDoes) {
  const unsigned seed = std::random_device{}();
  std::cout << "seed " << seed << '\n';
  std::mt19937 random{seed};
  Node writing{local("writing"), standard_profiles()};
  Node reading{local("reading"), standard_profiles()};
  struct Trial {
    Profile offered, requested;
    std::unique_ptr<Writer<stage::AxisState>> writer;
    std::unique_ptr<Connection> reader;
    std::vector<Mismatch> found;
  };
  std::vector<Trial> trials;
  for (int i = 0; i < 60; ++i) {
    Trial t;
    t.offered = random_profile(random);
    t.requested = random_profile(random);
    if (i % 3 == 0) {  // near the offer, so that many match
      t.requested = t.offered;
      if (t.requested.deadline.ns != 0) t.requested.deadline = t.requested.deadline * 2;
      t.requested.reliable = t.requested.durability != Durability::volatile_;
    }
    t.found = mismatches(t.offered, t.requested);
    const std::string topic = "trial" + std::to_string(i);
    t.writer = std::make_unique<Writer<stage::AxisState>>(writing.writer<stage::AxisState>(topic, t.offered));
    t.reader = reading.reader<stage::AxisState>(topic, t.requested, [](const auto&) {});
    trials.push_back(std::move(t));
  }
  const auto all_expected_matched = [&] {
    for (const auto& t : trials)
      if (t.found.empty() && t.reader->matched() == 0) return false;
    return true;
  };
  EXPECT_TRUE(eventually(all_expected_matched, 10.0));
  // A last pair that matches: when it does, all before it were decided.
  const auto last_writer = writing.writer<stage::AxisState>("last", "state");
  const auto last_reader = reading.reader<stage::AxisState>("last", "state", [](const auto&) {});
  ASSERT_TRUE(eventually([&] { return last_reader->matched() == 1; }));
  std::size_t matching = 0;
  for (const auto& t : trials) {
    std::string why;
    for (const auto& mismatch : t.found) why += mismatch.text() + "; ";
    EXPECT_EQ(t.reader->matched() == 1, t.found.empty()) << why;
    matching += t.found.empty() ? 1U : 0U;
  }
  EXPECT_GE(matching, 10U);
  EXPECT_LE(matching, 50U);
}

}  // namespace
}  // namespace invar::dds

// What participants of one PC share: ports by number, memory by identity.
#include <gmock/gmock.h>

#include "core/dds/domain_ports.hpp"
#include "core/dds/reachable_memory.hpp"
#include "core/dds/shared_memory_calls.hpp"

namespace invar::dds {
namespace {

using ::testing::HasSubstr;

TEST(DomainPorts, FollowTheSpecificationAndEndBelow65536) {
  EXPECT_EQ(DomainPorts{0}.text(), "7400, 7410-7629");
  EXPECT_EQ(DomainPorts{3}.discovery(2), 7400U + 3 * 250 + 10 + 2 * 2);
  EXPECT_EQ(DomainPorts{3}.data(2), 7400U + 3 * 250 + 11 + 2 * 2);
  for (std::uint32_t domain = 0; domain <= 232; ++domain) {
    const DomainPorts ports{domain};
    EXPECT_GE(ports.participants(), 63) << domain;
    EXPECT_LE(ports.last(), 65'535U) << domain;
    EXPECT_LT(ports.last(), DomainPorts{domain + 1}.multicast()) << domain;
  }
  EXPECT_EQ(DomainPorts{232}.participants(), 63);
  EXPECT_EQ(DomainPorts{233}.participants(), 0);
}

TEST(DomainPorts, ANumberIsTakenOnceOnlyWhileItsPortsAreBound) {
  const std::int32_t one = free_participant_number(232), other = free_participant_number(232);
  EXPECT_NE(one, other);
  EXPECT_LT(std::max(one, other), 63);
}

TEST(ReachableMemory, IsThatOfOneUserInOneFolderOfOneBoot) {
  const MemoryIdentity own{10, 1000, 7, 8};
  MemoryIdentity peer{11, 1000, 7, 8};
  EXPECT_TRUE(is_reachable(own, peer));
  EXPECT_EQ(why_unreachable(own, peer), "");
  peer.user = 0;
  EXPECT_FALSE(is_reachable(own, peer));
  EXPECT_THAT(why_unreachable(own, peer), HasSubstr("as user 0, this process as user 1000"));
  peer = {11, 1000, 7, 9};
  EXPECT_FALSE(is_reachable(own, peer));
  EXPECT_THAT(why_unreachable(own, peer), HasSubstr("--ipc=host"));
  peer = {11, 1000, 6, 8};
  EXPECT_FALSE(is_reachable(own, peer)) << "another PC";
  EXPECT_EQ(why_unreachable(own, peer), "");
  peer = {11, 0, 7, 0};
  EXPECT_EQ(why_unreachable(own, peer), "") << "it does without shared memory";
}

TEST(ReachableMemory, IdentitiesTravelInTheUserData) {
  const MemoryIdentity own = own_memory_identity();
  EXPECT_NE(own.folder, 0U);
  EXPECT_EQ(memory_identity_from(to_user_data(own)), own);
  EXPECT_EQ(memory_identity_from({}), std::nullopt);
  auto cut = to_user_data(own);
  cut.pop_back();
  EXPECT_EQ(memory_identity_from(cut), std::nullopt);
}

TEST(SharedMemoryCalls, AreThoseOfThisRoom) { EXPECT_TRUE(shared_memory_calls_are_ours()); }

}  // namespace
}  // namespace invar::dds

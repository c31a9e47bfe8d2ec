// ReachableMemory: the shared-memory transport of Fast DDS, used only between processes that can open each other's memory.
#pragma once

#include <fastdds/rtps/common/Locator.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace invar::dds {

/// Identity of processes that may exchange messages by shared memory: of one boot of one PC, with the same /dev/shm, as one
/// user.
struct MemoryIdentity {
  std::int32_t process = 0;
  std::uint32_t user = 0;
  std::uint64_t boot = 0;    // of the PC; 0: unknown
  std::uint64_t folder = 0;  // of /dev/shm and of the user namespace; 0: takes part by UDP only
  bool operator==(const MemoryIdentity&) const = default;
};

/// Identity of this process; its folder is 0 where there is no /dev/shm.
[[nodiscard]] MemoryIdentity own_memory_identity();

/// The user data of our participants, by which peers know each other's process and memory; and how often they were called anew.
[[nodiscard]] std::vector<std::uint8_t> to_user_data(const MemoryIdentity& identity, std::uint8_t calls = 0);
/// Empty where the participant is not one of Invar.
[[nodiscard]] std::optional<MemoryIdentity> memory_identity_from(const std::vector<std::uint8_t>& user_data);

/// Whether both share a PC's memory, so that the process id of one means something to the other.
[[nodiscard]] bool is_reachable(const MemoryIdentity& one, const MemoryIdentity& other);
/// Why two processes of one PC that both would use shared memory cannot, and the mend. Empty where they can, where one of
/// them is on another PC, or where one does without shared memory.
[[nodiscard]] std::string why_unreachable(const MemoryIdentity& own, const MemoryIdentity& peer);

/// Fast DDS 2.9 takes every participant whose PC has the same 16-bit number for one that it reaches by shared memory. Where
/// the port's file cannot be opened nothing arrives, in silence. Where the receiver cannot open the sender's segment its
/// thread spins for ever. So our locators of shared memory carry the identity above, and another number than that of the PC.
/// Another program of Fast DDS does not use them and talks to us by UDP. We take only a locator with our own identity.
/// The type is the one by which Fast DDS knows that a participant has shared memory. A transport chained around this
/// one needs a descriptor derived from SharedMemTransportDescriptor too.
struct ReachableMemory : eprosima::fastdds::rtps::SharedMemTransportDescriptor {
  [[nodiscard]] eprosima::fastdds::rtps::TransportInterface* create_transport() const override;
  /// Where participants of this PC hear discovery by shared memory.
  [[nodiscard]] eprosima::fastrtps::rtps::LocatorList_t discovery_group(std::uint32_t port) const;
};

}  // namespace invar::dds

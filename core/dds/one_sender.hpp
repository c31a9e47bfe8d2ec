// One sender of a chained transport for a participant: it reaches every locator of its kind.
#pragma once

#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/TransportInterface.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace invar::dds {

/// Fast DDS looks for the sender by its class and does not know it behind a chained transport. It opens one more for each
/// remote locator, and every message then leaves as often. `open` opens, since the transport notes the locator there.
template <class Open>
bool open_one_sender(eprosima::fastdds::rtps::SendResourceList& senders, std::int32_t kind, Open open) {
  const auto before = static_cast<std::ptrdiff_t>(senders.size());
  const bool had_one = std::any_of(senders.begin(), senders.end(),
                                   [kind](const auto& sender) { return sender->kind() == kind; });
  const bool opened = open();
  if (had_one && opened) senders.erase(senders.begin() + before, senders.end());
  return opened;
}

}  // namespace invar::dds

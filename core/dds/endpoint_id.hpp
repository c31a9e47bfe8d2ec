// The GUID of the middleware as bytes: how shared memory knows writers and readers.
#pragma once

#include <fastdds/rtps/common/Guid.h>

#include <algorithm>

#include "core/dds/sample_ring.hpp"

namespace invar::dds {

[[nodiscard]] inline EndpointId endpoint_id(const eprosima::fastrtps::rtps::GUID_t& guid) {
  EndpointId id;
  const auto end = std::copy_n(guid.guidPrefix.value, sizeof guid.guidPrefix.value, id.begin());
  std::copy_n(guid.entityId.value, sizeof guid.entityId.value, end);
  return id;
}

}  // namespace invar::dds

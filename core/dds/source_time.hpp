// The source timestamp of samples: the clock of the process's stamps, which never goes back.
#pragma once

#include <fastdds/dds/publisher/DataWriter.hpp>

#include "core/base/clock.hpp"

namespace invar::dds {

/// `sample`: of the writer's type. False when the middleware refuses it.
inline bool write_stamped(eprosima::fastdds::dds::DataWriter& writer, void* sample) {
  constexpr std::int64_t second = 1'000'000'000;
  const Instant now = utc_now();
  const eprosima::fastrtps::Time_t time{static_cast<std::int32_t>(now.ns / second),
                                        static_cast<std::uint32_t>(now.ns % second)};
  return writer.write_w_timestamp(sample, eprosima::fastdds::dds::HANDLE_NIL, time) ==
         eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
}

}  // namespace invar::dds

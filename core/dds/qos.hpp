// From a profile to the QoS of Fast DDS, and back from what was discovered.
#pragma once

#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/publisher/qos/WriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/subscriber/qos/ReaderQos.hpp>

#include "core/dds/profile.hpp"

namespace invar::dds {

/// Every resource limit is set: the library's defaults differ between its versions.
[[nodiscard]] eprosima::fastdds::dds::DataWriterQos writer_qos(const Profile& profile);
[[nodiscard]] eprosima::fastdds::dds::DataReaderQos reader_qos(const Profile& profile);

/// QoS that an endpoint stated in discovery.
[[nodiscard]] Profile described(const eprosima::fastdds::dds::WriterQos& qos);
[[nodiscard]] Profile described(const eprosima::fastdds::dds::ReaderQos& qos);

}  // namespace invar::dds

#include "core/dds/segment_size.hpp"

#include <fastdds/dds/topic/TopicDataType.hpp>

#include <algorithm>
#include <memory>

#include "core/dds/wire_type.hpp"

namespace invar::dds {

std::uint32_t segment_size_for(const std::vector<std::type_index>& written) {
  constexpr std::uint32_t least = 1U << 20U, most = 16U << 20U, at_once = 8;
  std::uint32_t largest = 0;
  for (const auto& type : written)
    if (const WireType* known = WireTypes::all().find(type)) {
      const std::unique_ptr<eprosima::fastdds::dds::TopicDataType> support{known->make_support()};
      largest = std::max(largest, support->m_typeSize);
    }
  return std::clamp(at_once * std::min(largest, most), least, most);
}

}  // namespace invar::dds

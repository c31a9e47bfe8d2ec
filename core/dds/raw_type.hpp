// RawType: any type as the bytes that travel.
#pragma once

#include <fastdds/dds/topic/TopicDataType.hpp>

#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/dds/writer_keys.hpp"

namespace invar::dds {

/// A sample is a std::vector<std::byte> of CDR with its encapsulation. Where the type is one of WireTypes,
/// keys are computed; samples of other types all count as one instance.
class RawType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  RawType(const std::string& type, bool keyed);
  ~RawType() override;

  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override;
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override;
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override;
  void* createData() override;
  void deleteData(void* data) override;
  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle, bool force_md5) override;

 private:
  bool known_key(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle, bool force_md5);

  std::mutex mutex_;
  std::unique_ptr<eprosima::fastdds::dds::TopicDataType> known_;
  void* sample_ = nullptr;
  WriterKeys keys_;
};

}  // namespace invar::dds

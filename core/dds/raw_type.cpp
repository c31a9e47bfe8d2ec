#include "core/dds/raw_type.hpp"

#include <cstring>

#include "core/dds/wire_type.hpp"

namespace invar::dds {

namespace rtps = eprosima::fastrtps::rtps;
using Bytes = std::vector<std::byte>;

RawType::RawType(const std::string& type, bool keyed) {
  setName(type.c_str());
  m_isGetKeyDefined = keyed;
  m_typeSize = 4U << 20U;  // a bound; with dynamic histories nothing of it is reserved
  auto_fill_type_object(false);
  auto_fill_type_information(false);
  if (const WireType* wire = WireTypes::all().find(type)) {
    known_.reset(wire->make_support());
    sample_ = known_->createData();
  }
}

RawType::~RawType() {
  if (known_) known_->deleteData(sample_);
}

bool RawType::serialize(void* data, rtps::SerializedPayload_t* payload) {
  const auto& bytes = *static_cast<const Bytes*>(data);
  if (bytes.size() < 4 || bytes.size() > payload->max_size) return false;
  std::memcpy(payload->data, bytes.data(), bytes.size());
  payload->length = static_cast<std::uint32_t>(bytes.size());
  payload->encapsulation = bytes[1] == std::byte{1} ? CDR_LE : CDR_BE;
  return true;
}

bool RawType::deserialize(rtps::SerializedPayload_t* payload, void* data) {
  keys_.deserialized(*payload, data);
  const auto* bytes = reinterpret_cast<const std::byte*>(payload->data);
  static_cast<Bytes*>(data)->assign(bytes, bytes + payload->length);
  return true;
}

std::function<std::uint32_t()> RawType::getSerializedSizeProvider(void* data) {
  return [data] { return static_cast<std::uint32_t>(static_cast<const Bytes*>(data)->size()); };
}

void* RawType::createData() { return keys_.created(new Bytes); }  // NOLINT: the interface of Fast DDS
void RawType::deleteData(void* data) {
  keys_.deleted(data);
  delete static_cast<Bytes*>(data);  // NOLINT
}

bool RawType::getKey(void* data, rtps::InstanceHandle_t* handle, bool force_md5) {
  if (!m_isGetKeyDefined) return false;
  std::memset(handle->value, 0, 16);
  handle->value[0] = 1;
  const bool good = !known_ || known_key(data, handle, force_md5);
  keys_.mix(data, *handle);
  return good;
}

bool RawType::known_key(void* data, rtps::InstanceHandle_t* handle, bool force_md5) {
  auto& bytes = *static_cast<Bytes*>(data);
  rtps::SerializedPayload_t payload;
  payload.data = reinterpret_cast<rtps::octet*>(bytes.data());
  payload.length = payload.max_size = static_cast<std::uint32_t>(bytes.size());
  const std::lock_guard lock{mutex_};
  const bool good = known_->deserialize(&payload, sample_);
  payload.data = nullptr;  // not its own
  return good ? known_->getKey(sample_, handle, force_md5) : true;
}

}  // namespace invar::dds

// Type: a generated type support with its five defects mended. Register this one, never the generated one.
#pragma once

#include <fastdds/dds/topic/TopicDataType.hpp>

#include <atomic>
#include <cstdint>

#include "core/dds/writer_keys.hpp"
#include "idl/types.hpp"

namespace invar::dds {

/// Counts samples that did not decode: the middleware drops them in silence.
class Decoding {
 public:
  [[nodiscard]] std::uint64_t undecoded() const { return undecoded_.load(std::memory_order_relaxed); }

 protected:
  void count() { undecoded_.fetch_add(1, std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> undecoded_{0};
};

/// B is what fastddsgen 2.3 generates for a type, say AxisStatePubSubType.
/// - `getKey` of B works in one buffer for all threads: two threads that write two topics of one type now and
///   then swap their instances. Here each thread has a buffer of its own.
/// - `deserialize` of B lets an exception out on a malformed sample, which then stays in the reader's history
///   for ever. Here the sample is refused.
/// - B does not enforce the bounds of sequences and enumerations on what arrives. Here such a sample is
/// refused.
/// - B says `is_plain` of types whose memory differs from their CDR, which breaks loans. Here no type is
/// plain. (The fifth, a sample larger than its bound, is refused by `write`, whose result is counted.)
template <class B>
class Type final : public B, public Decoding {
 public:
  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle, bool force_md5) override {
    thread_local B own;
    if (!own.getKey(data, handle, force_md5)) return false;
    keys_.mix(data, *handle);
    return true;
  }
  void* createData() override { return keys_.created(B::createData()); }
  void deleteData(void* data) override {
    keys_.deleted(data);
    B::deleteData(data);
  }

  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    keys_.deserialized(*payload, data);
    try {
      if (B::deserialize(payload, data) && idl::within_bounds(*static_cast<typename B::type*>(data)))
        return true;
    } catch (...) {  // NOLINT: counted like the others
    }
    count();
    return false;
  }

  bool is_plain() const override { return false; }

 private:
  WriterKeys keys_;
};

}  // namespace invar::dds

// WriterKeys: the instances of a reader. Each writer has its own where ownership is exclusive, so that nothing is refused in
// silence: CommandGate decides there who is obeyed. Where the latest sample counts, foreign keys take no more than a few.
#pragma once

#include <fastdds/rtps/common/CacheChange.h>
#include <fastdds/rtps/common/InstanceHandle.h>

#include <atomic>
#include <cstddef>
#include <cstring>
#include <mutex>
#include <vector>

namespace invar::dds {

/// By default Fast DDS 2.9 drops a sample of a writer that does not own its instance without a word. For ten seconds a writer
/// that is gone still counts as the owner. Cyclone DDS takes its leave by a serialized key without a key hash, which Fast DDS
/// does not understand, and any sign of life renews the lease of all writers. Between equals the lower GUID wins, so that a
/// successor is heard or not by chance. Writers that send a key hash with every sample keep that arbitration.
///
/// A part of a type support. The history of a reader computes keys in an object that it has the type create; that object
/// is how such a reader is known here.
class WriterKeys {
 public:
  /// `by_writer`: each writer's instances are its own. `folded`: any number of keys makes `most_folded` instances. Fast DDS
  /// keeps an instance as long as its writer lives, and refuses every key beyond the limit of the reader, also the right one.
  enum class Kind { as_they_are, by_writer, folded };
  static constexpr std::uint8_t most_folded = 32;

  /// While one lives, readers that are made on this thread are of this kind.
  class Making {
   public:
    explicit Making(Kind kind) { active() = kind; }
    ~Making() { active() = Kind::as_they_are; }
    Making(const Making&) = delete;
    Making& operator=(const Making&) = delete;
    static Kind& active() {
      thread_local Kind making = Kind::as_they_are;
      return making;
    }
  };

  /// From createData, deleteData, deserialize and getKey of the type.
  void* created(void* object) {
    if (Making::active() == Kind::as_they_are) return object;
    const std::lock_guard lock{mutex_};
    entries_.push_back({object, Making::active(), {}});
    any_ = true;
    return object;
  }
  void deleted(const void* object) {
    if (!any_) return;
    const std::lock_guard lock{mutex_};
    std::erase_if(entries_, [object](const Entry& entry) { return entry.object == object; });
  }
  void deserialized(const eprosima::fastrtps::rtps::SerializedPayload_t& payload, const void* object) {
    if (!any_) return;
    const std::lock_guard lock{mutex_};
    for (Entry& entry : entries_)
      if (entry.object == object) entry.writer = change_of(payload).writerGUID;
  }
  void mix(const void* object, eprosima::fastrtps::rtps::InstanceHandle_t& handle) {
    if (!any_) return;
    const std::lock_guard lock{mutex_};
    for (const Entry& entry : entries_)
      if (entry.object == object)
        handle = entry.kind == Kind::folded ? folded(handle) : mixed(handle, entry.writer);
  }

 private:
  using Guid = eprosima::fastrtps::rtps::GUID_t;
  using Change = eprosima::fastrtps::rtps::CacheChange_t;
  struct Entry {
    const void* object;
    Kind kind;
    Guid writer;
  };

  /// A history hands over the payload of a change, never a copy.
  static const Change& change_of(const eprosima::fastrtps::rtps::SerializedPayload_t& payload) {
    static const std::ptrdiff_t offset = [] {
      const Change change;
      return reinterpret_cast<const std::byte*>(&change.serializedPayload) -
             reinterpret_cast<const std::byte*>(&change);
    }();
    return *reinterpret_cast<const Change*>(reinterpret_cast<const std::byte*>(&payload) - offset);
  }
  /// FNV-1a of instance and writer, twice.
  static eprosima::fastrtps::rtps::InstanceHandle_t mixed(
      const eprosima::fastrtps::rtps::InstanceHandle_t& handle, const Guid& writer) {
    const auto hash = [&](std::uint64_t sum) {
      const auto add = [&sum](std::uint8_t octet) { sum = (sum ^ octet) * 0x100000001B3U; };
      for (std::size_t i = 0; i < 16; ++i) add(handle.value[i]);
      for (const auto octet : writer.guidPrefix.value) add(octet);
      for (const auto octet : writer.entityId.value) add(octet);
      return sum;
    };
    const std::uint64_t halves[2] = {hash(0xCBF29CE484222325U), hash(0x9AE16A3B2F90404FU)};
    eprosima::fastrtps::rtps::InstanceHandle_t out;
    for (std::size_t i = 0; i < 16; ++i)
      out.value[i] = static_cast<std::uint8_t>(halves[i / 8] >> (8U * (i % 8)));
    return out;
  }

  static eprosima::fastrtps::rtps::InstanceHandle_t folded(
      const eprosima::fastrtps::rtps::InstanceHandle_t& handle) {
    eprosima::fastrtps::rtps::InstanceHandle_t out;
    out.value[0] =
        static_cast<std::uint8_t>(1U + mixed(handle, Guid{}).value[0] % most_folded);  // 0 is no instance
    for (std::size_t i = 1; i < 16; ++i) out.value[i] = 1;
    return out;
  }

  std::mutex mutex_;
  std::atomic<bool> any_{false};
  std::vector<Entry> entries_;
};

}  // namespace invar::dds

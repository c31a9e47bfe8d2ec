// WireType: all that the transport must know of one type, so that the rest of this room knows none.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <typeindex>
#include <vector>

#include "core/base/time.hpp"
#include "core/component/port.hpp"
#include "core/dds/sample_key.hpp"

namespace eprosima::fastdds::dds {
class DataReader;
class DataWriter;
class TopicDataType;
}  // namespace eprosima::fastdds::dds

namespace invar::dds {

class CommandGate;
class HostClocks;
class LocalReader;
class LocalWriter;

/// The samples of one output on their way to the middleware.
class Outlet {
 public:
  virtual ~Outlet() = default;
  /// Writes what the loop left in the ring; returns how many. Not on the loop's thread.
  virtual std::size_t drain() = 0;
  /// Samples lost: the ring was full, or the middleware refused them. Any thread.
  [[nodiscard]] virtual std::uint64_t lost() const = 0;
  /// Whether a sample waits for `drain`. Real-time.
  [[nodiscard]] virtual bool is_waiting() const noexcept = 0;
};

/// The samples of one input as they arrive.
class Inlet {
 public:
  virtual ~Inlet() = default;
  /// Hands over all new samples of the reader. On a thread of the middleware.
  virtual void receive(eprosima::fastdds::dds::DataReader& reader, Instant now) = 0;
  enum class Delivery { taken, refused, malformed };
  /// Hands over one sample in CDR (with encapsulation) that `writer` sent. The gate is asked for its key and its numbers
  /// only.
  virtual Delivery deliver(std::span<const std::byte> cdr, Instant now, const std::string& writer = {}) = 0;
  /// Set-up only: what a reader hands over passes it first. With `expected`, a sample of another key, or with a number that
  /// is none, is refused.
  void guard(std::shared_ptr<CommandGate> gate, std::optional<ExpectedKeys> expected = {}) {
    gate_ = std::move(gate);
    expected_ = std::move(expected);
  }
  /// Set-up only: samples of writers that `local` serves are left out of what a reader hands over.
  void prefer(std::shared_ptr<const LocalReader> local) { local_ = std::move(local); }
  /// Set-up only: stamps of samples are turned into those of this process.
  void align(const HostClocks* clocks) { clocks_ = clocks; }

 protected:
  const HostClocks* clocks_ = nullptr;
  std::shared_ptr<CommandGate> gate_;
  std::optional<ExpectedKeys> expected_;
  std::shared_ptr<const LocalReader> local_;
};

/// Takes the CDR (with encapsulation) of each sample that an output writes, on the writer's thread.
using CdrSink = std::function<void(std::span<const std::byte> cdr)>;
/// Takes a received sample and when it was sent, by the sender's clock; it lives until the call returns.
using SampleSink = std::function<void(const void* sample, Instant sent)>;

class WireType {
 public:
  virtual ~WireType() = default;
  [[nodiscard]] virtual std::string name() const = 0;
  [[nodiscard]] virtual std::type_index index() const = 0;
  /// Its samples say when they were made: `at`, an invar::base::Stamp.
  [[nodiscard]] virtual bool is_stamped() const = 0;
  /// Where `at.time_ns` stands in its CDR (with encapsulation); nothing: it has no stamp.
  [[nodiscard]] virtual std::optional<std::size_t> stamp_position() const = 0;
  /// Bytes of the largest sample on the wire.
  [[nodiscard]] virtual std::size_t largest_sample() const = 0;
  /// The member of its key beside `cell`: axis, node, sensor or component_id; empty: none.
  [[nodiscard]] virtual std::string key_part() const = 0;
  /// A type support to register; the caller owns it.
  [[nodiscard]] virtual eprosima::fastdds::dds::TopicDataType* make_support() const = 0;

  /// Through a ring of `capacity` samples that `drain` empties: nothing of the middleware on the writer's
  /// thread. Cycles that begin less than `separation` after the last one sent are left out. With `local`, samples also go
  /// through shared memory, and to the middleware only while a reader needs that.
  [[nodiscard]] virtual std::unique_ptr<Outlet> attach_paced(OutputPort& port,
                                                             eprosima::fastdds::dds::DataWriter& writer,
                                                             std::size_t capacity, Duration separation,
                                                             std::shared_ptr<LocalWriter> local) const = 0;
  /// Straight to the middleware, on the thread that writes; with `readers`, only while there are any.
  [[nodiscard]] virtual std::unique_ptr<Outlet> attach_direct(
      OutputPort& port, eprosima::fastdds::dds::DataWriter& writer, Duration separation,
      const std::atomic<std::int32_t>* readers) const = 0;
  /// `wanted` is asked before each sample; it and what `sink` refers to must outlive all writing.
  virtual void attach_cdr(OutputPort& port, std::function<bool()> wanted, CdrSink sink) const = 0;
  /// `keep`: samples stay in the reader's history (`read`), which costs no allocation; otherwise they are
  /// taken.
  [[nodiscard]] virtual std::unique_ptr<Inlet> attach(InputPort& port, bool keep) const = 0;
  [[nodiscard]] virtual std::unique_ptr<Inlet> attach(SampleSink sink, bool keep) const = 0;

  virtual bool write(eprosima::fastdds::dds::DataWriter& writer, const void* sample) const = 0;
};

/// The types of idl/, and those that an out-of-tree library adds before the node is made.
class WireTypes {
 public:
  static WireTypes& all();
  void add(std::unique_ptr<WireType> type);
  /// nullptr: unknown.
  [[nodiscard]] const WireType* find(std::type_index index) const;
  [[nodiscard]] const WireType* find(std::string_view name) const;
  [[nodiscard]] std::vector<std::string> names() const;

 private:
  WireTypes();
  std::vector<std::unique_ptr<WireType>> types_;
};

}  // namespace invar::dds

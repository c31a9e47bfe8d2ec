// TypedWire: the WireType of one C++ type and its generated type support. Only where types are registered.
#pragma once

#include <fastdds/dds/core/LoanableSequence.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include <mutex>
#include <string>

#include "core/dds/command_gate.hpp"
#include "core/dds/endpoint_id.hpp"
#include "core/dds/guid_text.hpp"
#include "core/dds/host_clocks.hpp"
#include "core/dds/local_exchange.hpp"
#include "core/dds/source_time.hpp"
#include "core/dds/type.hpp"
#include "core/dds/wire_type.hpp"

namespace invar::dds {

namespace fdds = eprosima::fastdds::dds;
using eprosima::fastrtps::types::ReturnCode_t;

/// The generated code takes void*, though it only reads. The source timestamp is that of this process's stamps, which never go
/// back: a reader that keeps the newest sample would drop all others until they are newer.
template <class T>
bool write_sample(fdds::DataWriter& writer, const T& sample) {
  return write_stamped(writer, const_cast<T*>(&sample));  // NOLINT
}

/// Leaves out cycles that come too soon after the last one sent; all samples of one cycle share its fate.
class Thinning {
 public:
  explicit Thinning(Duration separation) : separation_{separation} {}
  bool passes(Instant now) noexcept {
    if (separation_.ns == 0 || now == last_) return true;
    if (last_.ns != INT64_MIN && now - last_ + Duration::microseconds(1) < separation_) return false;
    last_ = now;
    return true;
  }

 private:
  Duration separation_;
  Instant last_{INT64_MIN};
};

template <class T, class B>
class PacedOutlet final : public Outlet {
 public:
  PacedOutlet(Output<T>& port, fdds::DataWriter& writer, std::size_t capacity, Duration separation,
              std::shared_ptr<LocalWriter> local)
      : writer_{writer}, ring_{capacity}, thinning_{separation}, local_{std::move(local)} {
    port.add_sink([this](const T& sample, Instant now) {
      if (!thinning_.passes(now)) return;
      if (local_ && local_->has_readers()) write_locally(sample);
      if (!local_ || local_->needs_middleware()) ring_.push(sample);
    });
  }
  std::size_t drain() override {
    if (local_) local_->update();
    std::size_t count = 0;
    for (; ring_.pop(sample_); ++count)
      if (!write_sample(writer_, sample_)) refused_.fetch_add(1, std::memory_order_relaxed);
    return count;
  }
  [[nodiscard]] std::uint64_t lost() const override {
    return ring_.lost() + refused_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] bool is_waiting() const noexcept override { return ring_.size() != 0; }

 private:
  /// On the loop's thread: the CDR is made in the place where readers find it.
  void write_locally(const T& sample) {
    const auto room = local_->begin();
    eprosima::fastrtps::rtps::SerializedPayload_t payload;
    payload.data = reinterpret_cast<eprosima::fastrtps::rtps::octet*>(room.data());
    payload.max_size = static_cast<std::uint32_t>(room.size());
    const bool good = type_.serialize(const_cast<T*>(&sample), &payload);  // NOLINT: it only reads
    payload.data = nullptr;                                                // not the payload's to free
    if (good) local_->commit(payload.length);
  }

  fdds::DataWriter& writer_;
  Ring<T> ring_;
  T sample_;
  Thinning thinning_;
  std::shared_ptr<LocalWriter> local_;
  Type<B> type_;
  std::atomic<std::uint64_t> refused_{0};
};

template <class T>
class DirectOutlet final : public Outlet {
 public:
  DirectOutlet(Output<T>& port, fdds::DataWriter& writer, Duration separation,
               const std::atomic<std::int32_t>* readers)
      : thinning_{separation} {
    port.add_sink([this, &writer, readers](const T& sample, Instant now) {
      if (readers != nullptr && readers->load(std::memory_order_relaxed) == 0) return;
      if (thinning_.passes(now) && !write_sample(writer, sample))
        refused_.fetch_add(1, std::memory_order_relaxed);
    });
  }
  std::size_t drain() override { return 0; }
  [[nodiscard]] std::uint64_t lost() const override { return refused_.load(std::memory_order_relaxed); }
  [[nodiscard]] bool is_waiting() const noexcept override { return false; }

 private:
  Thinning thinning_;
  std::atomic<std::uint64_t> refused_{0};
};

/// The time that a sink gets beside a sample.
enum class SinkTime { arrival, sending };

/// Several threads of the middleware (one a transport) may call; the port wants one at a time.
template <class T, class B>
class TypedInlet final : public Inlet {
 public:
  TypedInlet(Sink<T> sink, bool keep, SinkTime time = SinkTime::arrival)
      : sink_{std::move(sink)}, keep_{keep}, time_{time} {}

  void receive(fdds::DataReader& reader, Instant now) override {
    const std::lock_guard lock{mutex_};
    fdds::SampleInfo info;
    while ((keep_ ? reader.read_next_sample(&sample_, &info) : reader.take_next_sample(&sample_, &info)) ==
           ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const CommandGate::Sender sender = align(info);
      if (came_locally(info)) {
        if (keep_ && expected_ && !has_expected_key(sample_, *expected_)) drop(reader, info);  // told already
      } else if (is_obeyed(info, sender)) {
        sink_(sample_, time_ == SinkTime::arrival ? now : sent_);
      } else if (keep_) {
        drop(reader, info);
      }
    }
  }

  Delivery deliver(std::span<const std::byte> cdr, Instant now, const std::string& writer) override {
    const std::lock_guard lock{mutex_};
    eprosima::fastrtps::rtps::SerializedPayload_t payload;
    payload.data =
        reinterpret_cast<eprosima::fastrtps::rtps::octet*>(const_cast<std::byte*>(cdr.data()));  // NOLINT
    payload.length = payload.max_size = static_cast<std::uint32_t>(cdr.size());
    const bool good = type_.deserialize(&payload, &sample_);
    payload.data = nullptr;  // not ours to free
    if (!good) return Delivery::malformed;
    if (!is_sound([&writer] { return writer; })) return Delivery::refused;
    sink_(sample_, now);
    return Delivery::taken;
  }

 private:
  bool came_locally(const fdds::SampleInfo& info) const {
    return local_ && local_->serves(endpoint_id(info.sample_identity.writer_guid()));
  }

  /// Its key is one that is expected, and its numbers are numbers. `writer` is asked only where not.
  template <class Writer>
  bool is_sound(Writer writer) {
    if (!expected_) return true;
    if (!has_expected_key(sample_, *expected_)) {
      gate_->refuse(writer(), told_key(sample_, *expected_));
      return false;
    }
    if (const char* member = idl::not_finite(sample_); member != nullptr) {
      gate_->refuse(writer(), std::string{"its `"} + member + "` is no finite number: send one");
      return false;
    }
    return true;
  }
  /// Turns the stamp into that of this process, and the source timestamp too.
  CommandGate::Sender align(const fdds::SampleInfo& info) {
    sent_ = {info.source_timestamp.to_ns()};
    if (clocks_ == nullptr) return CommandGate::Sender::other;
    const std::uint64_t sender = participant_key(info.sample_identity.writer_guid().guidPrefix.value);
    if (!clocks_->knows(sender)) return CommandGate::Sender::other;
    const Duration ahead = clocks_->stamps_ahead(sender);
    sent_ = sent_ - ahead;
    if constexpr (requires { sample_.at().time_ns(); })
      if (sample_.at().time_ns() != 0) sample_.at().time_ns(earlier(sample_.at().time_ns(), ahead));
    return CommandGate::Sender::of_cell;
  }
  bool is_obeyed(const fdds::SampleInfo& info, CommandGate::Sender sender) {
    const auto writer = [&info] { return guid_text(info.sample_identity.writer_guid()); };
    if (!is_sound(writer)) return false;
    return !gate_ || !gate_->is_asked_of_all() || gate_->passes(writer(), sent_, sender);
  }
  /// A refused sample that stayed would keep its instance, and so many foreign keys leave no room for the right one.
  static void drop(fdds::DataReader& reader, const fdds::SampleInfo& info) {
    // Not by loan: the payload of a loan is no part of a change, as WriterKeys takes it to be.
    fdds::LoanableSequence<T> samples(1);
    fdds::SampleInfoSeq infos(1);
    while (reader.take_instance(samples, infos, 1, info.instance_handle) == ReturnCode_t::RETCODE_OK) {
    }
  }

  std::mutex mutex_;
  Sink<T> sink_;
  bool keep_;
  SinkTime time_;
  Instant sent_;  // the newest sample, by the clock of this process where that of its sender is known
  T sample_;
  Type<B> type_;
};

template <class T, class B>
class TypedWire final : public WireType {
 public:
  [[nodiscard]] std::string name() const override { return Type<B>{}.getName(); }
  [[nodiscard]] std::type_index index() const override { return typeid(T); }
  [[nodiscard]] bool is_stamped() const override {
    return requires(const T& sample) { sample.at().time_ns(); };
  }
  [[nodiscard]] std::optional<std::size_t> stamp_position() const override {
    if constexpr (requires(T & sample) { sample.at().time_ns(0); }) {
      T sample;
      sample.at().time_ns(0);
      const auto zero = cdr_of(sample);
      sample.at().time_ns(-1);
      const auto ones = cdr_of(sample);
      return static_cast<std::size_t>(std::mismatch(zero.begin(), zero.end(), ones.begin()).first -
                                      zero.begin());
    }
    return std::nullopt;
  }
  [[nodiscard]] std::size_t largest_sample() const override { return Type<B>{}.m_typeSize; }
  [[nodiscard]] std::string key_part() const override {
    const char* name = dds::key_part(T{}).first;
    return name == nullptr ? "" : name;
  }
  [[nodiscard]] fdds::TopicDataType* make_support() const override {
    auto* type = new Type<B>;            // NOLINT: Fast DDS takes it over
    type->auto_fill_type_object(false);  // Cyclone DDS would refuse the endpoint
    type->auto_fill_type_information(false);
    return type;
  }

  [[nodiscard]] std::unique_ptr<Outlet> attach_paced(OutputPort& port, fdds::DataWriter& writer,
                                                     std::size_t capacity, Duration separation,
                                                     std::shared_ptr<LocalWriter> local) const override {
    return std::make_unique<PacedOutlet<T, B>>(static_cast<Output<T>&>(port), writer, capacity, separation,
                                               std::move(local));
  }
  [[nodiscard]] std::unique_ptr<Outlet> attach_direct(
      OutputPort& port, fdds::DataWriter& writer, Duration separation,
      const std::atomic<std::int32_t>* readers) const override {
    return std::make_unique<DirectOutlet<T>>(static_cast<Output<T>&>(port), writer, separation, readers);
  }
  void attach_cdr(OutputPort& port, std::function<bool()> wanted, CdrSink sink) const override {
    auto type = std::make_shared<Type<B>>();
    auto payload = std::make_shared<eprosima::fastrtps::rtps::SerializedPayload_t>();
    static_cast<Output<T>&>(port).add_sink(
        [type, payload, wanted = std::move(wanted), sink = std::move(sink)](const T& sample, Instant) {
          if (!wanted()) return;
          void* data = const_cast<T*>(&sample);  // NOLINT
          payload->reserve(type->getSerializedSizeProvider(data)());
          if (type->serialize(data, payload.get()))
            sink({reinterpret_cast<const std::byte*>(payload->data), payload->length});
        });
  }
  [[nodiscard]] std::unique_ptr<Inlet> attach(InputPort& port, bool keep) const override {
    if (port.direction() == Port::Direction::inbox)
      return std::make_unique<TypedInlet<T, B>>(static_cast<Inbox<T>&>(port).add_lane(), keep);
    auto* input = &static_cast<Input<T>&>(port);
    return std::make_unique<TypedInlet<T, B>>(
        [input](const T& sample, Instant now) { input->accept(sample, now); }, keep);
  }
  [[nodiscard]] std::unique_ptr<Inlet> attach(SampleSink sink, bool keep) const override {
    return std::make_unique<TypedInlet<T, B>>(
        [sink = std::move(sink)](const T& sample, Instant sent) { sink(&sample, sent); }, keep,
        SinkTime::sending);
  }
  bool write(fdds::DataWriter& writer, const void* sample) const override {
    return write_sample(writer, *static_cast<const T*>(sample));
  }

 private:
  static std::vector<eprosima::fastrtps::rtps::octet> cdr_of(T& sample) {
    Type<B> type;
    eprosima::fastrtps::rtps::SerializedPayload_t payload{type.getSerializedSizeProvider(&sample)()};
    (void)type.serialize(&sample, &payload);
    return {payload.data, payload.data + payload.length};
  }
};

/// For an out-of-tree library with IDL of its own: add_wire_type<plant::Thing, plant::ThingPubSubType>().
/// within_bounds and not_finite must be found for T, as list_types.py writes them.
template <class T, class B>
void add_wire_type() {
  WireTypes::all().add(std::make_unique<TypedWire<T, B>>());
}

}  // namespace invar::dds

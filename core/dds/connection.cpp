#include "core/dds/connection.hpp"

#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include <mutex>
#include <sstream>

#include "core/dds/endpoint_id.hpp"
#include "core/dds/guid_text.hpp"
#include "core/dds/host_clocks.hpp"
#include "core/dds/raw_type.hpp"
#include "core/dds/source_time.hpp"

namespace invar::dds {

using eprosima::fastrtps::types::ReturnCode_t;

namespace {

std::size_t readers_of(fdds::DataWriter& writer) {
  fdds::PublicationMatchedStatus status;
  writer.get_publication_matched_status(status);
  return static_cast<std::size_t>(status.current_count);
}

bool wait_for(fdds::DataWriter& writer, Duration patience) {
  const eprosima::fastrtps::Duration_t time{static_cast<std::int32_t>(patience.ns / 1'000'000'000),
                                            static_cast<std::uint32_t>(patience.ns % 1'000'000'000)};
  return writer.wait_for_acknowledgments(time) == ReturnCode_t::RETCODE_OK;
}

}  // namespace

WriterConnection::WriterConnection(Participant& participant, const std::string& topic, const WireType& type,
                                   const Profile& profile)
    : participant_{participant},
      type_{type},
      writer_{&participant.create_writer(topic, type.make_support(), profile, this)} {}

WriterConnection::~WriterConnection() {
  writer_->set_listener(nullptr);
  participant_.remove(*writer_);
}

std::shared_ptr<LocalWriter> WriterConnection::share(LocalExchange& exchange) {
  const std::lock_guard lock{local_mutex_};
  local_ = exchange.writer(endpoint_id(writer_->guid()), type_.largest_sample());
  for (const EndpointId& reader : matched_)
    if (local_) local_->matched(reader);
  return local_;
}

void WriterConnection::on_publication_matched(fdds::DataWriter*,
                                              const fdds::PublicationMatchedStatus& status) {
  readers_ = status.current_count;
  const EndpointId reader =
      endpoint_id(eprosima::fastrtps::rtps::iHandle2GUID(status.last_subscription_handle));
  const std::lock_guard lock{local_mutex_};
  if (status.current_count_change > 0) {
    matched_.insert(reader);
    if (local_) local_->matched(reader);
  } else if (status.current_count_change < 0) {
    matched_.erase(reader);
    if (local_) local_->unmatched(reader);
  }
}

std::size_t WriterConnection::matched() const { return static_cast<std::size_t>(readers_.load()); }

bool WriterConnection::write(const void* sample) {
  const bool written = type_.write(*writer_, sample);
  if (!written) ++refused_;
  return written;
}

bool WriterConnection::wait_for_acknowledgments(Duration patience) { return wait_for(*writer_, patience); }

void WriterConnection::forget() {
  std::size_t removed = 0;
  (void)writer_->clear_history(&removed);
}

ReaderConnection::ReaderConnection(Participant& participant, const std::string& topic,
                                   fdds::TopicDataType* type, const Profile& profile, Discovery& discovery,
                                   Receive receive, std::shared_ptr<CommandGate> gate,
                                   std::shared_ptr<LocalReader> local)
    : participant_{participant},
      discovery_{discovery},
      topic_{topic},
      receive_{std::move(receive)},
      gate_{std::move(gate)},
      local_{std::move(local)},
      reader_{&participant.create_reader(topic, type, profile, this)} {}

ReaderConnection::~ReaderConnection() {
  reader_->set_listener(nullptr);
  if (local_) local_->end();
  participant_.remove(*reader_);
}

std::size_t ReaderConnection::matched() const { return static_cast<std::size_t>(matched_.load()); }

void ReaderConnection::on_subscription_matched(fdds::DataReader* reader,
                                               const fdds::SubscriptionMatchedStatus& status) {
  matched_ = status.current_count;
  const auto guid = eprosima::fastrtps::rtps::iHandle2GUID(status.last_publication_handle);
  if (local_ && status.current_count_change > 0)
    local_->matched(endpoint_id(guid), endpoint_id(reader->guid()));
  if (status.current_count_change >= 0) return;
  if (local_) local_->unmatched(endpoint_id(guid));
  const std::string writer = guid_text(guid);
  if (gate_) gate_->gone(writer);
  const std::lock_guard lock{silent_mutex_};
  silent_.erase(writer);
}

void ReaderConnection::on_liveliness_changed(fdds::DataReader*, const fdds::LivelinessChangedStatus& status) {
  if (status.not_alive_count_change <= 0) return;
  const std::string writer =
      guid_text(eprosima::fastrtps::rtps::iHandle2GUID(status.last_publication_handle));
  if (gate_) gate_->gone(writer);
  // Fast DDS takes a silent writer for alive again whenever another one shows life: told once.
  const std::lock_guard lock{silent_mutex_};
  if (silent_.insert(writer).second)
    discovery_.raise({topic_, "a writer of `" + topic_ + "` (" +
                                  discovery_.name_of(discovery_.claimant(writer).participant) +
                                  ") went silent: its liveliness lease ran out"});
}

RawWriterConnection::RawWriterConnection(Participant& participant, const std::string& topic,
                                         const std::string& type, const Profile& profile)
    : participant_{participant},
      writer_{&participant.create_writer(topic, new RawType{type, true}, profile)} {}

RawWriterConnection::~RawWriterConnection() { participant_.remove(*writer_); }

std::size_t RawWriterConnection::matched() const { return readers_of(*writer_); }

bool RawWriterConnection::write(const void* span) {
  const auto& bytes = *static_cast<const std::span<const std::byte>*>(span);
  std::vector<std::byte> copy{bytes.begin(), bytes.end()};
  const bool written = write_stamped(*writer_, &copy);
  if (!written) ++refused_;
  return written;
}

bool RawWriterConnection::wait_for_acknowledgments(Duration patience) { return wait_for(*writer_, patience); }

ReaderConnection::Receive raw_receiver(std::function<void(const RawSample&)> take) {
  struct State {
    std::mutex mutex;
    std::vector<std::byte> bytes;
    std::ostringstream writer;
  };
  return [take = std::move(take), state = std::make_shared<State>()](fdds::DataReader& reader) {
    const std::lock_guard lock{state->mutex};
    fdds::SampleInfo info;
    while (reader.take_next_sample(&state->bytes, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      state->writer.str("");
      state->writer << info.sample_identity.writer_guid();
      const std::string writer = state->writer.str();
      take({.cdr = state->bytes,
            .sent_ns = info.source_timestamp.to_ns(),
            .sequence = info.sample_identity.sequence_number().to64long(),
            .writer = writer,
            .participant = participant_key(info.sample_identity.writer_guid().guidPrefix.value)});
    }
  };
}

}  // namespace invar::dds

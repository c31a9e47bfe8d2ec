#include "tests/support/rtps_tap.hpp"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/participant/ParticipantDiscoveryInfo.h>
#include <fastdds/rtps/reader/ReaderDiscoveryInfo.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include <random>
#include <span>

#include "core/dds/raw_type.hpp"
#include "core/dds/rtps_message.hpp"
#include "core/dds/sequence_guard.hpp"

namespace invar::testing {

namespace fdds = eprosima::fastdds::dds;
namespace transport = eprosima::fastdds::rtps;
namespace rtps = eprosima::fastrtps::rtps;

namespace {

class Tap final : public transport::ChainingTransport {
 public:
  Tap(const transport::ChainingTransportDescriptor& chain, std::shared_ptr<Messages> messages, unsigned loss)
      : ChainingTransport{chain},
        below_{chain.low_level_descriptor},
        messages_{std::move(messages)},
        loss_{loss} {}
  transport::TransportDescriptorInterface* get_configuration() override { return below_.get(); }
  bool send(rtps::SenderResource* below, const rtps::octet* data, std::uint32_t size,
            rtps::LocatorsIterator* begin, rtps::LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& timeout) override {
    if (!messages_->guarded) messages_->add(data, size);
    return below->send(data, size, begin, end, timeout);
  }
  void receive(transport::TransportReceiverInterface* next, const rtps::octet* data, std::uint32_t size,
               const rtps::Locator_t& local, const rtps::Locator_t& remote) override {
    if (messages_->guarded) {
      dds::RtpsContent content;
      const auto message = std::as_bytes(std::span{data, size});
      if (examine(message, {}, guard_, content) != dds::Flaw::none || content.hidden_count > 0) return;
      size = static_cast<std::uint32_t>(content.size);
    } else {
      messages_->add(data, size);
    }
    thread_local std::minstd_rand dice{1};
    if (dice() % 100 >= loss_) next->OnDataReceived(data, size, local, remote);
  }

 private:
  std::shared_ptr<transport::TransportDescriptorInterface> below_;
  std::shared_ptr<Messages> messages_;
  unsigned loss_;
  dds::SequenceGuard guard_;
};

struct TapDescriptor final : transport::ChainingTransportDescriptor {
  using ChainingTransportDescriptor::ChainingTransportDescriptor;
  std::shared_ptr<Messages> messages;
  unsigned loss = 0;
  std::uint32_t largest = 0;
  [[nodiscard]] transport::TransportInterface* create_transport() const override {
    return new Tap{*this, messages, loss};
  }
  [[nodiscard]] std::uint32_t max_message_size() const override { return largest; }
};

}  // namespace

void Messages::add(const void* data, std::size_t size) {
  constexpr std::size_t most_of_a_kind = 24;
  constexpr std::size_t most = 4000;
  const auto* bytes = static_cast<const std::byte*>(data);
  // The kind: that of the submessage behind those that say for whom and when.
  std::uint8_t kind = 0;
  for (std::size_t at = 20; at + 4 <= size;) {
    kind = static_cast<std::uint8_t>(bytes[at]);
    if (kind != 0x0e && kind != 0x09) break;
    at +=
        4 + (std::to_integer<std::size_t>(bytes[at + 2]) | std::to_integer<std::size_t>(bytes[at + 3]) << 8U);
  }
  const std::lock_guard lock{mutex_};
  if (messages_.size() < most && kept_[{kind, size}]++ < most_of_a_kind)
    messages_.emplace_back(bytes, bytes + size);
}

std::vector<Message> Messages::all() const {
  const std::lock_guard lock{mutex_};
  return messages_;
}

RtpsTap::RtpsTap(std::uint32_t domain, const std::string& address, unsigned loss, std::uint32_t largest) {
  fdds::DomainParticipantQos qos;
  qos.name("tap");
  qos.transport().use_builtin_transports = false;
  auto udp = std::make_shared<transport::UDPv4TransportDescriptor>();
  if (!address.empty()) udp->interfaceWhiteList = {address};
  udp->sendBufferSize = udp->receiveBufferSize = 4U << 20U;
  auto tap = std::make_shared<TapDescriptor>(udp);
  tap->messages = messages_;
  tap->loss = loss;
  tap->largest = largest;
  qos.transport().user_transports.push_back(tap);
  participant_ = fdds::DomainParticipantFactory::get_instance()->create_participant(domain, qos, this,
                                                                                    fdds::StatusMask::none());
  publisher_ = participant_->create_publisher(fdds::PUBLISHER_QOS_DEFAULT);
  subscriber_ = participant_->create_subscriber(fdds::SUBSCRIBER_QOS_DEFAULT);
}

RtpsTap::~RtpsTap() {
  participant_->set_listener(nullptr);
  participant_->delete_contained_entities();
  fdds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

void RtpsTap::join() {
  std::set<Wanted> to_read, to_write;
  {
    const std::lock_guard lock{mutex_};
    to_read = written_;
    to_write = read_;
  }
  const auto topic_of = [this](const Wanted& wanted) {
    fdds::Topic*& topic = topics_[wanted.topic];
    if (topic != nullptr) return topic;
    if (participant_->find_type(wanted.type).empty())
      fdds::TypeSupport{new dds::RawType{wanted.type, wanted.keyed}}.register_type(participant_);
    topic = participant_->create_topic(wanted.topic, wanted.type, fdds::TOPIC_QOS_DEFAULT);
    return topic;
  };
  const auto set = [](auto& qos, const Wanted& wanted) {
    qos.reliability().kind =
        wanted.reliable ? fdds::RELIABLE_RELIABILITY_QOS : fdds::BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind =
        wanted.transient ? fdds::TRANSIENT_LOCAL_DURABILITY_QOS : fdds::VOLATILE_DURABILITY_QOS;
    qos.ownership().kind = wanted.exclusive ? fdds::EXCLUSIVE_OWNERSHIP_QOS : fdds::SHARED_OWNERSHIP_QOS;
    qos.data_sharing().off();
    qos.endpoint().history_memory_policy = rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
  };
  for (const Wanted& wanted : to_read) {
    if (!reading_.insert(wanted).second || topic_of(wanted) == nullptr) continue;
    fdds::DataReaderQos qos;
    set(qos, wanted);
    subscriber_->create_datareader(topic_of(wanted), qos);
  }
  for (const Wanted& wanted : to_write) {
    if (!writing_.insert(wanted).second || topic_of(wanted) == nullptr) continue;
    fdds::DataWriterQos qos;
    set(qos, wanted);
    qos.ownership_strength().value = 1;
    qos.deadline().period = {0, 50'000'000};
    qos.liveliness().lease_duration = {1, 0};
    qos.liveliness().announcement_period = {0, 300'000'000};
    if (auto* writer = publisher_->create_datawriter(topic_of(wanted), qos)) writers_.push_back(writer);
  }
}

void RtpsTap::write() {
  std::vector<std::byte> sample(64);
  sample[1] = std::byte{1};
  for (auto* writer : writers_) writer->write(&sample);
}

std::vector<std::uint16_t> RtpsTap::ports() const {
  const std::lock_guard lock{mutex_};
  return {ports_.begin(), ports_.end()};
}

void RtpsTap::on_participant_discovery(fdds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& info) {
  const std::lock_guard lock{mutex_};
  for (const auto* list : {&info.info.metatraffic_locators.unicast, &info.info.default_locators.unicast})
    for (const auto& locator : *list)
      if (locator.kind == LOCATOR_KIND_UDPv4) ports_.insert(rtps::IPLocator::getPhysicalPort(locator));
}

void RtpsTap::on_publisher_discovery(fdds::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) {
  const auto& qos = info.info.m_qos;
  const std::lock_guard lock{mutex_};
  written_.insert({info.info.topicName().c_str(), info.info.typeName().c_str(),
                   qos.m_reliability.kind == fdds::RELIABLE_RELIABILITY_QOS,
                   qos.m_durability.kind != fdds::VOLATILE_DURABILITY_QOS,
                   info.info.topicKind() == rtps::WITH_KEY,
                   qos.m_ownership.kind == fdds::EXCLUSIVE_OWNERSHIP_QOS});
}

void RtpsTap::on_subscriber_discovery(fdds::DomainParticipant*, rtps::ReaderDiscoveryInfo&& info) {
  const auto& qos = info.info.m_qos;
  const std::lock_guard lock{mutex_};
  read_.insert({info.info.topicName().c_str(), info.info.typeName().c_str(),
                qos.m_reliability.kind == fdds::RELIABLE_RELIABILITY_QOS,
                qos.m_durability.kind != fdds::VOLATILE_DURABILITY_QOS,
                info.info.topicKind() == rtps::WITH_KEY,
                qos.m_ownership.kind == fdds::EXCLUSIVE_OWNERSHIP_QOS});
}

}  // namespace invar::testing

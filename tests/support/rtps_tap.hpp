// RtpsTap: a participant of Fast DDS, at first without the filter, that keeps the messages it sends and receives.
#pragma once

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace invar::testing {

using Message = std::vector<std::byte>;

/// Messages, each once; safe for any thread.
class Messages {
 public:
  void add(const void* data, std::size_t size);
  [[nodiscard]] std::vector<Message> all() const;
  std::atomic<bool> guarded{false};  // the tap takes only what the filter lets through

 private:
  mutable std::mutex mutex_;
  std::vector<Message> messages_;
  std::map<std::pair<std::uint8_t, std::size_t>, std::size_t> kept_;  // of each size and kind a few
};

/// Takes part in a domain by UDP, and reads and writes every topic that others write and read.
class RtpsTap final : private eprosima::fastdds::dds::DomainParticipantListener {
 public:
  /// `loss`: of a hundred received messages so many are lost, so that peers send again. `largest`: message that is sent [bytes].
  RtpsTap(std::uint32_t domain, const std::string& address, unsigned loss = 0,
          std::uint32_t largest = 65'500);
  ~RtpsTap() override;

  /// Creates the readers and writers that discovery has called for since the last call.
  void join();
  /// From now on it takes only what the filter lets through, and keeps nothing more.
  void guard() { messages_->guarded = true; }
  /// Writes 64 octets that mean nothing on each topic.
  void write();
  [[nodiscard]] std::vector<Message> messages() const { return messages_->all(); }
  /// Ports at which others hear discovery and data.
  [[nodiscard]] std::vector<std::uint16_t> ports() const;

 private:
  struct Wanted {
    std::string topic, type;
    bool reliable = false, transient = false, keyed = false, exclusive = false;
    bool operator<(const Wanted& other) const {
      return std::tie(topic, type) < std::tie(other.topic, other.type);
    }
  };
  void on_participant_discovery(eprosima::fastdds::dds::DomainParticipant*,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void on_publisher_discovery(eprosima::fastdds::dds::DomainParticipant*,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
  void on_subscriber_discovery(eprosima::fastdds::dds::DomainParticipant*,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;

  std::shared_ptr<Messages> messages_ = std::make_shared<Messages>();
  mutable std::mutex mutex_;
  std::set<Wanted> written_, read_;  // by others
  std::set<std::uint16_t> ports_;
  std::map<std::string, eprosima::fastdds::dds::Topic*> topics_;
  std::set<Wanted> reading_, writing_;
  std::vector<eprosima::fastdds::dds::DataWriter*> writers_;
  eprosima::fastdds::dds::Publisher* publisher_ = nullptr;
  eprosima::fastdds::dds::Subscriber* subscriber_ = nullptr;
  eprosima::fastdds::dds::DomainParticipant* participant_ = nullptr;
};

}  // namespace invar::testing

// Participant: one participant of Fast DDS - its transports, its topics, what it discovers.
#pragma once

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/dds/discovery.hpp"
#include "core/dds/holder_id.hpp"
#include "core/dds/node.hpp"
#include "core/dds/profile.hpp"
#include "core/dds/reachable_memory.hpp"
#include "core/dds/receive_filter.hpp"

namespace invar::dds {

namespace fdds = eprosima::fastdds::dds;

class Participant final : private fdds::DomainParticipantListener {
 public:
  /// Throws InputError when Fast DDS refuses, for instance an address that this PC does not have.
  Participant(const NodeOptions& options, Traffic traffic, const Profiles& profiles, Discovery& discovery);
  ~Participant() override;
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  /// The type support goes to the participant, which keeps the first of each name. Set-up only, not in
  /// listeners.
  fdds::DataWriter& create_writer(const std::string& topic, fdds::TopicDataType* type, const Profile& profile,
                                  fdds::DataWriterListener* listener = nullptr);
  fdds::DataReader& create_reader(const std::string& topic, fdds::TopicDataType* type, const Profile& profile,
                                  fdds::DataReaderListener* listener);
  void remove(fdds::DataWriter& writer);
  void remove(fdds::DataReader& reader);
  /// Announces itself at once to all peers. Any thread.
  void call_peers();
  [[nodiscard]] const eprosima::fastrtps::rtps::GUID_t& id() const { return participant_->guid(); }
  /// A process of this PC that takes part in the cell ended without taking leave (it was killed, or crashed), and its lease
  /// has not run out yet. Any thread.
  [[nodiscard]] bool has_dead_peer() const;
  /// Messages that arrived and were kept from the middleware. Any thread.
  [[nodiscard]] const Reception& reception() const { return *reception_; }
  /// Nothing of these holders of certificates is taken any more. Names those that take part now; this participant's own is among
  /// them where it is revoked itself. Any thread.
  std::vector<std::string> revoke(const std::vector<HolderId>& holders);

 private:
  [[noreturn]] void refuse(const char* what, const std::string& topic) const;
  fdds::Topic* topic(const std::string& name, fdds::TopicDataType* type);
  fdds::Publisher* publisher(const std::vector<std::string>& partitions);
  fdds::Subscriber* subscriber(const std::vector<std::string>& partitions);

  void on_participant_discovery(fdds::DomainParticipant*,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void on_publisher_discovery(fdds::DomainParticipant*,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
  void on_subscriber_discovery(fdds::DomainParticipant*,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;

  Discovery& discovery_;
  std::string name_;
  std::shared_ptr<Reception> reception_;
  MemoryIdentity identity_;
  std::string owner_;  // of the certificate; empty: none
  std::uint8_t calls_ = 0;
  fdds::DomainParticipant* participant_ = nullptr;
  std::mutex mutex_;
  mutable std::mutex peers_mutex_;
  std::map<std::string, std::int32_t> peers_;  // their process ids on this PC, by participant
  std::map<HolderId, std::string> holders_;    // names of those that were found
  std::map<std::vector<std::string>, fdds::Publisher*> publishers_;
  std::map<std::vector<std::string>, fdds::Subscriber*> subscribers_;
};

}  // namespace invar::dds

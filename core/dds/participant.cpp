#include "core/dds/participant.hpp"

#include <fastdds/rtps/participant/ParticipantDiscoveryInfo.h>
#include <fastdds/rtps/reader/ReaderDiscoveryInfo.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <pthread.h>
#include <unistd.h>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include <algorithm>
#include <set>
#include <span>
#include <string_view>

#include "core/base/clock.hpp"
#include "core/base/contract.hpp"
#include "core/base/fault.hpp"
#include "core/dds/datagram_size.hpp"
#include "core/dds/domain_ports.hpp"
#include "core/dds/guid_text.hpp"
#include "core/dds/live_process.hpp"
#include "core/dds/memory_plan.hpp"
#include "core/dds/middleware_log.hpp"
#include "core/dds/own_address.hpp"
#include "core/dds/promised_address.hpp"
#include "core/dds/qos.hpp"
#include "core/dds/raw_type.hpp"
#include "core/dds/reachable_memory.hpp"
#include "core/dds/rtps_bytes.hpp"
#include "core/dds/shared_memory_calls.hpp"
#include "core/dds/type.hpp"
#include "core/dds/writer_keys.hpp"

namespace invar::dds {

namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::types::ReturnCode_t;

namespace {

/// The library's threads inherit policy and priority of the thread that creates the participant.
class Priority {
 public:
  explicit Priority(int priority) {
    if (priority <= 0) return;
    pthread_getschedparam(pthread_self(), &policy_, &parameters_);
    sched_param raised{};
    raised.sched_priority = priority;
    // Where it is not allowed the executor's own request is not either, and its status says so.
    changed_ = pthread_setschedparam(pthread_self(), SCHED_FIFO, &raised) == 0;
  }
  ~Priority() {
    if (changed_) pthread_setschedparam(pthread_self(), policy_, &parameters_);
  }
  Priority(const Priority&) = delete;
  Priority& operator=(const Priority&) = delete;

 private:
  bool changed_ = false;
  int policy_ = 0;
  sched_param parameters_{};
};

std::vector<PeerAddress> addresses_of(const rtps::ParticipantProxyData& peer) {
  std::vector<PeerAddress> addresses;
  for (const auto& locator : peer.metatraffic_locators.unicast)
    if (locator.kind == LOCATOR_KIND_UDPv4)
      addresses.push_back(
          {rtps::IPLocator::toIPv4string(locator), rtps::IPLocator::getPhysicalPort(locator)});
  return addresses;
}

GuidPrefix prefix_of(const rtps::GUID_t& guid) {
  GuidPrefix prefix;
  std::memcpy(prefix.data(), guid.guidPrefix.value, prefix.size());
  return prefix;
}

std::uint32_t entity_of(const rtps::GUID_t& guid) {
  return RtpsBytes{std::as_bytes(std::span{guid.entityId.value}), false}.entity();
}

/// A sample takes half of the segment at most; ports that belong to another domain are not this one's.
RtpsLimits limits_of(const NodeOptions& options) {
  const std::uint32_t first = DomainPorts{options.domain}.multicast();
  // The sender's segment counts, and the largest is that of a process with a camera.
  return {NodeOptions{}.segment_size / 2, first, first + 249U, options.identity.has_value()};
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

/// Processes of one PC hear each other also while its network is away.
std::vector<std::string> with_loopback(std::vector<std::string> addresses) {
  constexpr const char* loopback = "127.0.0.1";
  if (!addresses.empty() && std::find(addresses.begin(), addresses.end(), loopback) == addresses.end())
    addresses.emplace_back(loopback);
  return addresses;
}

/// Of the numbers that others call on this PC; 0: they call none.
std::int32_t called_numbers_here(const NodeOptions& options) {
  for (const PeerHost& peer : options.peers)
    if (std::find(options.addresses.begin(), options.addresses.end(), peer.address) !=
        options.addresses.end())
      return called_numbers(options.domain, peer.processes);
  return 0;
}

rtps::Locator_t udp_locator(const std::string& address, std::uint32_t port) {
  rtps::Locator_t locator;
  rtps::IPLocator::createLocator(LOCATOR_KIND_UDPv4, address, port, locator);
  return locator;
}

/// Where a participant announces itself: each place on each host of the cell where one may listen, and the groups. Empty: the
/// groups alone, as Fast DDS has it.
rtps::LocatorList_t called_peers(const NodeOptions& options, const MemorySizes& memory) {
  rtps::LocatorList_t list;
  if (options.peers.empty()) return list;
  const DomainPorts ports{options.domain};
  for (const PeerHost& peer : options.peers)
    for (std::int32_t n = 0; n < called_numbers(options.domain, peer.processes); ++n)
      list.push_back(udp_locator(peer.address, ports.discovery(n)));
  list.push_back(udp_locator("239.255.0.1", ports.multicast()));
  if (memory.any()) list.push_back(ReachableMemory{}.discovery_group(ports.multicast()));
  return list;
}

fdds::DomainParticipantQos participant_qos(const NodeOptions& options, const std::string& name,
                                           Traffic traffic, const Profiles& profiles,
                                           const std::shared_ptr<Reception>& reception,
                                           const MemoryIdentity& identity, const MemorySizes& memory) {
  namespace transport = eprosima::fastdds::rtps;
  fdds::DomainParticipantQos qos;
  qos.name(name);
  qos.user_data().data_vec(to_user_data(identity));
  qos.transport().use_builtin_transports = false;
  qos.wire_protocol().participant_id = free_participant_number(options.domain, called_numbers_here(options));
  const bool realtime = traffic == Traffic::realtime;
  if (memory.any()) {
    auto shm = std::make_shared<Filtered<ReachableMemory>>();
    shm->reception = reception;
    shm->segment_size(memory.segment);
    shm->max_message_size(memory.message);
    shm->port_queue_capacity(MemorySizes::queue);
    qos.transport().user_transports.push_back(shm);
  }
  auto udp = std::make_shared<Filtered<transport::UDPv4TransportDescriptor>>();
  udp->reception = reception;
  // A handshake carries certificate and permissions in one message, which Fast DDS does not part: the network does.
  udp->largest_sent = options.identity ? 0 : largest_datagram(options.addresses);
  udp->interfaceWhiteList = with_loopback(options.addresses);
  udp->parts_loopback = udp->interfaceWhiteList.size() > options.addresses.size();
  udp->non_blocking_send = realtime;
  udp->sendBufferSize = udp->receiveBufferSize = realtime ? 1U << 20U : 8U << 20U;
  qos.transport().user_transports.push_back(udp);
  qos.transport().listen_socket_buffer_size = realtime ? 1U << 20U : 8U << 20U;
  qos.transport().send_socket_buffer_size = realtime ? 1U << 20U : 8U << 20U;

  // A process that was killed is gone for others after 5 s; announcements in the first second are quick.
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.leaseDuration = {5, 0};
  discovery.leaseDuration_announcementperiod = {1, 500'000'000};
  discovery.initial_announcements.count = 10;
  discovery.initial_announcements.period = {0, 50'000'000};
  qos.wire_protocol().builtin.initialPeersList = called_peers(options, memory);
  if (options.identity)
    for (auto& [key, value] : security_properties(*options.identity))
      qos.properties().properties().emplace_back(key, value);
  // Nobody asks for types over the wire: the IDL is the contract.
  qos.wire_protocol().builtin.typelookup_config.use_client = false;
  qos.wire_protocol().builtin.typelookup_config.use_server = false;

  for (const auto& [key, profile] : profiles) {
    if (profile.flow == 0 || profile.traffic != traffic) continue;
    auto flow = std::make_shared<transport::FlowControllerDescriptor>();
    flow->name = profile.name.c_str();
    flow->period_ms = 10;
    flow->max_bytes_per_period = static_cast<std::int32_t>(profile.flow / 100);
    qos.flow_controllers().push_back(flow);
  }
  return qos;
}

/// Tells of samples of a type that did not decode, and who may have sent them; at most once in ten seconds.
class Undecoded {
 public:
  Undecoded(fdds::TypeSupport support, const Decoding* decoding)
      : support_{std::move(support)}, decoding_{decoding} {}

  std::optional<Alarm> look(const Discovery& discovery) {
    const std::uint64_t count = decoding_->undecoded();
    const Instant now = monotonic_now();
    if (count == told_ || now - told_at_ < Duration::seconds(10.0)) return std::nullopt;
    const std::string type = support_.get_type_name();
    std::set<std::string> writers;
    for (const Endpoint& end : discovery.snapshot().endpoints)
      if (end.is_writer && !end.is_local && end.type == type) writers.insert("`" + end.participant + "`");
    std::string text = std::to_string(count - told_) + " samples of this type do not decode";
    if (!writers.empty() && writers.size() <= most_named)
      text += "; it is written by " + joined({writers.begin(), writers.end()});
    told_ = count;
    told_at_ = now;
    return Alarm{type,
                 text +
                     ": a program has another version of the IDL, or sends nonsense; build it with "
                     "the IDL of this Invar (`invar types`)",
                 false};
  }

 private:
  static constexpr std::size_t most_named = 4;
  fdds::TypeSupport support_;  // keeps the counter alive
  const Decoding* decoding_;
  std::uint64_t told_ = 0;
  Instant told_at_{INT64_MIN / 2};
};

}  // namespace

Participant::Participant(const NodeOptions& options, Traffic traffic, const Profiles& profiles,
                         Discovery& discovery)
    : discovery_{discovery},
      name_{"invar/" + options.cell + "/" + options.process},
      reception_{std::make_shared<Reception>(limits_of(options))},
      identity_{own_memory_identity()},
      owner_{options.identity ? options.identity->name : ""} {
  MemoryPlan memory;
  if (options.shared_memory) memory = plan_memory(traffic, options.segment_size, options.processes);
  if (!memory.sizes.any()) identity_.folder = 0;
  // Asked here also so that every program with a participant has those calls: nothing else refers to them.
  if (memory.sizes.any() && !shared_memory_calls_are_ours())
    discovery_.raise(
        {"shared memory",
         "a preloaded library answers `shm_open` or `ftruncate` in the place of Invar: "
         "a peer that is killed may leave this process deaf or spinning; start it without LD_PRELOAD",
         false});
  if (!memory.shortage.empty()) discovery_.raise({"shared memory", memory.shortage, false});
  if (traffic == Traffic::realtime) name_ += "/realtime";
  keep_middleware_log();
  if (options.may_come_later) {
    for (const auto& address : options.addresses) promise_address(address);
  } else if (!options.addresses.empty() &&
             std::none_of(options.addresses.begin(), options.addresses.end(), has_address))
    throw InputError{
        name_, "no running interface of this PC has " + joined(options.addresses),
        "it has " + own_addresses_text() + "; look for the cable, or mend the address in the file"};
  // Between two components of a process that an executor did not join, samples go the same way as between
  // processes: a writer never runs a reader's listener.
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);

  if (options.identity) check_identity(*options.identity);
  // The one participant of a secured process carries the loop's signals and heartbeats, too.
  const Priority priority{traffic == Traffic::realtime || options.identity ? options.realtime_priority : 0};
  participant_ = fdds::DomainParticipantFactory::get_instance()->create_participant(
      options.domain, participant_qos(options, name_, traffic, profiles, reception_, identity_, memory.sizes),
      this, fdds::StatusMask::none());
  if (participant_ == nullptr) {
    const std::string said = newest_middleware_error();
    throw InputError{"domain " + std::to_string(options.domain),
                     "Fast DDS could not create a participant" + (said.empty() ? "" : " (" + said + ")"),
                     "look with `invar doctor` for the address, /dev/shm and the ports"};
  }
  reception_->open();
  discovery_.add_participant(guid_text(participant_->guid().guidPrefix), name_);
  discovery_.add_source([reception = reception_]() -> std::optional<Alarm> {
    auto text = reception->report(monotonic_now());
    if (!text) return std::nullopt;
    return Alarm{"network", std::move(*text), false};
  });
}

Participant::~Participant() {
  participant_->set_listener(nullptr);
  participant_->delete_contained_entities();
  fdds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

void Participant::refuse(const char* what, const std::string& topic) const {
  (void)newest_middleware_error();  // said here, in other words
  throw InputError{
      "topic `" + topic + "`", "the certificate of `" + owner_ + "` does not permit to " + what + " it",
      "an operator commands, a viewer looks; after a change of the cell file call `invar keys CELL`"};
}

void Participant::call_peers() {
  // Other user data is what makes Fast DDS announce a participant anew.
  fdds::DomainParticipantQos qos = participant_->get_qos();
  qos.user_data().data_vec(to_user_data(identity_, ++calls_));
  if (participant_->set_qos(qos) != ReturnCode_t::RETCODE_OK)
    discovery_.raise({"network", "the peers of this process could not be called anew", false});
}

fdds::Topic* Participant::topic(const std::string& name, fdds::TopicDataType* type) {
  const fdds::TypeSupport support{type};
  const std::string type_name = support.get_type_name();
  if (participant_->find_type(type_name).empty()) {
    support.register_type(participant_);
    if (const auto* decoding = dynamic_cast<const Decoding*>(type))
      discovery_.add_source([report = Undecoded{support, decoding}, &discovery = discovery_]() mutable {
        return report.look(discovery);
      });
  }
  if (auto* known = participant_->lookup_topicdescription(name)) {
    if (known->get_type_name() != type_name)
      throw InputError{"topic `" + name + "`", "is of type " + known->get_type_name() + ", not " + type_name,
                       "connect ports of one type only"};
    return dynamic_cast<fdds::Topic*>(known);
  }
  fdds::Topic* made = participant_->create_topic(name, type_name, fdds::TOPIC_QOS_DEFAULT);
  if (made == nullptr)
    throw InputError{"topic `" + name + "`", "Fast DDS refuses it", "names have at most 255 characters"};
  return made;
}

fdds::Publisher* Participant::publisher(const std::vector<std::string>& partitions) {
  auto& made = publishers_[partitions];
  if (made == nullptr) {
    fdds::PublisherQos qos;
    for (const auto& name : partitions) qos.partition().push_back(name.c_str());
    made = participant_->create_publisher(qos);
  }
  return made;
}

fdds::Subscriber* Participant::subscriber(const std::vector<std::string>& partitions) {
  auto& made = subscribers_[partitions];
  if (made == nullptr) {
    fdds::SubscriberQos qos;
    for (const auto& name : partitions) qos.partition().push_back(name.c_str());
    made = participant_->create_subscriber(qos);
  }
  return made;
}

fdds::DataWriter& Participant::create_writer(const std::string& name, fdds::TopicDataType* type,
                                             const Profile& profile, fdds::DataWriterListener* listener) {
  const std::lock_guard lock{mutex_};
  fdds::Topic* on = topic(name, type);
  auto* writer = publisher(profile.partitions)->create_datawriter(on, writer_qos(profile), listener);
  if (writer == nullptr && !owner_.empty()) refuse("write", name);
  INVAR_EXPECTS(writer != nullptr, name, profile.name);  // the profile was checked when it was read
  discovery_.add_endpoint({guid_text(writer->guid()), name_, name, on->get_type_name(), true, true, profile});
  return *writer;
}

namespace {
WriterKeys::Kind instances_of(const Profile& profile, const fdds::TopicDataType& type) {
  if (profile.exclusive) return WriterKeys::Kind::by_writer;
  if (dynamic_cast<const RawType*>(&type) != nullptr)  // who records wants each instance
    return WriterKeys::Kind::as_they_are;
  const bool latest_counts = profile.traffic == Traffic::realtime && !profile.keep_all && profile.depth == 1;
  // A client's key is that of one call: each would take a kilobyte until `max_instances` are there.
  const bool is_request = profile.reliable && profile.durability == Durability::volatile_ &&
                          profile.traffic == Traffic::general && !profile.keep_all &&
                          profile.depth >= WriterKeys::most_folded;
  return latest_counts || is_request ? WriterKeys::Kind::folded : WriterKeys::Kind::as_they_are;
}
}  // namespace

fdds::DataReader& Participant::create_reader(const std::string& name, fdds::TopicDataType* type,
                                             const Profile& profile, fdds::DataReaderListener* listener) {
  const std::lock_guard lock{mutex_};
  const WriterKeys::Kind instances = instances_of(profile, *type);
  fdds::Topic* on = topic(name, type);  // takes the type support over
  const WriterKeys::Making making{instances};
  auto* reader = subscriber(profile.partitions)->create_datareader(on, reader_qos(profile), listener);
  if (reader == nullptr && !owner_.empty()) refuse("read", name);
  INVAR_EXPECTS(reader != nullptr, name, profile.name);
  discovery_.add_endpoint(
      {guid_text(reader->guid()), name_, name, on->get_type_name(), false, true, profile});
  return *reader;
}

void Participant::remove(fdds::DataWriter& writer) {
  // Emptied first: Fast DDS 2.9 may send a heartbeat while it takes the history apart, and never leave its search for holes.
  std::size_t removed = 0;
  writer.clear_history(&removed);
  const std::lock_guard lock{mutex_};
  discovery_.remove_endpoint(guid_text(writer.guid()));
  const_cast<fdds::Publisher*>(writer.get_publisher())->delete_datawriter(&writer);  // NOLINT
}

void Participant::remove(fdds::DataReader& reader) {
  const std::lock_guard lock{mutex_};
  discovery_.remove_endpoint(guid_text(reader.guid()));
  const_cast<fdds::Subscriber*>(reader.get_subscriber())->delete_datareader(&reader);  // NOLINT
}

bool Participant::has_dead_peer() const {
  const std::lock_guard lock{peers_mutex_};
  return std::any_of(peers_.begin(), peers_.end(), [](const auto& peer) { return !is_alive(peer.second); });
}

std::vector<std::string> Participant::revoke(const std::vector<HolderId>& holders) {
  reception_->revoke(holders);
  const auto is_revoked = [&](HolderId holder) {
    return std::binary_search(holders.begin(), holders.end(), holder);
  };
  std::vector<std::string> names;
  if (is_revoked(holder_of(prefix_of(id())))) names.push_back(name_);
  const std::lock_guard lock{peers_mutex_};
  for (const auto& [holder, name] : holders_)
    if (is_revoked(holder)) names.push_back(name);
  return names;
}

void Participant::on_participant_discovery(fdds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& info) {
  const std::string id = guid_text(info.info.m_guid.guidPrefix);
  const bool is_gone = info.status == rtps::ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
                       info.status == rtps::ParticipantDiscoveryInfo::DROPPED_PARTICIPANT;
  const auto identity = memory_identity_from(info.info.m_userData.getValue());
  const GuidPrefix prefix = prefix_of(info.info.m_guid);
  {
    const std::lock_guard lock{peers_mutex_};
    if (!is_gone && identity && is_reachable(*identity, identity_))
      peers_[id] = identity->process;
    else
      peers_.erase(id);
    if (is_gone)
      holders_.erase(holder_of(prefix));
    else if (!owner_.empty())
      holders_[holder_of(prefix)] = info.info.m_participantName.c_str();
  }
  is_gone ? reception_->guard().forget(prefix) : reception_->know_participant(prefix);
  if (is_gone) return discovery_.remove_participant(id);
  discovery_.add_participant(id, info.info.m_participantName.c_str(), addresses_of(info.info));
  const std::string why = identity ? why_unreachable(identity_, *identity) : "";
  if (!why.empty()) discovery_.raise_slow_path(identity->process, info.info.m_participantName.c_str(), why);
}

void Participant::on_publisher_discovery(fdds::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) {
  const std::string id = guid_text(info.info.guid());
  const GuidPrefix prefix = prefix_of(info.info.guid());
  if (info.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER) {
    reception_->guard().forget(prefix, entity_of(info.info.guid()));
    return discovery_.remove_endpoint(id);
  }
  reception_->guard().know(prefix, entity_of(info.info.guid()));
  discovery_.add_endpoint({id, "", info.info.topicName().c_str(), info.info.typeName().c_str(), true, false,
                           described(info.info.m_qos)});
}

void Participant::on_subscriber_discovery(fdds::DomainParticipant*, rtps::ReaderDiscoveryInfo&& info) {
  const std::string id = guid_text(info.info.guid());
  if (info.status == rtps::ReaderDiscoveryInfo::REMOVED_READER) return discovery_.remove_endpoint(id);
  discovery_.add_endpoint({id, "", info.info.topicName().c_str(), info.info.typeName().c_str(), false, false,
                           described(info.info.m_qos)});
}

}  // namespace invar::dds

#include "core/dds/node.hpp"

#include <unistd.h>

#include <chrono>
#include <mutex>
#include <set>
#include <thread>

#include "core/base/contract.hpp"
#include "core/base/fault.hpp"
#include "core/component/component.hpp"
#include "core/dds/commander_watch.hpp"
#include "core/dds/connection.hpp"
#include "core/dds/endpoint_id.hpp"
#include "core/dds/guid_text.hpp"
#include "core/dds/host_clocks.hpp"
#include "core/dds/key_watch.hpp"
#include "core/dds/local_exchange.hpp"
#include "core/dds/middleware_log.hpp"
#include "core/dds/promised_address.hpp"
#include "core/dds/publishing.hpp"
#include "core/dds/pulse.hpp"
#include "core/dds/raw_type.hpp"
#include "core/dds/shared_memory.hpp"

namespace invar::dds {

std::string topic_name(const std::string& cell, const std::string& component, const std::string& port) {
  return "cell/" + cell + "/" + component + "/" + port;
}

std::string heartbeat_topic(const std::string& cell) { return "cell/" + cell + "/heartbeat"; }

std::string clock_topic(const std::string& cell) { return "cell/" + cell + "/clock"; }

namespace {

const WireType& wire_type_of(std::type_index type, const std::string& topic) {
  const WireType* found = WireTypes::all().find(type);
  if (found == nullptr)
    throw InputError{"topic `" + topic + "`",
                     std::string{"carries a type that no IDL describes ("} + type.name() + ")",
                     "add it to idl/, or register it with add_wire_type"};
  return *found;
}

/// Where only the latest counts, reading instead of taking costs the receiving thread no allocation.
bool is_kept(const Profile& profile) {
  return profile.traffic == Traffic::realtime && !profile.keep_all && profile.depth == 1;
}

/// Best effort on the sockets of the loop's traffic: a heartbeat that waits behind others says nothing.
Profile heartbeat_profile() {
  Profile profile;
  profile.name = "heartbeat";
  profile.traffic = Traffic::realtime;
  return profile;
}

/// Best effort: a beat that was sent again says nothing of the way.
Profile clock_profile() {
  Profile profile;
  profile.name = "clock";
  profile.depth = 16;
  return profile;
}

/// The stamp in the CDR of `sample` and when it was sent, in the clock of this process; `copy` keeps it.
void align(RawSample& sample, std::size_t position, const HostClocks& clocks, std::vector<std::byte>& copy) {
  const Duration ahead = clocks.stamps_ahead(sample.participant);
  sample.sent_ns -= ahead.ns;
  if (ahead.ns == 0 || sample.cdr.size() < position + sizeof ahead.ns) return;
  copy.assign(sample.cdr.begin(), sample.cdr.end());
  const bool is_swapped = (copy[1] & std::byte{1}) == std::byte{0};  // big-endian CDR
  std::int64_t stamp = 0;
  const auto at = copy.begin() + static_cast<std::ptrdiff_t>(position);
  const auto bytes = reinterpret_cast<std::byte*>(&stamp);
  std::copy_n(at, sizeof stamp, bytes);
  if (is_swapped) std::reverse(bytes, bytes + sizeof stamp);
  if (stamp == 0) return;  // nobody filled it
  stamp = earlier(stamp, ahead);
  if (is_swapped) std::reverse(bytes, bytes + sizeof stamp);
  std::copy_n(bytes, sizeof stamp, at);
  sample.cdr = copy;
}

/// Where a component wants to know whether its commander is heard; nullptr: it does not, or the deployment tells it.
Input<commander::Link>* commander_link(const Component& component) {
  for (Port* port : component.ports())
    if (auto* link = dynamic_cast<Input<commander::Link>*>(port); link != nullptr && link->topic.empty())
      return link;
  return nullptr;
}

struct BoundOutput {
  std::unique_ptr<WriterConnection> connection;
  std::unique_ptr<Outlet> outlet;
};

}  // namespace

struct Node::Parts {
  NodeOptions options;
  Profiles profiles;
  Discovery discovery;
  std::mutex mutex;  // set-up only
  std::unique_ptr<Participant> realtime, general, raw;
  std::unique_ptr<LocalExchange> exchange;
  std::mutex port_mutex;  // of the two below, which any thread sums up
  std::vector<BoundOutput> outputs;
  std::vector<std::unique_ptr<Connection>> inputs;
  Publishing realtime_publishing, general_publishing;
  std::unique_ptr<Heart> heart;
  std::unique_ptr<Connection> heartbeats;
  std::unique_ptr<CommanderWatch> watch;
  std::unique_ptr<HostClocks> clocks;
  std::unique_ptr<Connection> clock_beats;
  std::unique_ptr<Pulse> clock_pulse;
  std::vector<HolderId> revoked;
  std::unique_ptr<KeyWatch> key_watch;
  std::unique_ptr<Pulse> key_pulse;  // last: it looks at the participants

  [[nodiscard]] std::string own_address() const {
    return options.addresses.empty() ? "127.0.0.1" : options.addresses.front();
  }

  Participant& participant(Traffic traffic) {
    const std::lock_guard lock{mutex};
    // Each secured pair needs a handshake, and Fast DDS 2.9 loses some where many take part.
    auto& participant = traffic == Traffic::realtime && !options.identity ? realtime : general;
    if (!participant) participant = made(options, traffic);
    return *participant;
  }
  Participant& raw_participant() {
    if (options.raw_by_general) return participant(Traffic::general);
    const std::lock_guard lock{mutex};
    if (raw) return *raw;
    NodeOptions second = options;
    if (second.identity) second.identity->name = second_name(second.identity->name);
    raw = made(second, Traffic::general);
    return *raw;
  }
  std::unique_ptr<Participant> made(const NodeOptions& of, Traffic traffic) {
    auto participant = std::make_unique<Participant>(of, traffic, profiles, discovery);
    if (clocks) clocks->add_participant(participant_key(participant->id().guidPrefix.value));
    if (!revoked.empty()) (void)participant->revoke(revoked);
    return participant;
  }
  /// On the thread of the pulse.
  void look_at_keys() {
    KeyWatch::News news = key_watch->look();
    for (Alarm& alarm : news.alarms) discovery.raise(std::move(alarm));
    const std::lock_guard lock{mutex};
    if (!news.revoked || *news.revoked == revoked) return;
    revoked = std::move(*news.revoked);
    std::set<std::string> hit;
    for (const auto* participant : {&general, &raw})
      if (*participant)
        for (std::string& name : (*participant)->revoke(revoked)) hit.insert(std::move(name));
    for (const std::string& name : hit) discovery.raise(revoked_alarm(name));
  }
  [[nodiscard]] Alarm revoked_alarm(const std::string& name) const {
    if (name == "invar/" + options.cell + "/" + options.process)
      return {"keys",
              "the certificate of `" + options.identity->name +
                  "` is revoked: other processes hear this one no more; `invar keys CELL --renew " +
                  options.identity->name + "`, bring it to this PC, and start the process anew",
              true};
    return {"keys", "`" + name + "` is revoked: nothing that it sends is taken any more", false};
  }
  /// nullptr where samples of this profile have no way through shared memory.
  LocalExchange* exchange_of(const Profile& qos) {
    if (!options.shared_memory || !is_kept(qos) || qos.durability != Durability::volatile_) return nullptr;
    auto& participant = this->participant(qos.traffic);
    const std::lock_guard lock{mutex};
    if (!exchange)
      exchange = std::make_unique<LocalExchange>(participant_of(endpoint_id(participant.id())),
                                                 options.realtime_priority);
    return exchange.get();
  }
  std::shared_ptr<LocalReader> local_reader(const Profile& qos, const std::shared_ptr<Inlet>& inlet,
                                            Clock clock) {
    LocalExchange* found = exchange_of(qos);
    if (found == nullptr) return nullptr;
    auto local = found->reader([to = inlet.get(), clock = std::move(clock)](std::span<const std::byte> cdr) {
      (void)to->deliver(cdr, clock(), "of this PC");
    });
    inlet->prefer(local);
    return local;
  }
  Publishing& publishing(Traffic traffic) {
    return traffic == Traffic::realtime ? realtime_publishing : general_publishing;
  }
};

Node::Node(NodeOptions options, Profiles profiles) : parts_{std::make_unique<Parts>()} {
  parts_->options = std::move(options);
  parts_->profiles = std::move(profiles);
  if (parts_->options.shared_memory) remove_shared_memory_leftovers();
  if (const auto& clocks = parts_->options.clocks)
    parts_->clocks = std::make_unique<HostClocks>(clocks->cell, clocks->host, clocks->hosts);
  (void)parts_->participant(Traffic::general);  // discovery begins
  if (parts_->clocks) compare_clocks();
  if (!parts_->options.identity) return;
  parts_->key_watch = std::make_unique<KeyWatch>(*parts_->options.identity);
  parts_->look_at_keys();
  parts_->key_pulse = std::make_unique<Pulse>("invar-keys", Duration::seconds(1.0), 0,
                                              [parts = parts_.get()] { parts->look_at_keys(); });
}

Node::~Node() {
  parts_->key_pulse.reset();
  stop();
  // Who was killed while it wrote into our shared memory leaves a lock there. Fast DDS gives such a port up and makes another
  // one after a second; closing the port in that moment, it would use the memory of the old one when it is gone.
  const auto has_dead_peer = [](const auto& participant) {
    return participant && participant->has_dead_peer();
  };
  if (parts_->options.shared_memory &&
      (has_dead_peer(parts_->general) || has_dead_peer(parts_->realtime) || has_dead_peer(parts_->raw)))
    std::this_thread::sleep_for(std::chrono::milliseconds{2500});
}

const NodeOptions& Node::options() const { return parts_->options; }

const Profile& Node::profile(std::string_view name) const {
  const auto found = parts_->profiles.find(name);
  INVAR_EXPECTS(found != parts_->profiles.end(), name);
  return found->second;
}

const Profiles& Node::profiles() const { return parts_->profiles; }

void Node::bind(OutputPort& port, OutputBinding binding) { bind(port, binding, profile(port.profile)); }

void Node::bind(OutputPort& port, OutputBinding binding, const Profile& qos) {
  const WireType& type = wire_type_of(port.type(), port.topic);
  BoundOutput bound;
  bound.connection =
      std::make_unique<WriterConnection>(parts_->participant(qos.traffic), port.topic, type, qos);
  if (binding.period.ns == 0) {
    bound.outlet = type.attach_direct(port, bound.connection->writer(), binding.separation,
                                      binding.watched_only && qos.durability == Durability::volatile_
                                          ? &bound.connection->readers()
                                          : nullptr);
  } else {
    // Room for a tenth of a second in which the publishing thread does not get to run.
    const auto capacity =
        static_cast<std::size_t>(std::max<std::int64_t>(64, 400'000'000 / binding.period.ns));
    LocalExchange* exchange = parts_->exchange_of(qos);
    bound.outlet = type.attach_paced(port, bound.connection->writer(), capacity, binding.separation,
                                     exchange != nullptr ? bound.connection->share(*exchange) : nullptr);
    parts_->publishing(qos.traffic).add(*bound.outlet);
  }
  {
    const std::lock_guard lock{parts_->port_mutex};
    parts_->outputs.push_back(std::move(bound));
  }
  if (qos.exclusive) send_heartbeats(port.owner().cell);
}

void Node::send_heartbeats(std::uint32_t cell) {
  if (parts_->heart) return;
  commander::Heartbeat beat;
  beat.cell(cell);
  beat.participant(guid_text(parts_->participant(Traffic::general).id().guidPrefix));
  beat.process(parts_->options.process);
  beat.address(parts_->own_address());
  beat.process_id(static_cast<std::uint32_t>(getpid()));
  auto to = std::make_shared<Writer<commander::Heartbeat>>(
      writer<commander::Heartbeat>(heartbeat_topic(parts_->options.cell), heartbeat_profile()));
  parts_->heart = std::make_unique<Heart>(
      [to](const commander::Heartbeat& sample) { (void)to->write(sample); }, std::move(beat));
}

void Node::compare_clocks() {
  HostClocks& clocks = *parts_->clocks;
  const std::string topic = clock_topic(parts_->options.cell);
  parts_->discovery.add_source([&clocks, topic]() -> std::optional<Alarm> {
    const std::string stranger = clocks.take_stranger();
    if (stranger.empty()) return std::nullopt;
    return Alarm{topic, stranger, false};
  });
  parts_->clock_beats = reader<clock::Beat>(topic, clock_profile(), [&clocks](const clock::Beat& beat) {
    clocks.heard(beat, ClockReading::now());
  });
  auto to = std::make_shared<Writer<clock::Beat>>(writer<clock::Beat>(topic, clock_profile()));
  parts_->clock_pulse = std::make_unique<Pulse>("invar-clock", HostClocks::period, 0, [to, &clocks] {
    (void)to->write(clocks.beat(ClockReading::now()));
  });
}

const HostClocks* Node::clocks() const { return parts_->clocks.get(); }

void Node::watch_commander(const InputPort& port, CommandGate& gate, const Clock& clock) {
  auto* link = commander_link(port.owner());
  if (link == nullptr) return;
  if (!parts_->watch) parts_->watch = std::make_unique<CommanderWatch>(parts_->own_address());
  parts_->watch->add(gate, *link, clock);
  if (!parts_->heartbeats)
    parts_->heartbeats = reader<commander::Heartbeat>(
        heartbeat_topic(parts_->options.cell), heartbeat_profile(),
        [watch = parts_->watch.get(), cell = port.owner().cell](const commander::Heartbeat& beat) {
          if (beat.cell() == cell) watch->heard(beat);
        });
}

void Node::bind(InputPort& port, Clock clock) {
  const Profile& qos = profile(port.profile);
  const WireType& type = wire_type_of(port.type(), port.topic);
  std::shared_ptr<Inlet> inlet = type.attach(port, is_kept(qos));
  const auto gate =
      std::make_shared<CommandGate>(port.topic, qos, parts_->discovery, [&port] { port.refuse(); });
  inlet->guard(gate, expected_keys(port));
  inlet->align(parts_->clocks.get());
  if (qos.exclusive) watch_commander(port, *gate, clock);
  auto local = parts_->local_reader(qos, inlet, clock);
  auto input = std::make_unique<ReaderConnection>(
      parts_->participant(qos.traffic), port.topic, type.make_support(), qos, parts_->discovery,
      [inlet, clock = std::move(clock)](fdds::DataReader& reader) { inlet->receive(reader, clock()); }, gate,
      std::move(local));
  const std::lock_guard lock{parts_->port_mutex};
  parts_->inputs.push_back(std::move(input));
}

void Node::start() {
  parts_->realtime_publishing.start(parts_->options.realtime_priority, parts_->options.realtime_cpu);
  parts_->general_publishing.start(0, std::nullopt);
  if (parts_->heart) parts_->heart->start();
  if (parts_->watch) parts_->watch->start(parts_->options.realtime_priority);
}

void Node::cycle_ended() noexcept {
  if (parts_->exchange) parts_->exchange->wake_readers();
  parts_->realtime_publishing.cycle_ended();
  parts_->general_publishing.cycle_ended();
}

void Node::stop() {
  parts_->realtime_publishing.stop();
  parts_->general_publishing.stop();
  if (parts_->exchange) parts_->exchange->wake_readers();  // for what was written after the last cycle
  std::vector<std::unique_ptr<Connection>> inputs;
  {
    const std::lock_guard lock{parts_->port_mutex};
    inputs.swap(parts_->inputs);
  }
  inputs.clear();  // outside of the lock: it waits for callbacks
  parts_->clock_pulse.reset();
  parts_->clock_beats.reset();
  parts_->heartbeats.reset();
  parts_->watch.reset();
  parts_->heart.reset();
}

std::unique_ptr<Connection> Node::raw_reader(const std::string& topic, const std::string& type,
                                             const Profile& profile,
                                             std::function<void(const RawSample&)> take, bool keyed) {
  const WireType* wire = parts_->clocks ? WireTypes::all().find(type) : nullptr;
  if (const auto stamp = wire == nullptr ? std::nullopt : wire->stamp_position())
    take = [take = std::move(take), position = *stamp, &clocks = *parts_->clocks,
            copy = std::vector<std::byte>{}](RawSample sample) mutable {
      align(sample, position, clocks, copy);
      take(sample);
    };
  return std::make_unique<ReaderConnection>(parts_->raw_participant(), topic, new RawType{type, keyed},
                                            profile, parts_->discovery, raw_receiver(std::move(take)));
}

std::unique_ptr<Connection> Node::raw_writer(const std::string& topic, const std::string& type,
                                             const Profile& profile) {
  return std::make_unique<RawWriterConnection>(parts_->raw_participant(), topic, type, profile);
}

Snapshot Node::snapshot() const { return parts_->discovery.snapshot(); }

std::vector<Alarm> Node::take_alarms() {
  auto alarms = parts_->discovery.take_alarms();
  for (const auto& error : take_middleware_errors())
    alarms.push_back(
        {"middleware", "Fast DDS reports: " + error + "; `invar doctor` looks at this PC", false});
  return alarms;
}

Discovery& Node::discovery() { return parts_->discovery; }

std::uint64_t Node::lost() const {
  const std::lock_guard lock{parts_->port_mutex};
  std::uint64_t sum = 0;
  for (const auto& output : parts_->outputs) sum += output.outlet->lost();
  for (const auto& input : parts_->inputs) sum += input->lost();
  return sum;
}

void Node::network_is_back() {
  renew_promises();
  const std::lock_guard lock{parts_->mutex};
  for (const auto* participant : {&parts_->general, &parts_->realtime, &parts_->raw})
    if (*participant) (*participant)->call_peers();
}

std::unique_ptr<Connection> Node::make_writer(const std::string& topic, std::type_index type,
                                              const Profile& profile) {
  return std::make_unique<WriterConnection>(parts_->participant(profile.traffic), topic,
                                            wire_type_of(type, topic), profile);
}

ExpectedKeys expected_keys(const InputPort& port) {
  ExpectedKeys expected{port.owner().cell, port.is_of_plant, port.keys};
  if (expected.parts.empty() && port.key) expected.parts = {*port.key};
  return expected;
}

std::unique_ptr<Connection> Node::make_reader(const std::string& topic, std::type_index type,
                                              const Profile& profile,
                                              std::function<void(const void*, Instant)> take) {
  const WireType& wire = wire_type_of(type, topic);
  std::shared_ptr<Inlet> inlet = wire.attach(std::move(take), is_kept(profile));
  // Others than commands are heard however old they seem: who asks decides.
  const auto gate =
      profile.exclusive ? std::make_shared<CommandGate>(topic, profile, parts_->discovery) : nullptr;
  inlet->guard(gate);
  inlet->align(parts_->clocks.get());
  auto local = parts_->local_reader(profile, inlet, utc_now);
  return std::make_unique<ReaderConnection>(
      parts_->participant(profile.traffic), topic, wire.make_support(), profile, parts_->discovery,
      [inlet](fdds::DataReader& reader) { inlet->receive(reader, utc_now()); }, gate, std::move(local));
}

}  // namespace invar::dds

#include "core/dds/discovery.hpp"

#include <algorithm>
#include <string_view>

#include "core/base/clock.hpp"

namespace invar::dds {

namespace {
constexpr std::size_t alarms_kept = 1000;
// A busy host may be late to say that nobody is there; meanwhile nothing else is received on that thread.
constexpr Duration patience = Duration::milliseconds(10);
constexpr Duration between_looks = Duration::milliseconds(200);

/// Whether two participants that receive at one address may be of one process. Those of Cyclone DDS share the sockets of their
/// process and four octets of their prefix (vendor, process); with others eight say as much (vendor, PC, process).
bool may_share_a_process(const std::string& one, const std::string& other) {
  constexpr std::string_view cyclone = "01.10.";
  const std::size_t alike = (one.starts_with(cyclone) ? 4 : 8) * std::string_view{"00."}.size();
  return one.size() > alike && one.compare(0, alike, other, 0, alike) == 0;
}
}  // namespace

void Discovery::add_participant(const std::string& id, const std::string& name,
                                std::vector<PeerAddress> addresses) {
  const std::lock_guard lock{mutex_};
  Peer& peer = participants_[id];
  peer.name = name;
  peer.addresses = std::move(addresses);
  if (peer.number == 0) peer.number = ++came_;
  for (auto& [key, endpoint] : endpoints_)
    if (key.starts_with(id)) endpoint.participant = name;
}

void Discovery::remove_participant(const std::string& id) {
  const std::lock_guard lock{mutex_};
  participants_.erase(id);
  std::erase_if(endpoints_,
                [&id](const auto& entry) { return !entry.second.is_local && entry.first.starts_with(id); });
}

void Discovery::add_endpoint(Endpoint endpoint) {
  const std::lock_guard lock{mutex_};
  if (endpoint.participant.empty()) {
    const auto known = std::find_if(participants_.begin(), participants_.end(),
                                    [&](const auto& entry) { return endpoint.id.starts_with(entry.first); });
    endpoint.participant = known != participants_.end() ? known->second.name : "an unnamed participant";
  }
  endpoint.found = monotonic_now();
  const auto old = endpoints_.find(endpoint.id);
  if (old != endpoints_.end()) {
    endpoint.found = old->second.found;
    // Another participant of this node sees our endpoints as foreign ones; and news may come repeatedly.
    if (endpoint.is_local == old->second.is_local) old->second = std::move(endpoint);
    if (old->second.is_local || !endpoint.is_local) return;
    endpoints_.erase(old);
  }
  for (const auto& [id, other] : endpoints_)
    if (other.topic == endpoint.topic && other.is_writer != endpoint.is_writer &&
        (other.is_local || endpoint.is_local))
      check(endpoint, other);
  endpoints_.emplace(endpoint.id, std::move(endpoint));
}

void Discovery::remove_endpoint(const std::string& id) {
  const std::lock_guard lock{mutex_};
  endpoints_.erase(id);
}

void Discovery::check(const Endpoint& one, const Endpoint& other) {
  const Endpoint& writer = one.is_writer ? one : other;
  const Endpoint& reader = one.is_writer ? other : one;
  std::string why;
  if (writer.type != reader.type) why = "type: writer sends " + writer.type + ", reader takes " + reader.type;
  for (const auto& mismatch : mismatches(writer.qos, reader.qos))
    why += (why.empty() ? "" : "; ") + mismatch.text();
  if (why.empty()) return;
  if (alarms_.size() == alarms_kept) alarms_.pop_front();
  alarms_.push_back({one.topic, "no samples flow from " + writer.participant + " to " + reader.participant +
                                    " on `" + one.topic + "`: " + why});
}

void Discovery::raise(Alarm alarm) {
  const std::lock_guard lock{mutex_};
  if (alarms_.size() == alarms_kept) alarms_.pop_front();
  alarms_.push_back(std::move(alarm));
}

void Discovery::add_source(std::function<std::optional<Alarm>()> source) {
  const std::lock_guard lock{mutex_};
  sources_.push_back(std::move(source));
}

void Discovery::raise_slow_path(std::int32_t process, const std::string& name, const std::string& why) {
  // A process has a participant for the loop's traffic beside the general one; one line says enough.
  const std::string of = name.substr(0, name.rfind("/realtime"));
  {
    const std::lock_guard lock{mutex_};
    if (!slow_.insert({process, of}).second) return;
  }
  raise(
      {"shared memory", of + " (process " + std::to_string(process) + ") is reached by UDP: " + why, false});
}

Snapshot Discovery::snapshot() const {
  const std::lock_guard lock{mutex_};
  Snapshot out;
  for (const auto& [id, peer] : participants_) out.participants.push_back({id, peer.name});
  for (const auto& [id, endpoint] : endpoints_) out.endpoints.push_back(endpoint);
  return out;
}

std::vector<Alarm> Discovery::take_alarms() {
  std::vector<Alarm> out;
  std::vector<std::function<std::optional<Alarm>()>> sources;
  {
    const std::lock_guard lock{mutex_};
    out.assign(alarms_.begin(), alarms_.end());
    alarms_.clear();
    sources = sources_;
  }
  const std::lock_guard turn{sources_mutex_};  // a source may ask this object
  for (const auto& source : sources)
    if (auto alarm = source()) out.push_back(std::move(*alarm));
  return out;
}

std::string Discovery::participant_name(const std::string& id) const {
  const std::lock_guard lock{mutex_};
  const auto found = participants_.find(id);
  return found == participants_.end() ? "" : found->second.name;
}

std::string Discovery::name_of(const std::string& participant) const {
  const std::string name = participant_name(participant);
  return name.empty() ? "participant " + participant : name;
}

Claimant Discovery::claimant(const std::string& writer) const {
  const std::lock_guard lock{mutex_};
  const auto known = endpoints_.find(writer);
  Claimant who{writer, writer.substr(0, writer.find('|'))};
  if (known == endpoints_.end()) return who;
  who.strength = known->second.qos.strength;
  who.found = known->second.found;
  return who;
}

bool Discovery::is_gone(const std::string& participant) {
  std::vector<PeerAddress> addresses;
  {
    const std::lock_guard lock{mutex_};
    const auto found = participants_.find(participant);
    if (found == participants_.end()) return true;
    Peer& peer = found->second;
    for (const auto& [id, other] : participants_)
      peer.gone = peer.gone || (other.number > peer.number && !peer.addresses.empty() &&
                                other.addresses == peer.addresses && !may_share_a_process(participant, id));
    const Instant now = monotonic_now();
    if (peer.gone || now - peer.looked < between_looks) return peer.gone;
    peer.looked = now;
    addresses = peer.addresses;
  }
  const bool gone = are_abandoned(addresses, patience);
  const std::lock_guard lock{mutex_};
  if (const auto found = participants_.find(participant); found != participants_.end())
    found->second.gone = gone;
  return gone;
}

}  // namespace invar::dds

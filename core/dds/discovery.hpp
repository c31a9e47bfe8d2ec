// Discovery: who is there, which topics they write and read, and which of our ends they cannot talk to.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/time.hpp"
#include "core/dds/ownership.hpp"
#include "core/dds/peer_address.hpp"
#include "core/dds/profile.hpp"

namespace invar::dds {

struct Endpoint {
  std::string id;           // GUID as text
  std::string participant;  // its participant's name, "invar/<cell>/<process>" for ours
  std::string topic;
  std::string type;
  bool is_writer = false;
  bool is_local = false;  // of this node
  Profile qos;
  Instant found{INT64_MIN / 2};  // when, monotonic
};

struct ParticipantInfo {
  std::string id;  // GUID prefix as text
  std::string name;
};

struct Snapshot {
  std::vector<ParticipantInfo> participants;
  std::vector<Endpoint> endpoints;
};

/// Something about the transport that a person should know.
struct Alarm {
  std::string topic;
  std::string text;
  bool fault = true;  // otherwise a warning
};

/// The knowledge of one node's participants. Any thread.
class Discovery {
 public:
  /// `addresses`: where it hears discovery.
  void add_participant(const std::string& id, const std::string& name,
                       std::vector<PeerAddress> addresses = {});
  void remove_participant(const std::string& id);
  /// A new endpoint of ours or a foreign one. Each of ours is checked against all others of its topic. A pair
  /// that cannot match raises one alarm, which names both ends and the policy.
  void add_endpoint(Endpoint endpoint);
  void remove_endpoint(const std::string& id);
  void raise(Alarm alarm);
  /// Something else that may have an alarm to raise; it is asked each time that somebody takes the alarms.
  void add_source(std::function<std::optional<Alarm>()> source);
  /// A warning, once for each process and once for each of its names: a peer of this PC is reached by UDP only.
  void raise_slow_path(std::int32_t process, const std::string& name, const std::string& why);

  [[nodiscard]] Snapshot snapshot() const;
  /// The alarms since the last call, oldest first.
  [[nodiscard]] std::vector<Alarm> take_alarms();
  [[nodiscard]] std::string participant_name(const std::string& id) const;
  /// Its name, or what is known instead.
  [[nodiscard]] std::string name_of(const std::string& participant) const;
  /// Whose a writer is, and how strong.
  [[nodiscard]] Claimant claimant(const std::string& writer) const;
  /// Whether a participant has ended, though its lease runs on: another process uses its addresses, or nobody. Looked up five times a
  /// second at most; may take some milliseconds.
  [[nodiscard]] bool is_gone(const std::string& participant);

 private:
  void check(const Endpoint& one, const Endpoint& other);

  mutable std::mutex mutex_;
  struct Peer {
    std::string name;
    std::vector<PeerAddress> addresses;
    std::uint64_t number = 0;  // in the order of their coming
    Instant looked{INT64_MIN / 2};
    bool gone = false;
  };
  std::map<std::string, Peer> participants_;
  std::uint64_t came_ = 0;
  std::map<std::string, Endpoint> endpoints_;
  std::deque<Alarm> alarms_;
  std::vector<std::function<std::optional<Alarm>()>> sources_;
  std::mutex sources_mutex_;                             // one asks them at a time
  std::set<std::pair<std::int32_t, std::string>> slow_;  // peers that were told
};

}  // namespace invar::dds

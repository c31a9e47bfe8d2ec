// Node: how one process takes part in a cell - its participants, its ports on their topics, and typed or raw
// writing and reading for tools.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <typeindex>
#include <vector>

#include "core/base/clock.hpp"
#include "core/component/port.hpp"
#include "core/dds/discovery.hpp"
#include "core/dds/identity.hpp"
#include "core/dds/profile.hpp"
#include "core/dds/sample_key.hpp"

namespace invar::dds {

class CommandGate;
class HostClocks;

/// A PC on which processes of the cell run: where its participants are looked for, one by one, without multicast.
struct PeerHost {
  std::string address;
  std::size_t processes = 0;  // of the cell, on that PC
  bool operator==(const PeerHost&) const = default;
};

/// A process that finds out how far the clocks of the other hosts are apart, and gives its own.
struct ClockOptions {
  std::uint32_t cell = 0;
  std::string host;                // of this process, as the cell file names it
  std::vector<std::string> hosts;  // all of the cell: others do not count
};

struct NodeOptions {
  std::string cell;
  std::string process;  // name of this process or tool; participants are "invar/<cell>/<process>"
  std::uint32_t domain = 0;
  /// Addresses of this host that may carry the cell's traffic, beside its loopback; empty: all of its interfaces.
  std::vector<std::string> addresses;
  /// They need not be there yet: the node works within this PC until they come.
  bool may_come_later = false;
  /// The hosts of the cell, this one among them. Multicast finds others in addition, where the network lets it through.
  std::vector<PeerHost> peers;
  /// Only of a cell on several hosts in real time.
  std::optional<ClockOptions> clocks;
  bool shared_memory = true;
  /// Processes of the cell on this PC; they share /dev/shm.
  std::size_t processes = 1;
  /// Shared memory of the general participant [bytes]; a sample may take half of it.
  std::uint32_t segment_size = 16U << 20U;
  /// SCHED_FIFO priority of the middleware's threads that carry real-time traffic; 0: the usual scheduling.
  int realtime_priority = 0;
  /// The core of the loop: the thread that publishes its samples then shares it and, with a lower priority, runs the
  /// moment the loop sleeps.
  std::optional<int> realtime_cpu;
  /// Raw samples go by the general participant, too: no type is used here both raw and typed.
  bool raw_by_general = false;
  /// In a secured cell the node has one participant for all traffic. None: each program that reaches the network may take part.
  std::optional<Identity> identity;
};

/// How the samples of an output come from its loop to the middleware.
struct OutputBinding {
  /// Zero: the thread that writes calls the middleware itself (workers). Otherwise the loop's period: samples
  /// pass a ring, and a thread that keeps time with the loop publishes them.
  Duration period;
  /// The least time between two samples on the wire; those between are left out. Zero: every sample.
  Duration separation;
  /// Without a period: the middleware is left alone while nobody reads a volatile topic.
  bool watched_only = false;
};

/// Where a raw sample came from.
struct RawSample {
  std::span<const std::byte> cdr;  // with its encapsulation; valid during the call
  std::int64_t sent_ns = 0;        // source timestamp, UTC since 1970, by the sender's clock
  std::uint64_t sequence = 0;      // counts the writer's samples from 1: a gap is a loss
  std::string_view writer;         // GUID as text
  std::uint64_t participant = 0;   // of the writer: participant_key of its GUID prefix
};

using Clock = std::function<Instant()>;

[[nodiscard]] std::string topic_name(const std::string& cell, const std::string& component,
                                     const std::string& port);

/// Where the processes that command say that they live.
[[nodiscard]] std::string heartbeat_topic(const std::string& cell);

/// Where the processes of several hosts compare their clocks.
[[nodiscard]] std::string clock_topic(const std::string& cell);

/// Keeps a writer or reader alive; the node must outlive it.
class Connection {
 public:
  virtual ~Connection() = default;
  /// Foreign ends that are connected with this one now.
  [[nodiscard]] virtual std::size_t matched() const = 0;
  /// Samples lost on this side. Any thread.
  [[nodiscard]] virtual std::uint64_t lost() const = 0;
  /// Writers: a sample of the type that the connection was made for; false when the middleware refuses it.
  virtual bool write(const void* sample) = 0;
  /// Writers: waits until all reliable readers have everything; false when that took longer.
  virtual bool wait_for_acknowledgments(Duration patience) = 0;
  /// Writers: drops what is still held for readers. For samples that are known to have served their purpose.
  virtual void forget() {}
};

template <class T>
class Writer {
 public:
  explicit Writer(std::unique_ptr<Connection> connection) : connection_{std::move(connection)} {}
  bool write(const T& sample) { return connection_->write(&sample); }
  [[nodiscard]] Connection& connection() const { return *connection_; }

 private:
  std::unique_ptr<Connection> connection_;
};

/// Whose samples a port takes: of its owner's cell, and of the keys that the deployment or the component says.
[[nodiscard]] ExpectedKeys expected_keys(const InputPort& port);

class Node {
 public:
  Node(NodeOptions options, Profiles profiles);
  ~Node();
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  [[nodiscard]] const NodeOptions& options() const;
  /// Precondition: there is one of that name; deployments are checked before.
  [[nodiscard]] const Profile& profile(std::string_view name) const;
  [[nodiscard]] const Profiles& profiles() const;

  /// Set-up, before the loop runs: joins a port to its topic with its profile. The node must outlive all
  /// writing to the port, and the port must outlive the node or `stop`. Throws InputError when the topic is
  /// in use with another type or nobody registered the port's type.
  void bind(OutputPort& port, OutputBinding binding);
  void bind(OutputPort& port, OutputBinding binding, const Profile& profile);
  void bind(InputPort& port, Clock clock = utc_now);
  /// Starts the publishing threads of ports bound with a period. Discovery and receiving begin with `bind`.
  void start();
  /// Called at the end of each cycle, on the loop's thread. Wakes the threads that wait for a sample of this cycle, also in
  /// other processes of this PC. *Real-time*: one FUTEX_WAKE a thread that sleeps.
  void cycle_ended() noexcept;
  /// Publishes what is left and stops the threads. Readers of ports are removed: nothing arrives any more.
  void stop();

  /// Typed writing from any thread of the caller.
  template <class T>
  [[nodiscard]] Writer<T> writer(const std::string& topic, std::string_view profile_name) {
    return writer<T>(topic, profile(profile_name));
  }
  template <class T>
  [[nodiscard]] Writer<T> writer(const std::string& topic, const Profile& profile) {
    return Writer<T>{make_writer(topic, typeid(T), profile)};
  }
  /// Typed reading; `take` is called on a thread of the middleware and must not create or remove anything
  /// here.
  template <class T>
  [[nodiscard]] std::unique_ptr<Connection> reader(const std::string& topic, std::string_view profile_name,
                                                   std::function<void(const T&)> take) {
    return reader<T>(topic, profile(profile_name), std::move(take));
  }
  template <class T>
  [[nodiscard]] std::unique_ptr<Connection> reader(const std::string& topic, const Profile& profile,
                                                   std::function<void(const T&)> take) {
    return timed_reader<T>(topic, profile,
                           [take = std::move(take)](const T& sample, Instant) { take(sample); });
  }
  /// `take` is also told when the sample was sent, by the sender's clock (UTC).
  template <class T>
  [[nodiscard]] std::unique_ptr<Connection> timed_reader(const std::string& topic, const Profile& profile,
                                                         std::function<void(const T&, Instant sent)> take) {
    return make_reader(topic, typeid(T), profile, [take = std::move(take)](const void* sample, Instant sent) {
      take(*static_cast<const T*>(sample), sent);
    });
  }
  /// Bytes as they travel, whatever the type; for recorders and for looking at foreign topics. Uses a
  /// participant of its own, since a type can be known to a participant in one form only.
  [[nodiscard]] std::unique_ptr<Connection> raw_reader(const std::string& topic, const std::string& type,
                                                       const Profile& profile,
                                                       std::function<void(const RawSample&)> take,
                                                       bool keyed = true);
  /// Writes CDR bytes with encapsulation: `write` takes a pointer to a std::span<const std::byte>.
  [[nodiscard]] std::unique_ptr<Connection> raw_writer(const std::string& topic, const std::string& type,
                                                       const Profile& profile);

  /// nullptr without `clocks` in its options.
  [[nodiscard]] const HostClocks* clocks() const;
  /// The endpoints discovered so far; a full picture takes about a second after the node was made.
  [[nodiscard]] Snapshot snapshot() const;
  /// The alarms since the last call.
  [[nodiscard]] std::vector<Alarm> take_alarms();
  [[nodiscard]] Discovery& discovery();
  /// Samples lost by all ports of this node. Any thread.
  [[nodiscard]] std::uint64_t lost() const;
  /// The network is there again: groups are joined and peers are called at once, not at the next regular announcement.
  void network_is_back();

 private:
  std::unique_ptr<Connection> make_writer(const std::string& topic, std::type_index type,
                                          const Profile& profile);
  std::unique_ptr<Connection> make_reader(const std::string& topic, std::type_index type,
                                          const Profile& profile,
                                          std::function<void(const void*, Instant)> take);
  void send_heartbeats(std::uint32_t cell);
  void compare_clocks();
  void watch_commander(const InputPort& port, CommandGate& gate, const Clock& clock);
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace invar::dds

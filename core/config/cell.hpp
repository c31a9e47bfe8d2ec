// The cell file: which component runs in which process on which PC, and what is joined to what.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "core/config/security.hpp"
#include "core/config/yaml.hpp"

namespace invar::config {

/// One component of the cell file. Its own parameters stand beside `type`, `every`, `connect`,
/// `qos`, `publish` and `latency`.
struct CellComponent {
  std::string name;
  std::string type;
  std::uint32_t id = 0;                            // position in the file, from 1: the key of its samples
  std::int64_t every = 1;                          // stepped each `every`-th period
  std::map<std::string, std::string> connections;  // port -> "component.port", or "/topic" of the plant
  std::map<std::string, std::string> profiles;     // port -> QoS profile, where not the component's own
  std::map<std::string, double>
      publish_rates;  // output -> highest rate on the wire [Hz]; in the process it is full
  std::map<std::string, Duration> latencies;  // input -> how old its sample may be when a step reads it
  Node node;  // for its parameters and for faults; of a standby: that of the other
  /// Stands by for this one, with its parameters and connections; empty: for nobody.
  std::string standby_of{};
  std::optional<Duration> standby_deadline{};  // of the other's beats; none: by its period
  std::optional<Node> standby{};               // where it says so

  /// Whose topics its ports have.
  [[nodiscard]] const std::string& topics_of() const { return standby_of.empty() ? name : standby_of; }
};

/// The loop that a process asks the system for.
struct RealtimeRequest {
  int priority = 0;          // SCHED_FIFO, 1..99; 0: none
  std::optional<int> cpu;    // pin to it
  bool lock_memory = false;  // mlockall
  bool require = false;      // refuse to run where not granted; otherwise run and say so in every status
  std::optional<Duration> latency{};  // from when a cycle is due to the end of its work
};

enum class OverrunPolicy { skip, degrade, safe_stop };
/// The answer to a declared latency that is not kept; the status always says so.
enum class LatePolicy { mark, event, safe_stop };

struct CellProcess {
  std::string name;
  std::string host;
  Duration period;
  bool rate_known = true;  // no: `rate` has a fault; what follows from the period need not be told
  std::optional<RealtimeRequest> realtime;
  OverrunPolicy overrun = OverrunPolicy::skip;
  std::int64_t tolerate = 0;  // lost periods within a second before `degrade` or `safe_stop` acts
  LatePolicy late = LatePolicy::event;
  std::vector<CellComponent> components;  // in the order they are stepped
  std::string where;                      // "cell.yaml:12: processes.motion"
};

/// How `invar deploy` reaches a host.
struct SshAccess {
  std::string address;  // IPv4 or a name; empty: the host's `address`
  int port = 0;         // 0: what ssh takes
  std::string user;     // empty: what ssh takes
};

struct CellHost {
  std::string name;
  std::string address;    // IPv4; empty: that of `interface`, which others learn from its announcements
  std::string interface;  // "eth0"; empty: the one that has `address`
  SshAccess ssh{};
};

struct Cell {
  std::filesystem::path file;
  std::string name;
  std::uint32_t id = 0;
  int domain = 0;
  bool simulated_time = false;
  Duration window = Duration::milliseconds(20);  // of simulated time: how late another process sees a sample
  bool shared_memory = true;
  /// How long a process waits for its host's address, and then ends. None: it works alone until the address is there.
  std::optional<Duration> address_wait;
  /// How far the clocks of two hosts may be apart for a job to begin.
  Duration clock_bound = Duration::seconds(60.0);
  std::filesystem::path profiles;
  std::vector<std::filesystem::path>
      models;  // folders from which a command may load a model, beside the usual
  std::vector<std::filesystem::path> plugins;  // shared libraries with further component types
  std::vector<CellHost> hosts;
  std::vector<CellProcess> processes;
  std::map<std::string, std::string> jobs;  // job -> the component that runs it
  bool has_bridge = false;                  // to a plant; tools/cell reads it
  std::optional<CellSecurity> security;     // none: every program on the network may command

  [[nodiscard]] std::string topic(const std::string& component, const std::string& port) const {
    return "cell/" + name + "/" + component + "/" + port;
  }
  /// The topic that a connection means: "stage_x.state" of this cell, or "/plant/line1/pressure" as it is.
  [[nodiscard]] std::string topic(const std::string& connection) const;
  [[nodiscard]] const CellComponent* find(const std::string& component) const;
};

/// Why a text is no IPv4 address that one PC can have ("is no IPv4 address"): neither 0.x nor from 224.0.0.0 up (multicast, reserved,
/// broadcast; RFC 1122, 3.2.1.3). Empty: it is one.
[[nodiscard]] std::string flaw_of_address(const std::string& address);

/// As which `invar bridge` takes part in the cell, and whose key it has.
inline constexpr const char* bridge_name = "bridge";

/// Whose key `invar run` has on a host.
[[nodiscard]] std::string launcher_name(const std::string& host);

/// Reads the structure of a cell file; faults are put on the document, parameters of components are left to
/// their types. Component types are not known here: tools/cell checks them, and the connections.
Cell read_cell(const Yaml& yaml);

}  // namespace invar::config

// Simulated time over several processes, in lock-step and repeatable bit for bit.
//
// A master grants windows of time. In each window, every process does three things:
//
// 1. It delivers to its ports all samples of the window before, process by process in one fixed order, each in the
//    order written.
// 2. It runs its cycles.
// 3. It hands all its samples in one bundle to the master, whose next grant carries the bundles of all.
//
// That makes two messages a process and window, however many take part. A component sees nothing but its inputs: neither
// scheduling nor the time that a message took. A sample written in window k is seen elsewhere in window k + 1; inside a
// process as always.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/time.hpp"
#include "core/component/port.hpp"
#include "core/dds/bundle.hpp"
#include "core/dds/node.hpp"
#include "core/dds/wire_type.hpp"
#include "idl/lockstep.h"

namespace invar::dds {

/// A number for a name, the same everywhere (FNV-1a): processes in keys and in lock-step.
[[nodiscard]] std::uint32_t name_number(std::string_view name);

/// Collects what every process said of a window. Any thread.
class ReachedBoard {
 public:
  struct Entry {
    std::vector<std::uint8_t> samples;
    bool finished = false;
    std::string failure;
  };
  void put(const lockstep::TimeReached& part);
  /// Waits until all of `processes` answered `sequence` of `run`, and takes their answers, in that order; nothing when
  /// that takes longer than `patience` or `given_up` says so.
  std::optional<std::vector<Entry>> wait(std::uint64_t run, std::uint64_t sequence,
                                         const std::vector<std::uint32_t>& processes, Duration patience,
                                         const std::function<bool()>& given_up);
  /// Those that did not answer.
  [[nodiscard]] std::vector<std::uint32_t> missing(std::uint64_t run, std::uint64_t sequence,
                                                   const std::vector<std::uint32_t>& processes) const;

 private:
  struct Window {
    std::map<std::uint32_t, Entry> complete, partial;
  };
  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::size_t awaited_ = 0;  // nobody is woken for less
  std::map<std::pair<std::uint64_t, std::uint64_t>, Window> windows_;
};

/// How a span of simulated time ended.
struct Advance {
  Instant reached;
  bool finished = false;  // all processes said that nothing is left to do
  std::string failure;    // empty: none
};

class SimulatedClockMaster {
 public:
  /// `processes` by name, in the order in which their samples are delivered.
  SimulatedClockMaster(Node& node, std::vector<std::string> processes, Duration window);

  /// Waits until every process is there and connected with every other. Empty: so it is; otherwise who is missing.
  [[nodiscard]] std::string wait_for_all(Duration patience, const std::function<bool()>& given_up = {});
  /// Grants window after window up to `until`, or until all have finished or one has failed. `patience` is wall-clock
  /// time for one window.
  Advance advance_to(Instant until, Duration patience = Duration::milliseconds(120'000),
                     const std::function<bool()>& given_up = {});
  /// Tells all that no more time comes.
  void end();
  [[nodiscard]] Instant now() const { return now_; }

 private:
  void grant(lockstep::GrantKind kind, Instant until);
  void keep(const std::vector<ReachedBoard::Entry>& answers);
  [[nodiscard]] std::string names_of(const std::vector<std::uint32_t>& numbers) const;

  std::vector<std::string> names_;
  std::vector<std::uint32_t> numbers_;
  Duration window_;
  std::uint64_t run_, sequence_ = 0;
  Instant now_;
  Bundle answered_;  // by all in the window before
  ReachedBoard board_;
  Writer<lockstep::TimeGrant> writer_;
  std::unique_ptr<Connection> reader_;
};

/// A sample of any process, as a recorder in lock-step sees it.
struct LockstepSample {
  std::string_view process;
  const BundleTopic& topic;
  std::uint64_t sequence;  // counts the samples of this topic from this process, from 1
  Instant window;          // start of the window in which it is delivered
  std::span<const std::byte> cdr;
};

class SimulatedClockClient {
 public:
  /// The node's process name is this process's.
  explicit SimulatedClockClient(Node& node);

  /// Set-up, before `run`. Samples of this output go into the bundles. They also go on its topic of DDS for observers from
  /// outside, reliable and complete whatever its profile, so that fast simulated time loses nothing.
  /// `separation`: the least simulated time between two samples; those between are left out. Zero: every sample.
  void bind(OutputPort& port, Duration separation = {});
  /// Several may be bound to one topic.
  void bind(InputPort& port);
  /// Set-up, after the ports are bound: inboxes also hear writers that belong to no process of the cell, such as
  /// `invar job apply`. Their samples arrive with the window after they came, so such a run repeats only as they do.
  void listen_outside();
  /// Set-up. Sees every sample of every process, this one included, in one fixed order.
  void tap(std::function<void(const LockstepSample&)> sink);

  struct Run {
    bool ended = false;   // the master said so
    std::string failure;  // of the transport: nothing granted for so long, a malformed bundle
  };
  /// Serves grants until the master ends the run or `stop` is set. `advance` runs the executor up to a time; it
  /// returns why it cannot go on, or an empty text. `is_finished` says that this process has no work left.
  Run run(const std::function<std::string(Instant until)>& advance, const std::function<bool()>& is_finished,
          const std::atomic<bool>& stop, Duration patience = Duration::milliseconds(120'000));

 private:
  struct Binding {
    std::string topic;
    std::shared_ptr<Inlet> inlet;
    std::string type, profile;
    InputPort* port = nullptr;
    std::shared_ptr<CommandGate> gate;  // of what comes from outside
    std::shared_ptr<Inlet> probe;       // whether what comes from outside is what the port takes
  };
  /// A sample that came by DDS.
  struct FromOutside {
    std::string writer;
    Inlet* inlet = nullptr;
    std::vector<std::byte> cdr;
  };
  struct Peer {
    std::string name;
    std::vector<BundleTopic> topics;
    std::vector<std::uint64_t> counts;
    std::vector<std::vector<Inlet*>> inlets;  // by topic number
  };
  struct Grant {
    lockstep::TimeGrant head;           // its last part
    std::vector<std::uint8_t> samples;  // of all its parts
  };
  void put(const lockstep::TimeGrant& part);
  std::optional<Grant> next_grant(const std::atomic<bool>& stop, Duration patience);
  void join(const lockstep::TimeGrant& grant);
  /// Takes what all wrote in the window before to ports and tap. Empty: done.
  std::string deliver_all(const Grant& grant);
  void answer(const lockstep::TimeGrant& grant, const std::vector<std::uint8_t>& samples, bool finished,
              const std::string& failure);
  void learn(std::uint32_t process, const Membership& membership);
  void take_outside(const Binding& input, const RawSample& sample);
  void deliver_outside(Instant at);
  /// False: malformed.
  bool deliver(std::uint32_t process, std::span<const std::uint8_t> bundle, Instant at);

  Node& node_;
  std::uint32_t number_;
  std::uint64_t run_ = 0;
  Membership membership_;
  std::deque<bool> wanted_;  // by the number of our own topics; the addresses stay
  Bundle bundle_;
  std::vector<Binding> inputs_;
  std::map<std::uint32_t, Peer> peers_;
  std::function<void(const LockstepSample&)> tap_;
  std::mutex mutex_;
  std::condition_variable news_;
  std::vector<std::uint8_t> part_;  // of a grant whose last part is on its way
  std::deque<Grant> grants_;
  Writer<lockstep::TimeReached> writer_;
  std::unique_ptr<Connection> reader_;
  std::vector<FromOutside> outside_;
  std::vector<std::unique_ptr<Connection>> outside_readers_;
};

}  // namespace invar::dds

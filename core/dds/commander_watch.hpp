// CommanderWatch: how long those who command the components of this process are silent.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "core/component/port.hpp"
#include "core/dds/command_gate.hpp"
#include "core/dds/pulse.hpp"
#include "idl/commander.h"

namespace invar::dds {

/// A process that commands sends a heartbeat every 10 ms; one that obeys wakes every 5 ms and counts its own wakings since the
/// last heartbeat of the commander. A PC that is held up for 100 ms wakes late as often as it hears late, and takes nobody for
/// lost. A commander on the same PC is silent only when its process has ended: a loaded PC is no reason to stop. A
/// commander that never sent a heartbeat (another program) is lost when the lease of its writer runs out.
class CommanderWatch {
 public:
  static constexpr Duration beat_period = Duration::milliseconds(10);
  static constexpr Duration look_period = Duration::milliseconds(5);
  static constexpr std::int64_t ended = INT64_MAX;

  /// `own_address`: of this PC; a commander with the same one runs here.
  explicit CommanderWatch(std::string own_address) : own_address_{std::move(own_address)} {}
  ~CommanderWatch() = default;
  CommanderWatch(const CommanderWatch&) = delete;
  CommanderWatch& operator=(const CommanderWatch&) = delete;

  /// Set-up: `link` is told of those who pass the gate.
  void add(CommandGate& gate, Input<commander::Link>& link, std::function<Instant()> clock);
  [[nodiscard]] bool is_needed() const { return !watched_.empty(); }
  void heard(const commander::Heartbeat& beat);
  /// One waking.
  void look();
  void start(int priority);

 private:
  struct Watched {
    Input<commander::Link>* link;
    std::function<Instant()> clock;
    std::string participant;   // of who commanded last; empty: nobody
    std::uint64_t obeyed = 0;  // the waking at that time
    bool has_ended = false;
    std::uint64_t ended_at = 0;
    commander::Link sample;
  };
  struct Peer {
    std::uint64_t heard = 0;  // the waking at that time
    std::string who;
    std::int32_t pid = 0;
    bool is_here = false;
  };

  void obeyed(Watched& watched, const Claimant& who);
  void gone(Watched& watched);
  void update(Watched& watched);
  void give(Watched& watched, std::int64_t silence_ns);
  void name(Watched& watched);

  std::string own_address_;
  std::mutex mutex_;
  std::uint64_t wakings_ = 0;
  std::vector<std::unique_ptr<Watched>> watched_;
  std::map<std::string, Peer> peers_;
  std::optional<Pulse> pulse_;
};

/// Sends the heartbeat of this process. Its thread goes before the usual ones where the system allows that: the sign of life
/// must not wait for a calculation.
class Heart {
 public:
  using Send = std::function<void(const commander::Heartbeat&)>;
  Heart(Send send, commander::Heartbeat beat) : send_{std::move(send)}, sample_{std::move(beat)} {}
  ~Heart() = default;
  Heart(const Heart&) = delete;
  Heart& operator=(const Heart&) = delete;
  void start();

 private:
  Send send_;
  commander::Heartbeat sample_;
  std::optional<Pulse> pulse_;
};

}  // namespace invar::dds

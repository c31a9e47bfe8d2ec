// Standby: of two components that control one thing one leads, and the other stands by for it.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "core/base/range.hpp"
#include "core/component/component.hpp"
#include "core/component/notices.hpp"
#include "idl/standby.h"

namespace invar {

/// One pass over what a component keeps beyond its parameters. In `template <class W> void warm(W& w)`:
///
///   w(integral_, "integral", Range{-1e9, 1e9});   double; what is outside is not taken over
///   w(latched_, "latched");                       bool
///   w(mode_, "mode", AXIS_MODE_FAULT);            an enumeration and its last value
///   w(id_, "id");                                 std::uint64_t
///   w(began_, "began");                           Instant, against the time of the sample: the clocks of two PCs differ
///
/// Real-time.
class WarmPass {
 public:
  enum class Kind : std::uint8_t { store, check, load };
  WarmPass(Kind kind, standby::WarmState& sample) noexcept : kind_{kind}, sample_{sample} {}

  void operator()(double& value, std::string_view name, Range range) noexcept {
    const double put = take(name, value, [range](double v) { return range.contains(v); });
    if (loads()) value = put;
  }
  void operator()(bool& value, std::string_view name) noexcept {
    const double put = take(name, value ? 1.0 : 0.0, [](double v) { return v == 0.0 || v == 1.0; });
    if (loads()) value = put != 0.0;
  }
  template <class Enum>
  requires std::is_enum_v<Enum>
  void operator()(Enum& value, std::string_view name, Enum last) noexcept {
    const auto most = static_cast<double>(last);
    const double put = take(name, static_cast<double>(value),
                            [most](double v) { return v >= 0.0 && v <= most && v == static_cast<int>(v); });
    if (loads()) value = static_cast<Enum>(static_cast<int>(put));
  }
  void operator()(std::uint64_t& value, std::string_view name) noexcept {
    constexpr double half = 4294967296.0;
    const auto is_half = [](double v) {
      return v >= 0.0 && v < half && v == static_cast<double>(static_cast<std::uint32_t>(v));
    };
    const double high = take(name, static_cast<double>(value >> 32U), is_half);
    const double low = take(name, static_cast<double>(value & 0xFFFFFFFFU), is_half);
    if (loads()) value = (static_cast<std::uint64_t>(high) << 32U) | static_cast<std::uint64_t>(low);
  }
  void operator()(Instant& value, std::string_view name) noexcept {
    const Instant at{sample_.at().time_ns()};
    constexpr double longest = 1e8;  // s
    const double put = take(name, Range{-longest, longest}.clamp((value - at).in_seconds()),
                            [](double v) { return v >= -longest && v <= longest; });
    if (loads()) value = at + Duration::seconds(put);
  }
  [[nodiscard]] bool loads() const noexcept { return kind_ == Kind::load; }
  [[nodiscard]] bool is_sound() const noexcept { return is_sound_ && used_ <= sample_.values().size(); }
  [[nodiscard]] std::uint32_t used() const noexcept { return static_cast<std::uint32_t>(used_); }
  /// A hash of the names so far.
  [[nodiscard]] std::uint64_t layout() const noexcept { return layout_; }

 private:
  template <class Allowed>
  double take(std::string_view name, double value, Allowed allowed) noexcept {
    for (const char letter : name)
      layout_ = (layout_ ^ static_cast<unsigned char>(letter)) * 0x100000001B3U;  // FNV-1a
    layout_ = (layout_ ^ 0xFFU) * 0x100000001B3U;
    const std::size_t at = used_++;
    if (at >= sample_.values().size()) return value;
    if (kind_ == Kind::store) return sample_.values()[at] = value;
    const double put = sample_.values()[at];
    is_sound_ = is_sound_ && allowed(put);
    return put;
  }
  Kind kind_;
  standby::WarmState& sample_;
  std::size_t used_ = 0;
  std::uint64_t layout_ = 0xCBF29CE484222325U;
  bool is_sound_ = true;
};

/// Beats decide which one leads: each of the two writes its state once a step. The one that the file names first leads from
/// the start. The other takes over where the beats of the leader stay away for the deadline, or its process has ended, and
/// goes on from the last state that it heard. A leader that comes back stands by. Where two lead, as after a cut, the one
/// with the higher term does, and the other says that it stands by. A leader that stood still itself listens before it
/// commands again. One that was deactivated is not taken over from: what a person stopped stays so.
///
/// A component without a second one leads. The loop's thread steps it; what says so may be called from any thread. Real-time.
class Standby {
 public:
  /// Notices go by the port of the owner.
  Standby(Component& owner, Notices& notices) : owner_{owner}, notices_{notices} {}

  struct Pair {
    std::string other;            // in words: "`thermal` in process `heat` on heat-pc"
    std::string other_process{};  // its name
    std::string command;          // by which a person has this one lead
    bool is_spare = false;        // the file says that it stands by
    Duration deadline;            // of the other's beats
    bool is_same_pc = false;
    std::int32_t process = 0;  // own process id
  };
  /// Set-up.
  void pair(Pair pair) { pair_ = std::move(pair); }
  [[nodiscard]] const std::optional<Pair>& paired() const { return pair_; }

  void activate() noexcept;
  /// It is told to come to rest: it hands over no more, and takes over only what it asked for, which nobody else would bring to rest.
  void leave() noexcept { leaving_ = true; }
  /// It is deactivated.
  void resign() noexcept;

  enum class Duty : std::uint8_t {
    lead,
    stand_by,
    missing,  // nobody leads as far as is known: `take_over`, unless the device shows that somebody commands it
  };
  /// Once a step, before anything is commanded.
  [[nodiscard]] Duty look(const Tick& tick) noexcept;
  /// Where `missing`: the other commands nothing for certain, whatever the device shows: its process has ended, or it says so.
  [[nodiscard]] bool is_certain() const noexcept { return is_certain_; }
  /// Where `missing`: somebody may command the device, as `why` says, a literal: "but its device is still commanded".
  void wait_for_device(const char* why) noexcept;
  /// Leads from now on, with the state of the last leader where that is known and sound.
  template <class Owner>
  void take_over(Owner& owner) noexcept {
    bool loaded = false;
    if (has_state_) {
      WarmPass check{WarmPass::Kind::check, state_};
      owner.warm(check);
      loaded = check.is_sound() && check.used() == state_.count() && check.layout() == state_.layout();
      if (loaded) {
        WarmPass load{WarmPass::Kind::load, state_};
        owner.warm(load);
      }
    }
    begin_to_lead(loaded);
  }
  /// At the end of a step of the leader.
  template <class Owner>
  void tell(Owner& owner) noexcept {
    if (!pair_) return;
    owner_.stamp(own_);
    WarmPass store{WarmPass::Kind::store, own_};
    owner.warm(store);
    own_.layout(store.layout());
    own_.count(store.used());
    write();
  }
  /// At the end of a step of the other.
  void tell() noexcept {
    if (pair_) write();
  }
  /// When the last beat of a leader came: what was commanded before it that leader has heard.
  [[nodiscard]] Instant heard() const noexcept { return leader_heard_; }
  /// Once a step: does it reach what it controls? A leader whose process is about to end counts as one that does not. One that does takes the place of one that does not for a second.
  void fit(bool reaches) noexcept {
    own_.fit(reaches && !(leads() && hands_over_.load(std::memory_order_relaxed)));
  }
  /// Why it could not go on in the other's place; nullptr: it could. Must be a literal.
  void unready(const char* why) noexcept { unready_.store(why, std::memory_order_release); }
  /// The other was heard, and is not any more: it may lead.
  [[nodiscard]] bool is_in_doubt(const Tick& tick) const noexcept {
    return pair_ && was_heard_ && is_silent(tick);
  }
  /// A leader in doubt that does not reach its device commands no more until it knows that nobody else does.
  void yield() noexcept;

  // --- any thread

  [[nodiscard]] bool leads() const noexcept { return leads_.load(std::memory_order_acquire); }
  /// A person wants this one to lead: the other hands over. False where it leads already.
  bool ask() noexcept;
  /// Its process is about to end: where it leads, another one that can takes its place within two seconds.
  void hand_over() noexcept { hands_over_.store(true, std::memory_order_release); }
  /// Its process should not end yet: it leads and the other one can, or will be back, or the other one leads and cannot go on.
  [[nodiscard]] bool is_needed() const noexcept { return is_needed_.load(std::memory_order_acquire); }
  /// "active", "standby" or "took over"; empty where nobody stands by.
  [[nodiscard]] const char* role() const noexcept;
  /// For a person: nobody leads, or this one could not take over; empty: nothing to say.
  [[nodiscard]] std::string fault() const;
  /// Not real-time, now and then: looks whether the process of the other, on this PC, has ended.
  void look_for_process(bool (*is_alive)(std::int32_t process));
  /// The one that started the process of the other, on whatever PC, says that it has ended.
  void hear_of_end(std::int32_t process) noexcept;

 private:
  void begin_to_lead(bool with_state) noexcept;
  void hear() noexcept;
  [[nodiscard]] bool is_silent(const Tick& tick) const noexcept;
  [[nodiscard]] bool must_stay(const Tick& tick) noexcept;
  [[nodiscard]] Duty lead(const Tick& tick, bool stood_still) noexcept;
  [[nodiscard]] bool has_listened(const Tick& tick, bool heard) const noexcept;
  [[nodiscard]] Duty stand_by(const Tick& tick) noexcept;
  [[nodiscard]] Duty beside_one_that_does_not_lead(const Tick& tick) noexcept;
  [[nodiscard]] bool has_ended() const noexcept;  // the process of the other
  [[nodiscard]] Duty beside_nobody(const Tick& tick) noexcept;
  [[nodiscard]] Duty found_missing(const char* why, bool is_certain) noexcept;
  void step_down(event::Severity level, const char* why) noexcept;
  void write() noexcept;
  void say(event::Severity level, const char* begin, const char* end) noexcept;

  Component& owner_;
  Notices& notices_;
  Output<standby::WarmState> out_{owner_, "warm", "warm"};
  Input<standby::WarmState> in_{owner_, "other", {.optional = true, .profile = "warm"}};
  std::optional<Pair> pair_;

  standby::WarmState own_;
  standby::WarmState state_;  // of the last leader
  bool has_state_ = false;
  bool leaving_ = false;
  bool is_certain_ = false;
  bool has_handed_over_ = false;  // its process ends: it does not ask back
  bool waits_for_device_ = false;
  bool is_unsure_ = false;  // since it yielded
  bool other_resigned_ = false;
  bool was_heard_ = false;  // the other, since this one is active
  int unfit_steps_ = 0;     // in which the other did not reach what it controls
  bool listens_ = false;    // it stood still, and hears first whether the other leads by now
  const char* why_ = "";
  std::uint64_t received_ = 0;
  int silent_steps_ = 0;
  Instant heard_, leader_heard_;  // beats of the other, of those that led; by this clock
  Instant active_since_, last_step_, listens_since_;
  std::optional<Instant> nobody_since_;
  std::atomic<bool> leads_{true}, asked_{false}, nobody_{false}, hands_over_{false}, is_needed_{false};
  std::atomic<const char*> unready_{nullptr};
  std::atomic<std::int32_t> other_process_{0}, ended_process_{0};
  std::int32_t seen_process_ = 0;  // found alive
};

/// A component that another one of its type can stand by for. It has `template <class W> void warm(W& w)`, see WarmPass.
class Redundant {
 public:
  virtual ~Redundant() = default;
  [[nodiscard]] virtual Standby& standby() noexcept = 0;
  /// Set-up: why nobody can stand by for it.
  [[nodiscard]] virtual std::optional<Component::Unfit> without_standby() const { return {}; }
};

}  // namespace invar

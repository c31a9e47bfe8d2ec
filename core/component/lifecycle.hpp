// Lifecycle: which transition is allowed in which state, and requests that may be repeated without harm.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "core/component/component.hpp"

namespace invar {

/// The transitions that a supervisor may ask of a component.
///
///     unconfigured --configure--> inactive --activate--> active
///     unconfigured <--cleanup---- inactive <-deactivate- active     error --reset--> unconfigured
///     any state --shutdown--> finalized, which nothing leaves
///
/// The state error is entered by failing, never on request.
enum class Transition : std::uint8_t { configure, activate, deactivate, cleanup, shutdown, reset };

/// "active", "activate": as they stand in files, on command lines and in messages.
[[nodiscard]] std::string_view to_text(LifecycleState state);
[[nodiscard]] std::string_view to_text(Transition transition);
[[nodiscard]] std::optional<Transition> parse_transition(std::string_view text);

/// The meaning of a request in a state.
struct Decision {
  enum class Kind : std::uint8_t {
    go,       // carry it out; then the state is `target`
    already,  // the state is `target`: success, nothing to do
    refused   // not from this state, see `reason`
  };
  Kind kind = Kind::refused;
  LifecycleState target = LifecycleState::unconfigured;
  std::string_view reason;
};

/// The table. Pure; any thread.
[[nodiscard]] Decision decide(LifecycleState state, Transition transition);

/// How a request ended.
enum class Verdict : std::uint8_t { done, already, refused, failed };
[[nodiscard]] std::string_view to_text(Verdict verdict);

struct Outcome {
  std::uint64_t request = 0;
  Verdict verdict = Verdict::refused;
  LifecycleState state =
      LifecycleState::unconfigured;  // afterwards; for several components, the first that is not there
  std::string reason;                // when refused or failed: why, and how to mend it

  [[nodiscard]] bool ok() const { return verdict == Verdict::done || verdict == Verdict::already; }
};

/// Remembers the outcome of the last requests, so that one that is sent again (its reply was lost) is
/// answered as before instead of being carried out twice. Not thread-safe.
class RequestLog {
 public:
  explicit RequestLog(std::size_t capacity = 256) : capacity_{capacity} {}

  /// The answer that this id got; refused when the id belonged to another request. Id 0 is never remembered:
  /// its sender does not repeat.
  [[nodiscard]] std::optional<Outcome> find(std::uint64_t id, std::string_view component,
                                            Transition transition) const;
  void remember(std::string_view component, Transition transition, const Outcome& outcome);

 private:
  struct Entry {
    std::string component;
    Transition transition;
    Outcome outcome;
  };
  std::size_t capacity_;
  std::deque<Entry> entries_;
};

}  // namespace invar

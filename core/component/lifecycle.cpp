#include "core/component/lifecycle.hpp"

#include <array>

namespace invar {

namespace {

constexpr std::array<std::string_view, 5> state_names{"unconfigured", "inactive", "active", "finalized",
                                                      "error"};
constexpr std::array<std::string_view, 6> transition_names{"configure", "activate", "deactivate",
                                                           "cleanup",   "shutdown", "reset"};
constexpr std::array<std::string_view, 4> verdict_names{"done", "already", "refused", "failed"};

using enum LifecycleState;
using Kind = Decision::Kind;

constexpr std::string_view is_final = "it is finalized; only a restart of its process brings it back";
constexpr std::string_view in_error = "it is in error; reset it first";
constexpr std::string_view not_configured = "it is not configured; configure it first";
constexpr std::string_view is_running = "it is active; deactivate it first";
constexpr std::string_view no_error = "it is not in error; reset is for components that failed";

// Rows: the state. Columns: configure, activate, deactivate, cleanup, shutdown, reset.
constexpr std::array<std::array<Decision, 6>, 5> table{{
    // unconfigured
    {{{Kind::go, inactive, {}},
      {Kind::refused, unconfigured, not_configured},
      {Kind::refused, unconfigured, not_configured},
      {Kind::already, unconfigured, {}},
      {Kind::go, finalized, {}},
      {Kind::already, unconfigured, {}}}},
    // inactive
    {{{Kind::already, inactive, {}},
      {Kind::go, active, {}},
      {Kind::already, inactive, {}},
      {Kind::go, unconfigured, {}},
      {Kind::go, finalized, {}},
      {Kind::refused, inactive, no_error}}},
    // active
    {{{Kind::refused, active, is_running},
      {Kind::already, active, {}},
      {Kind::go, inactive, {}},
      {Kind::refused, active, is_running},
      {Kind::go, finalized, {}},
      {Kind::refused, active, no_error}}},
    // finalized
    {{{Kind::refused, finalized, is_final},
      {Kind::refused, finalized, is_final},
      {Kind::refused, finalized, is_final},
      {Kind::refused, finalized, is_final},
      {Kind::already, finalized, {}},
      {Kind::refused, finalized, is_final}}},
    // error
    {{{Kind::refused, error, in_error},
      {Kind::refused, error, in_error},
      {Kind::refused, error, in_error},
      {Kind::refused, error, in_error},
      {Kind::go, finalized, {}},
      {Kind::go, unconfigured, {}}}},
}};

}  // namespace

std::string_view to_text(LifecycleState state) { return state_names.at(static_cast<std::size_t>(state)); }
std::string_view to_text(Transition transition) {
  return transition_names.at(static_cast<std::size_t>(transition));
}
std::string_view to_text(Verdict verdict) { return verdict_names.at(static_cast<std::size_t>(verdict)); }

std::optional<Transition> parse_transition(std::string_view text) {
  for (std::size_t i = 0; i < transition_names.size(); ++i)
    if (transition_names[i] == text) return static_cast<Transition>(i);
  return std::nullopt;
}

Decision decide(LifecycleState state, Transition transition) {
  return table.at(static_cast<std::size_t>(state)).at(static_cast<std::size_t>(transition));
}

std::optional<Outcome> RequestLog::find(std::uint64_t id, std::string_view component,
                                        Transition transition) const {
  if (id == 0) return std::nullopt;
  for (const Entry& entry : entries_) {
    if (entry.outcome.request != id) continue;
    if (entry.component == component && entry.transition == transition) return entry.outcome;
    return Outcome{
        id, Verdict::refused, entry.outcome.state,
        "request id " + std::to_string(id) + " was already used for another request; take a new one"};
  }
  return std::nullopt;
}

void RequestLog::remember(std::string_view component, Transition transition, const Outcome& outcome) {
  if (outcome.request == 0) return;
  if (entries_.size() == capacity_) entries_.pop_front();
  entries_.push_back({std::string{component}, transition, outcome});
}

}  // namespace invar

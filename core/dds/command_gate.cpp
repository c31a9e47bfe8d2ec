#include "core/dds/command_gate.hpp"

#include <chrono>

#include "core/base/clock.hpp"
#include "core/base/shown.hpp"

namespace invar::dds {

namespace {
constexpr Duration between_alarms = Duration::milliseconds(5000);

std::string seconds(Duration time) { return shown(time.in_seconds(), 2) + " s"; }

/// The clock of the middleware's stamps, not the slewed one of ours.
Instant system_now() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return {std::chrono::duration_cast<std::chrono::nanoseconds>(now).count()};
}
}  // namespace

CommandGate::CommandGate(std::string topic, const Profile& profile, Discovery& discovery,
                         std::function<void()> refused)
    : topic_{std::move(topic)},
      lifespan_{profile.lifespan},
      discovery_{discovery},
      refused_{std::move(refused)},
      ownership_{profile.lease, static_cast<std::size_t>(profile.max_instances),
                 [&discovery](const Claimant& owner) { return discovery.is_gone(owner.participant); }} {}

bool CommandGate::passes(const Ownership::Instance& instance, const std::string& writer, Instant sent) {
  const std::lock_guard lock{mutex_};
  const Claimant who = discovery_.claimant(writer);
  const Duration age = system_now() - sent;
  if (lifespan_.ns > 0 && age > lifespan_) {
    tell(who, "it was sent " + seconds(age) + " before it arrived, and is not obeyed after " +
                  seconds(lifespan_) + " (lifespan); do the clocks of the PCs agree?");
    return false;
  }
  const Instant now = monotonic_now();
  const Claimant* owner = ownership_.claim(instance, who, now);
  if (owner == nullptr) return true;
  tell(who, "`" + discovery_.name_of(owner->participant) + "` commands there, with ownership strength " +
                std::to_string(owner->strength) + ", last " + seconds(now - ownership_.last(instance)) +
                " ago; this one has strength " + std::to_string(who.strength) +
                ": end the other, or give more to the one that shall win");
  return false;
}

void CommandGate::gone(const std::string& writer) {
  const std::lock_guard lock{mutex_};
  ownership_.release(writer);
  told_.erase(writer);
}

void CommandGate::tell(const Claimant& who, const std::string& why) {
  ++refusals_;
  if (refused_) refused_();
  Told& told = told_[who.writer];
  const Instant now = monotonic_now();
  if (now - told.at < between_alarms) {
    ++told.since;
    return;
  }
  const std::string more = told.since == 0 ? "" : " (and " + std::to_string(told.since) + " before)";
  discovery_.raise({topic_,
                    "a command of `" + discovery_.name_of(who.participant) + "` on `" + topic_ +
                        "` was not obeyed" + more + ": " + why,
                    false});
  told = {now, 0};
}

}  // namespace invar::dds

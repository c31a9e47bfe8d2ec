#include "core/dds/command_gate.hpp"

#include <algorithm>

#include "core/base/clock.hpp"
#include "core/dds/clock_offset.hpp"

namespace invar::dds {

namespace {
constexpr Duration between_alarms = Duration::milliseconds(5000);
constexpr std::size_t most_told = 1000;  // writers of which it is remembered what was told

std::string seconds(Duration time) { return seconds_text(time); }
}  // namespace

CommandGate::CommandGate(std::string topic, const Profile& profile, Discovery& discovery,
                         std::function<void()> refused)
    : topic_{std::move(topic)},
      exclusive_{profile.exclusive},
      lifespan_{profile.lifespan},
      discovery_{discovery},
      refused_{std::move(refused)},
      ownership_{profile.lease,
                 [&discovery](const Claimant& owner) { return discovery.is_gone(owner.participant); }} {}

/// Refuses what is older than the lifespan, by the clock of the sender less what that one is apart.
bool CommandGate::is_too_late(const Claimant& who, Duration age, Sender sender) {
  if (lifespan_.ns <= 0 || (age <= lifespan_ && age >= -lifespan_)) return false;
  const Instant now = monotonic_now();
  auto least = sender == Sender::of_cell ? least_.end() : least_.find(who.writer);
  const bool is_new = now - who.found < lifespan_;
  if (sender == Sender::other && least == least_.end() && (age < -lifespan_ || (age > lifespan_ && is_new))) {
    if (least_.size() >= most_told) least_.clear();
    least = least_.emplace(who.writer, Least{age, now}).first;
    raise("a sample of `" + discovery_.name_of(who.participant) + "` on `" + topic_ + "` " +
          (age.ns < 0 ? "was sent in the future" : "seems old") + " and is taken; " +
          clocks_apart("the sender's PC", Duration{} - age, "this one"));
  }
  if (least == least_.end()) {
    tell(who, "it was sent " + seconds(age) + " before it arrived, and is not obeyed after " +
                  seconds(lifespan_) + " (lifespan); " +
                  clocks_apart("the sender's PC", Duration{} - age, "this one") +
                  ", or look for what holds samples up");
    return true;
  }
  // Clocks drift apart, by less than a thousandth.
  Least& youngest = least->second;
  youngest = {std::min(youngest.age + (now - youngest.at) / 1000, age), now};
  const Duration late = age - youngest.age;
  if (late <= lifespan_) return false;
  tell(who, "it came " + seconds(late) +
                " later after it was sent than others of this sender, and is not obeyed after " +
                seconds(lifespan_) + " (lifespan)");
  return true;
}

bool CommandGate::passes(const std::string& writer, Instant sent, Sender sender) {
  const std::lock_guard lock{mutex_};
  const Claimant who = discovery_.claimant(writer);
  if (is_too_late(who, sender == Sender::of_cell ? utc_now() - sent : age_by_nearer_clock(sent), sender))
    return false;
  if (!exclusive_) return true;
  const Instant now = monotonic_now();
  const Claimant* owner = ownership_.claim(who, now);
  if (owner == nullptr) {
    if (follower_.obeyed) follower_.obeyed(who);
    return true;
  }
  tell(who, "`" + discovery_.name_of(owner->participant) + "` commands there, with ownership strength " +
                std::to_string(owner->strength) + ", last " + seconds(now - ownership_.last()) +
                " ago; this one has strength " + std::to_string(who.strength) +
                ": end the other, or give more to the one that shall win");
  return false;
}

void CommandGate::refuse(const std::string& writer, const std::string& why) {
  const std::lock_guard lock{mutex_};
  tell(discovery_.claimant(writer), why);
}

void CommandGate::gone(const std::string& writer) {
  const std::lock_guard lock{mutex_};
  if (ownership_.release(writer) && follower_.gone) follower_.gone();
  told_.erase(writer);
}

void CommandGate::tell(const Claimant& who, const std::string& why) {
  ++refusals_;
  if (refused_) refused_();
  if (told_.size() >= most_told && !told_.contains(who.writer)) told_.clear();
  Told& told = told_[who.writer];
  const Instant now = monotonic_now();
  if (now - told.at < between_alarms) {
    ++told.since;
    return;
  }
  const std::string more = told.since == 0 ? "" : " (and " + std::to_string(told.since) + " before)";
  raise(std::string{exclusive_ ? "a command" : "a sample"} + " of `" + discovery_.name_of(who.participant) +
        "` on `" + topic_ + "` was not " + (exclusive_ ? "obeyed" : "taken") + more + ": " + why);
  told = {now, 0};
}

void CommandGate::raise(const std::string& text) { discovery_.raise({topic_, text, false}); }

}  // namespace invar::dds

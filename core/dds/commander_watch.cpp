#include "core/dds/commander_watch.hpp"

#include <algorithm>

#include "core/base/clock.hpp"
#include "core/dds/live_process.hpp"

namespace invar::dds {

namespace {
constexpr std::size_t most_peers = 1000;  // processes that were heard; strangers take no more memory
constexpr std::uint64_t asked_after =
    6;  // wakings without a heartbeat, before a process of this PC is looked up
}  // namespace

void CommanderWatch::add(CommandGate& gate, Input<commander::Link>& link, std::function<Instant()> clock) {
  auto made = std::make_unique<Watched>();
  Watched& watched = *made;
  watched.link = &link;
  watched.clock = std::move(clock);
  watched.sample.cell(link.owner().cell);
  watched.sample.component_id(link.owner().id);
  {
    const std::lock_guard lock{mutex_};  // heartbeats come from the first one on
    watched_.push_back(std::move(made));
  }
  gate.follow({.obeyed = [this, &watched](const Claimant& who) { obeyed(watched, who); },
               .gone = [this, &watched] { gone(watched); }});
}

/// A command is a sign of life as well.
void CommanderWatch::obeyed(Watched& watched, const Claimant& who) {
  const std::lock_guard lock{mutex_};
  watched.obeyed = wakings_;
  watched.has_ended = false;
  if (watched.participant != who.participant) {
    watched.participant = who.participant;
    name(watched);
  }
  give(watched, 0);
}

void CommanderWatch::gone(Watched& watched) {
  const std::lock_guard lock{mutex_};
  watched.has_ended = true;
  watched.ended_at = wakings_;
  give(watched, ended);
}

void CommanderWatch::heard(const commander::Heartbeat& beat) {
  const std::lock_guard lock{mutex_};
  const std::string id = beat.participant().c_str();
  if (peers_.size() >= most_peers && !peers_.contains(id)) peers_.clear();
  const auto [known, first] = peers_.try_emplace(id);
  Peer& peer = known->second;
  peer.heard = wakings_;
  if (!first) return;
  const std::string address = beat.address().c_str();
  peer.who = "`" + std::string{beat.process().c_str()} + "` on " + address;
  peer.pid = static_cast<std::int32_t>(beat.process_id());
  peer.is_here = address == own_address_;
  for (auto& watched : watched_)
    if (watched->participant == id) name(*watched);
}

void CommanderWatch::name(Watched& watched) {
  const auto peer = peers_.find(watched.participant);
  watched.sample.who(peer != peers_.end() ? peer->second.who : "another program");
}

void CommanderWatch::look() {
  const std::lock_guard lock{mutex_};
  ++wakings_;
  for (auto& watched : watched_)
    if (!watched->participant.empty()) update(*watched);
}

void CommanderWatch::update(Watched& watched) {
  const auto found = peers_.find(watched.participant);
  if (watched.has_ended && (found == peers_.end() || found->second.heard <= watched.ended_at)) return;
  watched.has_ended = false;
  if (found == peers_.end()) return;
  const Peer& peer = found->second;
  const std::uint64_t wakings = wakings_ - std::max(peer.heard, watched.obeyed);
  const bool lives = peer.is_here && (wakings < asked_after || is_alive(peer.pid));
  give(watched, lives ? 0 : static_cast<std::int64_t>(wakings) * look_period.ns);
}

void CommanderWatch::give(Watched& watched, std::int64_t silence_ns) {
  const Instant now = watched.clock();
  watched.sample.at().time_ns(now.ns);
  watched.sample.silence_ns(silence_ns);
  watched.link->accept(watched.sample, now);
}

void CommanderWatch::start(int priority) {
  if (!watched_.empty() && !pulse_) pulse_.emplace("invar-watch", look_period, priority, [this] { look(); });
}

void Heart::start() {
  if (pulse_) return;
  pulse_.emplace("invar-heart", CommanderWatch::beat_period, 1, [this] {
    sample_.at().time_ns(utc_now().ns);
    send_(sample_);
  });
}

}  // namespace invar::dds

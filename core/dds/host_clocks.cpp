#include "core/dds/host_clocks.hpp"

#include <algorithm>
#include <random>

#include "core/base/clock.hpp"
#include "core/base/name.hpp"
#include "core/dds/clock_offset.hpp"

namespace invar::dds {

namespace {
constexpr std::size_t most_peers = 64;                     // processes of a cell; as many echoes travel
constexpr Duration silent_after = Duration::seconds(5.0);  // as the lease of a participant
constexpr std::size_t most_strangers = 16;
constexpr Duration longest_round = Duration::seconds(1.0);  // what took longer says nothing of a clock

/// A stamp that no process of this cell could send would overflow a sum: 146 years of UTC, 36 of a monotonic clock.
bool is_within(std::int64_t ns, std::int64_t most) { return ns > -most && ns < most; }

bool is_sane(const clock::Beat& beat) {
  constexpr std::int64_t utc = INT64_MAX / 2, monotonic = INT64_MAX / 8;
  return is_within(beat.sent_ns(), monotonic) && is_within(beat.stamps_ns(), utc) &&
         is_within(beat.system_ns(), utc) &&
         std::all_of(beat.echoes().begin(), beat.echoes().end(), [](const clock::Echo& echo) {
           return is_within(echo.sent_ns(), monotonic) && is_within(echo.received_ns(), monotonic);
         });
}

Duration magnitude(Duration d) { return d.ns < 0 ? Duration{} - d : d; }
}  // namespace

ClockReading ClockReading::now() {
  const Instant monotonic = monotonic_now();
  return {monotonic, utc_at(monotonic) - monotonic, system_offset()};
}

std::uint64_t participant_key(std::span<const unsigned char, 12> prefix) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325U;  // FNV-1a
  for (const unsigned char byte : prefix) hash = (hash ^ byte) * 0x100000001b3U;
  return hash == 0 ? 1 : hash;
}

HostClocks::HostClocks(std::uint32_t cell, std::string host, std::vector<std::string> hosts)
    : cell_{cell},
      host_{std::move(host)},
      hosts_{std::move(hosts)},
      id_{(std::uint64_t{std::random_device{}()} << 32U) | std::random_device{}()} {}

void HostClocks::add_participant(std::uint64_t key) {
  const std::lock_guard lock{mutex_};
  participants_.push_back(key);
}

clock::Beat HostClocks::beat(const ClockReading& own) {
  const std::lock_guard lock{mutex_};
  system_ = own.system;
  clock::Beat beat;
  beat.cell(cell_);
  beat.at().time_ns((own.monotonic + own.stamps).ns);
  beat.process_id(id_);
  beat.host(host_);
  beat.sent_ns(own.monotonic.ns);
  beat.stamps_ns(own.stamps.ns);
  beat.system_ns(own.system.ns);
  beat.participants(participants_);
  for (const auto& [id, peer] : peers_) {
    if (own.monotonic - peer.heard > silent_after) continue;
    clock::Echo echo;
    echo.process_id(id);
    echo.sent_ns(peer.sent_ns);
    echo.received_ns(peer.heard.ns);
    beat.echoes().push_back(echo);
  }
  return beat;
}

const HostClocks::Measurement& HostClocks::best(const Peer& peer) {
  return *std::min_element(
      peer.last.begin(),
      peer.last.begin() + static_cast<std::ptrdiff_t>(std::min(peer.count, peer.last.size())),
      [](const Measurement& a, const Measurement& b) { return a.round_trip < b.round_trip; });
}

void HostClocks::heard(const clock::Beat& beat, const ClockReading& own) {
  if (beat.cell() != cell_ || beat.process_id() == id_ || !is_sane(beat)) return;
  const std::lock_guard lock{mutex_};
  const std::string from = beat.host().to_string();
  if (std::find(hosts_.begin(), hosts_.end(), from) == hosts_.end()) {
    if (strangers_.size() < most_strangers && strangers_.insert(from).second) untold_.push_back(from);
    return;
  }
  std::erase_if(peers_,
                [&](const auto& entry) { return own.monotonic - entry.second.heard > silent_after * 12; });
  if (peers_.size() >= most_peers && !peers_.contains(beat.process_id()))
    peers_.erase(std::min_element(peers_.begin(), peers_.end(), [](const auto& a, const auto& b) {
      return a.second.heard < b.second.heard;
    }));
  Peer& peer = peers_[beat.process_id()];
  peer.host = from;
  peer.heard = own.monotonic;
  peer.sent_ns = beat.sent_ns();
  peer.system = {beat.system_ns()};
  for (const clock::Echo& echo : beat.echoes()) {
    if (echo.process_id() != id_) continue;
    const std::int64_t there = echo.received_ns() - echo.sent_ns(), back = beat.sent_ns() - own.monotonic.ns;
    const Duration round{(own.monotonic.ns - echo.sent_ns()) - (beat.sent_ns() - echo.received_ns())};
    if (round.ns >= 0 && round < longest_round)
      peer.last[peer.count++ % peer.last.size()] = {{(there + back) / 2}, round};
  }
  if (peer.count == 0) return;
  const Measurement& offset = best(peer);
  const Duration ahead = offset.offset + Duration{beat.stamps_ns()} - own.stamps;
  for (const std::uint64_t participant : beat.participants())
    know(participant, magnitude(ahead) > offset.round_trip / 2 ? ahead : Duration{});
}

const HostClocks::Known* HostClocks::find(std::uint64_t participant) const noexcept {
  for (std::size_t i = 0; i < most_known; ++i) {
    const Known& known = known_[(participant + i) % most_known];
    const std::uint64_t there = known.participant.load(std::memory_order_acquire);
    if (there == participant) return &known;
    if (there == 0) return nullptr;
  }
  return nullptr;
}

/// One thread at a time. A table that is full (a hundred restarts) begins anew: what is missing comes with the next beats.
void HostClocks::know(std::uint64_t participant, Duration ahead) noexcept {
  for (std::size_t i = 0; i < most_known; ++i) {
    Known& known = known_[(participant + i) % most_known];
    const std::uint64_t there = known.participant.load(std::memory_order_relaxed);
    if (there != 0 && there != participant) continue;
    known.ahead_ns.store(ahead.ns, std::memory_order_relaxed);
    known.participant.store(participant, std::memory_order_release);
    return;
  }
  for (Known& known : known_) known.participant.store(0, std::memory_order_relaxed);
}

Duration HostClocks::stamps_ahead(std::uint64_t participant) const noexcept {
  const Known* known = find(participant);
  return known == nullptr ? Duration{} : Duration{known->ahead_ns.load(std::memory_order_relaxed)};
}

std::string HostClocks::take_stranger() {
  const std::lock_guard lock{mutex_};
  if (untold_.empty()) return "";
  const std::string name = printable(untold_.back());
  untold_.pop_back();
  return "a program compares clocks as host `" + name +
         "`, which the cell does not have: it does not count; end it, or start it with this cell file";
}

std::string HostClocks::farther_than(Duration bound) const {
  std::map<std::string, Duration> nearest;
  const Instant now = monotonic_now();
  {
    const std::lock_guard lock{mutex_};
    for (const auto& [id, peer] : peers_) {
      if (!is_heard(peer, now)) continue;
      const Duration ahead = ahead_of_us(peer);
      const auto [known, first] = nearest.try_emplace(peer.host, ahead);
      if (!first && magnitude(ahead) < magnitude(known->second)) known->second = ahead;
    }
  }
  for (const auto& [host, ahead] : nearest)
    if (magnitude(ahead) > bound)
      return clocks_apart("host `" + host + "`", ahead, "`" + host_ + "`") +
             "; `clock_bound` of the cell is " + seconds_text(bound);
  return "";
}

bool HostClocks::is_heard(const Peer& peer, Instant monotonic) const {
  return peer.count > 0 && peer.host != host_ && monotonic - peer.heard <= silent_after;
}

Duration HostClocks::ahead_of_us(const Peer& peer) const { return best(peer).offset + peer.system - system_; }

std::vector<HostClock> HostClocks::hosts(Instant monotonic) const {
  const std::lock_guard lock{mutex_};
  std::map<std::string, HostClock> found;
  for (const auto& [id, peer] : peers_) {
    if (!is_heard(peer, monotonic)) continue;
    const HostClock clock{peer.host, ahead_of_us(peer), best(peer).round_trip / 2};
    const auto [known, first] = found.try_emplace(peer.host, clock);
    if (!first && clock.error < known->second.error) known->second = clock;
  }
  std::vector<HostClock> all;
  all.reserve(found.size());
  for (auto& [host, clock] : found) all.push_back(std::move(clock));
  return all;
}

}  // namespace invar::dds

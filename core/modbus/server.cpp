#include "core/modbus/server.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"
#include "core/modbus/listener.hpp"

namespace invar::modbus {

Server::Server(RegisterMap map, ServerOptions options)
    : map_{std::move(map)},
      faults_{std::move(options.faults)},
      was_written_(map_.registers.size()),
      pending_(map_.registers.size()),
      lost_{map_.heartbeat.has_value()},
      image_{map_} {
  for (std::size_t i = 0; i < map_.registers.size(); ++i) values_.push_back(image_.value(i));
  if (lost_ && map_.comm_loss.flag) image_.set(*map_.comm_loss.flag, 1.0);
  listener_ = std::make_unique<Listener>(
      options.host, options.port, [this](std::span<const std::uint8_t> request) { return handle(request); },
      [this] {
        const std::lock_guard lock{mutex_};
        ++counters_.connections;
      });
}

Server::~Server() = default;

std::uint16_t Server::port() const { return listener_->port(); }

std::size_t Server::index(std::string_view name) const {
  const auto found = map_.find(name);
  INVAR_EXPECTS(found.has_value(), map_.device, name);
  return *found;
}

double Server::value(std::size_t reg) const {
  INVAR_EXPECTS(reg < values_.size(), map_.device, reg);
  return values_[reg];
}

bool Server::was_written(std::size_t reg) const {
  INVAR_EXPECTS(reg < values_.size(), map_.device, reg);
  return was_written_[reg];
}

void Server::set(std::size_t reg, double value) {
  INVAR_EXPECTS(reg < values_.size(), map_.device, reg);
  pending_[reg] = value;
}

ServerCounters Server::counters() const {
  const std::lock_guard lock{mutex_};
  return counters_;
}

bool Server::is_frozen(std::size_t reg) const {
  return std::any_of(active_.begin(), active_.end(), [&](const ScriptedFault& fault) {
    return fault.kind == FaultKind::freeze && fault.reg == reg;
  });
}

void Server::exchange(Instant now) {
  if (!started_) start_ = now;
  started_ = true;
  bool refuse = false;
  {
    const std::lock_guard lock{mutex_};
    active_.clear();
    for (const auto& fault : faults_)
      if (fault.is_active(now - start_)) active_.push_back(fault);
    refuse = std::any_of(active_.begin(), active_.end(),
                         [](const ScriptedFault& fault) { return fault.kind == FaultKind::refuse; });
    std::fill(was_written_.begin(), was_written_.end(), false);
    for (const std::size_t reg : written_) was_written_[reg] = true;
    written_.clear();
    for (std::size_t reg = 0; reg < pending_.size(); ++reg) {
      if (!pending_[reg] || is_frozen(reg)) continue;
      if (!was_written_[reg]) image_.set(reg, *pending_[reg]);
      pending_[reg].reset();
    }
    watch(now);
    for (std::size_t reg = 0; reg < values_.size(); ++reg) values_[reg] = image_.value(reg);
  }
  if (refuse != refusing_) listener_->refuse(refuse);  // the thread may wait for our mutex: not under it
  refusing_ = refuse;
}

void Server::watch(Instant now) {
  if (!map_.heartbeat) return;
  const Heartbeat& heartbeat = *map_.heartbeat;
  const double beat = image_.value(heartbeat.reg);
  if (beat != values_[heartbeat.reg]) {
    last_beat_ = now;
    lost_ = false;
  }
  // A master may have written anything that the register holds.
  constexpr Range any_timeout{0.0, 1e6};
  const double setting =
      heartbeat.timeout_setting ? image_.value(*heartbeat.timeout_setting) : heartbeat.timeout.in_seconds();
  const Duration timeout =
      std::isnan(setting) ? heartbeat.timeout : Duration::seconds(any_timeout.clamp(setting));
  if (now - last_beat_ > timeout) lost_ = true;
  if (map_.comm_loss.flag && !is_frozen(*map_.comm_loss.flag))
    image_.set(*map_.comm_loss.flag, lost_ ? 1.0 : 0.0);
  if (!lost_) return;
  for (const auto& [reg, value] : map_.comm_loss.set) image_.set(reg, value);
}

Verdict Server::handle(std::span<const std::uint8_t> request) {
  const std::lock_guard lock{mutex_};
  ++counters_.requests;
  Verdict verdict;
  const Request wanted = Image::parse(request);
  const ScriptedFault* mangled =
      nullptr;  // the fault that spoils the answer to a request that was carried out
  for (const auto& fault : active_) {
    if (!(wanted.is_write ? fault.on_writes : fault.on_reads)) continue;
    switch (fault.kind) {
      case FaultKind::refuse:
      case FaultKind::drop:
        verdict.close = true;
        return verdict;
      case FaultKind::exception:
        if (fault.reg && !image_.touches(wanted, *fault.reg)) break;
        ++counters_.exceptions;
        verdict.size = image_.answer_exception(request, fault.code, verdict.reply);
        return verdict;
      case FaultKind::delay:
        verdict.delay = std::max(verdict.delay, fault.by);
        break;
      case FaultKind::freeze:
        break;
      default:
        mangled = &fault;
    }
  }
  // A device with an address of its own answers to its unit, to 255 and to 0; others would be behind a
  // gateway.
  const std::uint8_t unit = request[6];
  constexpr std::uint8_t gateway_target_failed = 11;
  if (unit == map_.unit || unit == 255 || unit == 0)
    verdict.size = image_.answer(request, verdict.reply, written_);
  else
    verdict.size = image_.answer_exception(request, gateway_target_failed, verdict.reply);
  const bool refused = verdict.size > 7 && (verdict.reply[7] & 0x80U) != 0;
  counters_.exceptions += refused ? 1 : 0;
  counters_.writes += !refused && wanted.is_write ? 1 : 0;
  if (mangled == nullptr) return verdict;
  if (mangled->kind == FaultKind::lose_answer) {
    verdict.size = 0;
    verdict.close = true;
  } else if (mangled->kind == FaultKind::cut_short) {
    verdict.size /= 2;
  } else {
    for (auto& byte : verdict.reply) byte ^= 0x5A;
  }
  return verdict;
}

}  // namespace invar::modbus

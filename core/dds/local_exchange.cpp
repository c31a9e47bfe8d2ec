#include "core/dds/local_exchange.hpp"

#include <pthread.h>
#include <sys/prctl.h>

#include <algorithm>
#include <bit>
#include <new>

#include "core/base/clock.hpp"

namespace invar::dds {

namespace {

std::string bell_name(const ParticipantId& participant) {
  constexpr const char* digits = "0123456789abcdef";
  std::string text = "bell_";
  for (const std::uint8_t byte : participant) text.append({digits[byte >> 4U], digits[byte & 15U]});
  return text;
}

/// The loop rings a bell within a cycle of looking it up; a place is used anew only long after.
constexpr Duration rest_of_a_bell = Duration::milliseconds(2000);
/// A reader that attached before its writer knew its bell is served at least this often.
constexpr Duration longest_sleep = Duration::milliseconds(100);
/// A writer without a ring after so many looks, one in each `longest_sleep`, is no writer of ours.
constexpr int most_tries = 20;

}  // namespace

ParticipantId participant_of(const EndpointId& endpoint) {
  ParticipantId participant;
  std::copy_n(endpoint.begin(), participant.size(), participant.begin());
  return participant;
}

// --- LocalWriter

LocalWriter::LocalWriter(LocalExchange& exchange, std::unique_ptr<SampleRing> ring)
    : exchange_{exchange}, ring_{std::move(ring)} {}

LocalWriter::~LocalWriter() {
  for (const auto& [reader, bit] : bells_) exchange_.close_bell(bit);
}

void LocalWriter::commit(std::size_t size) noexcept {
  ring_->commit(size);
  exchange_.pending_ |= mask_.load(std::memory_order_acquire);
}

void LocalWriter::matched(const EndpointId& reader) {
  const std::lock_guard lock{mutex_};
  if (!bells_.contains(reader)) bells_[reader] = exchange_.open_bell(participant_of(reader));
  decide();
}

void LocalWriter::unmatched(const EndpointId& reader) {
  const std::lock_guard lock{mutex_};
  const auto found = bells_.find(reader);
  if (found == bells_.end()) return;
  const std::uint32_t bit = found->second;
  bells_.erase(found);
  ring_->detach(reader);  // a killed reader cannot do so itself
  decide();
  exchange_.close_bell(bit);
}

void LocalWriter::update() {
  if (ring_->changes() == seen_changes_.load(std::memory_order_relaxed)) return;
  const std::lock_guard lock{mutex_};
  decide();
}

void LocalWriter::decide() {
  seen_changes_ = ring_->changes();
  std::uint32_t mask = 0;
  bool needs_middleware = false;
  for (const auto& [reader, bit] : bells_) {
    mask |= bit;
    needs_middleware = needs_middleware || bit == 0 || !ring_->is_attached(reader);
  }
  mask_.store(mask, std::memory_order_release);
  needs_middleware_ = needs_middleware;
}

// --- LocalReader

LocalReader::LocalReader(LocalExchange& exchange, Deliver deliver)
    : exchange_{exchange}, deliver_{std::move(deliver)} {
  const std::lock_guard lock{exchange_.readers_mutex_};
  exchange_.readers_.push_back(this);
}

LocalReader::~LocalReader() { end(); }

void LocalReader::end() {
  const std::lock_guard lock{exchange_.readers_mutex_};
  for (auto& [writer, source] : sources_) source.ring->detach(source.reader);
  sources_.clear();
  pending_.clear();
  std::erase(exchange_.readers_, this);
}

void LocalReader::matched(const EndpointId& writer, const EndpointId& reader) {
  const std::lock_guard lock{exchange_.readers_mutex_};
  if (sources_.contains(writer)) return;
  if (!attach(writer, reader)) pending_[writer] = {reader, 0};
  exchange_.start_receiving();
}

bool LocalReader::attach(const EndpointId& writer, const EndpointId& reader) {
  auto ring = SampleRing::open(writer);
  if (!ring || !ring->attach(reader)) return false;
  sources_.emplace(writer, Source{reader, std::move(ring)});
  return true;
}

void LocalReader::look_again() {
  for (auto next = pending_.begin(); next != pending_.end();) {
    const auto one = next++;
    if (attach(one->first, one->second.reader) || ++one->second.tries == most_tries) pending_.erase(one);
  }
}

void LocalReader::unmatched(const EndpointId& writer) {
  const std::lock_guard lock{exchange_.readers_mutex_};
  pending_.erase(writer);
  const auto found = sources_.find(writer);
  if (found == sources_.end()) return;
  found->second.ring->detach(found->second.reader);
  sources_.erase(found);
  const std::lock_guard served{served_mutex_};
  served_.erase(writer);
}

bool LocalReader::serves(const EndpointId& writer) const {
  const std::lock_guard lock{served_mutex_};
  return served_.contains(writer);
}

bool LocalReader::read() {
  bool found = false;
  for (auto& [writer, source] : sources_) {
    if (!source.is_served && source.ring->skip()) serve(writer, source);
    const std::uint64_t lost = source.ring->read([&](std::span<const std::byte> cdr) {
      found = true;
      deliver_(cdr);
    });
    lost_.fetch_add(lost, std::memory_order_relaxed);
  }
  return found;
}

void LocalReader::serve(const EndpointId& writer, Source& source) {
  // Every sample that the topic delivered until now was in the ring before: after this skip none comes twice.
  {
    const std::lock_guard lock{served_mutex_};
    served_.insert(writer);
  }
  source.is_served = true;
  (void)source.ring->skip();
}

// --- LocalExchange

LocalExchange::LocalExchange(const ParticipantId& own, int priority) : priority_{priority} {
  remove_abandoned_shared_files();
  own_bell_ = SharedFile::make(bell_name(own), sizeof(Bell));
  if (own_bell_) new (own_bell_->data()) Bell;
}

LocalExchange::~LocalExchange() {
  stopping_ = true;
  if (own_bell_) ring(*std::launder(reinterpret_cast<Bell*>(own_bell_->data())));
  if (thread_.joinable()) thread_.join();
}

std::shared_ptr<LocalWriter> LocalExchange::writer(const EndpointId& id, std::size_t sample_size) {
  auto ring = SampleRing::make(id, sample_size);
  return ring ? std::make_shared<LocalWriter>(*this, std::move(ring)) : nullptr;
}

std::shared_ptr<LocalReader> LocalExchange::reader(LocalReader::Deliver deliver) {
  return own_bell_ ? std::make_shared<LocalReader>(*this, std::move(deliver)) : nullptr;
}

void LocalExchange::wake_readers() noexcept {
  for (std::uint32_t rest = pending_; rest != 0; rest &= rest - 1)
    if (Bell* bell = open_[static_cast<std::size_t>(std::countr_zero(rest))].load(std::memory_order_acquire))
      ring(*bell);
  pending_ = 0;
}

std::uint32_t LocalExchange::open_bell(const ParticipantId& participant) {
  const std::lock_guard lock{bells_mutex_};
  const Instant now = monotonic_now();
  ForeignBell* free = nullptr;
  for (ForeignBell& bell : bells_) {
    if (bell.users > 0 && bell.participant == participant) {
      ++bell.users;
      return 1U << static_cast<unsigned>(&bell - bells_.data());
    }
    const bool has_rested = bell.file == nullptr || now - bell.left > rest_of_a_bell;
    if (bell.users == 0 && has_rested && free == nullptr) free = &bell;
  }
  if (free == nullptr) return 0;
  auto file = SharedFile::open(bell_name(participant));
  if (!file || file->size() < sizeof(Bell)) return 0;
  const auto index = static_cast<unsigned>(free - bells_.data());
  open_[index].store(std::launder(reinterpret_cast<Bell*>(file->data())), std::memory_order_release);
  *free = {participant, std::move(file), 1, {}};
  return 1U << index;
}

void LocalExchange::close_bell(std::uint32_t bit) {
  if (bit == 0) return;
  const std::lock_guard lock{bells_mutex_};
  const auto index = static_cast<std::size_t>(std::countr_zero(bit));
  ForeignBell& bell = bells_[index];
  if (--bell.users > 0) return;
  open_[index].store(nullptr, std::memory_order_release);
  bell.left = monotonic_now();
}

void LocalExchange::start_receiving() {
  if (thread_.joinable()) return;
  thread_ = std::thread{[this] { receive(); }};
  if (priority_ <= 0) return;
  sched_param parameters{};
  parameters.sched_priority = priority_;
  (void)pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &parameters);
}

void LocalExchange::receive() {
  prctl(PR_SET_NAME, "invar-receive");
  prctl(PR_SET_TIMERSLACK, 1);
  Bell& bell = *std::launder(reinterpret_cast<Bell*>(own_bell_->data()));
  Instant looked = monotonic_now();
  while (!stopping_) {
    const std::uint32_t rung = bell.rung.load(std::memory_order_acquire);
    const bool look = monotonic_now() - looked >= longest_sleep;
    if (look) looked = monotonic_now();
    bool found = false;
    {
      const std::lock_guard lock{readers_mutex_};
      for (LocalReader* reader : readers_) {
        found = reader->read() || found;
        if (look) reader->look_again();
      }
    }
    if (!found) sleep_on(bell, rung, longest_sleep);
  }
}

}  // namespace invar::dds

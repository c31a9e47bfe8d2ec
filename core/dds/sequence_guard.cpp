#include "core/dds/sequence_guard.hpp"

#include <algorithm>
#include <cstring>

namespace invar::dds {

namespace {

constexpr auto relaxed = std::memory_order_relaxed;
constexpr std::int64_t unheard = -1;

/// Mixes 64 bits so that each decides over each (the finaliser of SplitMix64).
std::uint64_t mixed(std::uint64_t x) {
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

std::uint64_t hash(const GuidPrefix& prefix) {
  std::uint64_t head = 0;
  std::uint32_t tail = 0;
  std::memcpy(&head, prefix.data(), sizeof head);
  std::memcpy(&tail, prefix.data() + sizeof head, sizeof tail);
  return mixed(mixed(head) ^ tail);
}

/// Never zero: that is a free place.
std::uint64_t key_of(std::uint64_t prefix, std::uint32_t entity) { return mixed(prefix ^ entity) | 1U; }

std::uint64_t sample_key(std::uint32_t writer, std::int64_t number) {
  return mixed(mixed(writer) ^ static_cast<std::uint64_t>(number)) | 1U;
}

}  // namespace

SequenceGuard::SequenceGuard()
    : entries_{std::make_unique<std::array<Entry, buckets * ways>>()},
      sent_{std::make_unique<std::array<Sent, samples>>()} {}

SequenceGuard::Entry* SequenceGuard::find(std::uint64_t key, std::uint64_t in_bucket_of) const {
  Entry* const bucket = entries_->data() + (in_bucket_of >> 8U) % buckets * ways;
  Entry* const found = std::find_if(bucket, bucket + ways,
                                    [&](const Entry& entry) { return entry.writer.load(relaxed) == key; });
  return found == bucket + ways ? nullptr : found;
}

void SequenceGuard::know(const GuidPrefix& prefix, std::uint32_t entity) {
  const std::uint64_t of_prefix = hash(prefix);
  const std::uint64_t key = key_of(of_prefix, entity);
  const std::lock_guard lock{mutex_};
  if (find(key, key) != nullptr) return;
  Entry* const free = find(0, key);
  if (free == nullptr) return;
  free->prefix = of_prefix;
  free->number.store(unheard, relaxed);
  free->writer.store(key, std::memory_order_release);
}

void SequenceGuard::forget(const GuidPrefix& prefix, std::uint32_t entity) {
  const std::uint64_t key = key_of(hash(prefix), entity);
  const std::lock_guard lock{mutex_};
  if (Entry* const entry = find(key, key)) entry->writer.store(0, relaxed);
}

void SequenceGuard::forget(const GuidPrefix& prefix) {
  const std::uint64_t of_prefix = hash(prefix);
  const std::lock_guard lock{mutex_};
  for (Entry& entry : *entries_)
    if (entry.writer.load(relaxed) != 0 && entry.prefix == of_prefix) entry.writer.store(0, relaxed);
}

bool SequenceGuard::admits(const GuidPrefix& prefix, std::uint32_t entity, std::int64_t number, Step step,
                           Instant now) {
  if (number > last) return false;
  const std::uint64_t key = key_of(hash(prefix), entity);
  Entry* const entry = find(key, key);
  if (entry == nullptr) return true;
  const bool walked = step == Step::walked;
  const std::int64_t rate = walked ? walked_rate : filed_rate;
  const std::int64_t newest = entry->number.load(relaxed);
  const std::int64_t elapsed = std::max<std::int64_t>(now.ns - entry->time_ns.load(relaxed), 0);
  const std::int64_t allowed =
      newest == unheard ? (walked ? first_walked : last) : newest + leap + elapsed / (1'000'000'000 / rate);
  if (number > allowed) return false;
  if (number > newest) entry->number.store(number, relaxed);
  entry->time_ns.store(now.ns, relaxed);
  return true;
}

void SequenceGuard::sent(std::uint32_t writer, std::int64_t number, std::uint32_t fragments) {
  const std::uint64_t key = sample_key(writer, number);
  Sent& sample = (*sent_)[(key >> 8U) % samples];
  if (sample.sample.load(relaxed) == key) return;
  sample.fragments.store(fragments, relaxed);
  sample.sample.store(key, relaxed);
}

bool SequenceGuard::has_fragment(std::uint32_t writer, std::int64_t number, std::uint32_t fragment) const {
  const std::uint64_t key = sample_key(writer, number);
  const Sent& sample = (*sent_)[(key >> 8U) % samples];
  return sample.sample.load(relaxed) != key || fragment <= sample.fragments.load(relaxed);
}

}  // namespace invar::dds

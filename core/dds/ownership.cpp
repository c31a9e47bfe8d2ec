#include "core/dds/ownership.hpp"

#include <algorithm>

namespace invar::dds {

Ownership::Ownership(Duration lease, std::size_t most, IsGone is_gone)
    : lease_{lease}, most_{most}, is_gone_{std::move(is_gone)} {}

const Claimant* Ownership::claim(const Instance& instance, const Claimant& who, Instant now) {
  const auto found = owners_.find(instance);
  if (found == owners_.end()) {
    if (owners_.size() >= most_) forget_one();
    owners_.emplace(instance, Owner{who, now});
    return nullptr;
  }
  Owner& owner = found->second;
  const bool same_master = owner.who.participant == who.participant;
  const bool has_yielded = who.strength == owner.who.strength && lease_.ns > 0 && now - owner.last >= lease_;
  if (same_master || who.strength > owner.who.strength || has_yielded || is_gone_(owner.who)) {
    owner = {who, now};
    return nullptr;
  }
  return &owner.who;
}

void Ownership::release(const std::string& writer) {
  std::erase_if(owners_, [&writer](const auto& entry) { return entry.second.who.writer == writer; });
}

Instant Ownership::last(const Instance& instance) const {
  const auto found = owners_.find(instance);
  return found == owners_.end() ? Instant{INT64_MIN} : found->second.last;
}

void Ownership::forget_one() {
  owners_.erase(std::min_element(owners_.begin(), owners_.end(),
                                 [](const auto& a, const auto& b) { return a.second.last < b.second.last; }));
}

}  // namespace invar::dds

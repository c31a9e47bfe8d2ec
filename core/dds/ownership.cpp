#include "core/dds/ownership.hpp"

namespace invar::dds {

const Claimant* Ownership::claim(const Claimant& who, Instant now) {
  if (owner_) {
    const bool same_master = owner_->who.participant == who.participant;
    const bool has_yielded =
        who.strength == owner_->who.strength && lease_.ns > 0 && now - owner_->last >= lease_;
    if (!same_master && who.strength <= owner_->who.strength && !has_yielded && !is_gone_(owner_->who))
      return &owner_->who;
  }
  owner_ = {who, now};
  return nullptr;
}

bool Ownership::release(const std::string& writer) {
  if (!owner_ || owner_->who.writer != writer) return false;
  owner_.reset();
  return true;
}

}  // namespace invar::dds

// Ownership: who commands one controlled thing, an axis or a device.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "core/base/time.hpp"

namespace invar::dds {

struct Claimant {
  std::string writer;       // GUID as text
  std::string participant;  // the part of it that writers of one process have in common
  std::int64_t strength = 0;
  Instant found{INT64_MIN / 2};  // when discovery found the writer, monotonic
};

/// The rules of DDS, made definite, and for the thing that is commanded, whatever key a sample carries:
/// - the greatest strength commands; a weaker one only when every stronger one has ended;
/// - of equals the one who came first, until it ends or has commanded nothing for the lease (DDS leaves equals open);
/// - a writer that ended is out at once: `release` when it took its leave, otherwise `is_gone` is asked where it would win;
/// - writers of one process are one master.
class Ownership {
 public:
  using IsGone = std::function<bool(const Claimant& owner)>;

  /// `lease` zero: an equal never has to yield.
  Ownership(Duration lease, IsGone is_gone) : lease_{lease}, is_gone_{std::move(is_gone)} {}

  /// Null: `who` commands now. Otherwise who keeps it; valid until the next call.
  const Claimant* claim(const Claimant& who, Instant now);
  /// Whether it was the owner.
  bool release(const std::string& writer);
  /// When the owner commanded last; Instant{INT64_MIN}: there is none.
  [[nodiscard]] Instant last() const { return owner_ ? owner_->last : Instant{INT64_MIN}; }

 private:
  struct Owner {
    Claimant who;
    Instant last;
  };

  Duration lease_;
  IsGone is_gone_;
  std::optional<Owner> owner_;
};

}  // namespace invar::dds

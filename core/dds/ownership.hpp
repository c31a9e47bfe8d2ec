// Ownership: who commands each instance of a topic with exclusive ownership.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "core/base/time.hpp"

namespace invar::dds {

struct Claimant {
  std::string writer;       // GUID as text
  std::string participant;  // the part of it that writers of one process have in common
  std::int64_t strength = 0;
};

/// The rules of DDS, made definite:
/// - the greatest strength commands; a weaker one only when every stronger one has ended;
/// - of equals the one who came first, until it ends or has commanded nothing for the lease (DDS leaves equals open);
/// - whoever ended is out at once: `release` when it took its leave, otherwise `is_gone` is asked where it stands in the way;
/// - writers of one process are one master.
class Ownership {
 public:
  using Instance = std::array<std::uint8_t, 16>;
  using IsGone = std::function<bool(const Claimant& owner)>;

  /// `lease` zero: an equal never has to yield. `most`: instances remembered; beyond it the one longest idle is forgotten.
  Ownership(Duration lease, std::size_t most, IsGone is_gone);

  /// Null: `who` commands the instance now. Otherwise who keeps it; valid until the next call.
  const Claimant* claim(const Instance& instance, const Claimant& who, Instant now);
  void release(const std::string& writer);
  /// When the owner of an instance commanded last; Instant{INT64_MIN}: it has none.
  [[nodiscard]] Instant last(const Instance& instance) const;

 private:
  struct Owner {
    Claimant who;
    Instant last;
  };
  void forget_one();

  Duration lease_;
  std::size_t most_;
  IsGone is_gone_;
  std::map<Instance, Owner> owners_;
};

}  // namespace invar::dds

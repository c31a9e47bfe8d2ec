// CommandGate: selects the samples of a topic that are taken, and tells every refused sender.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <mutex>
#include <string>

#include "core/base/time.hpp"
#include "core/dds/discovery.hpp"
#include "core/dds/ownership.hpp"
#include "core/dds/profile.hpp"

namespace invar::dds {

/// Between a reader and the receiver of its samples. Beside ownership it holds the lifespan, by the stamps of the middleware:
/// Fast DDS would drop old samples in silence, and all commands of a PC whose clock is behind. A sender whose clock is
/// ahead is obeyed, and so is one that was found within the lifespan, however old its sample seems: none is older than that.
/// Late samples of both are known by the one that seemed youngest. Where somebody sets the clock of a sender back, its samples are
/// refused for `clock_patience` and then taken, told so. Any thread.
class CommandGate {
 public:
  /// `refused` is called for every sample that is not taken. The discovery must outlive it.
  CommandGate(std::string topic, const Profile& profile, Discovery& discovery,
              std::function<void()> refused = {}, Duration clock_patience = Duration::seconds(10.0));

  /// Is told of each sample that is obeyed, before it is handed over, and when its sender has gone.
  struct Follower {
    std::function<void(const Claimant& who)> obeyed;
    std::function<void()> gone;
  };
  /// Set-up only, of a topic with exclusive ownership.
  void follow(Follower follower) { follower_ = std::move(follower); }

  /// Whether ownership or lifespan bound this topic, so that `passes` is to be asked of every sample.
  [[nodiscard]] bool is_asked_of_all() const { return exclusive_ || lifespan_.ns > 0; }
  enum class Sender { of_cell, other };  // the former's clock is known
  /// `writer`: GUID as text; `sent` by the clock of this process's stamps, or of an unknown sender by its own.
  bool passes(const std::string& writer, Instant sent, Sender sender = Sender::other);
  /// Counts a sample that is not taken and tells why, now and then.
  void refuse(const std::string& writer, const std::string& why);
  /// The writer took its leave, or its lease ran out.
  void gone(const std::string& writer);
  [[nodiscard]] std::uint64_t refused() const { return refusals_; }

 private:
  struct Least {
    Duration age;
    Instant at;
  };
  using Leasts = std::map<std::string, Least>;  // by writer
  struct Late {
    Duration first, youngest;  // ages, which stay within the lifespan of one another
    Instant since;
  };

  bool is_too_late(const Claimant& who, Duration age, Sender sender);
  [[nodiscard]] std::string too_far(Duration age) const;
  Leasts::iterator take_clock(const Claimant& who, Duration age, Instant now);
  bool was_set(const Claimant& who, Duration age, Instant now);
  void tell(const Claimant& who, const std::string& why);
  void raise(const std::string& text);

  std::string topic_;
  bool exclusive_;
  Duration lifespan_, clock_patience_;
  Discovery& discovery_;
  std::function<void()> refused_;
  Follower follower_;
  std::atomic<std::uint64_t> refusals_{0};
  std::mutex mutex_;
  Ownership ownership_;
  struct Told {
    Instant at{INT64_MIN / 2};
    std::uint64_t since = 0;  // refused without a word since then
  };
  std::map<std::string, Told> told_;  // by writer
  Leasts least_;                      // of writers whose clock is further apart than the lifespan
  std::map<std::string, Late> late_;  // by writer, of those that are refused
};

}  // namespace invar::dds

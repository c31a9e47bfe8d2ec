// CommandGate: which samples of a topic with exclusive ownership are obeyed; whoever is not is told so.
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

/// Between a reader and what takes its samples. Beside ownership it holds the lifespan, by the stamps of the middleware:
/// Fast DDS would drop what is too old in silence, and all commands of a PC whose clock is behind. Any thread.
class CommandGate {
 public:
  /// `refused` is called for every sample that is not obeyed. The discovery must outlive it.
  CommandGate(std::string topic, const Profile& profile, Discovery& discovery,
              std::function<void()> refused = {});

  /// `writer`: GUID as text; `sent` by its clock (UTC).
  bool passes(const Ownership::Instance& instance, const std::string& writer, Instant sent);
  /// The writer took its leave, or its lease ran out.
  void gone(const std::string& writer);
  [[nodiscard]] std::uint64_t refused() const { return refusals_; }

 private:
  void tell(const Claimant& who, const std::string& why);

  std::string topic_;
  Duration lifespan_;
  Discovery& discovery_;
  std::function<void()> refused_;
  std::atomic<std::uint64_t> refusals_{0};
  std::mutex mutex_;
  Ownership ownership_;
  struct Told {
    Instant at{INT64_MIN / 2};
    std::uint64_t since = 0;  // refused without a word since then
  };
  std::map<std::string, Told> told_;
};

}  // namespace invar::dds

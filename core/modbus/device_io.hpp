// The I/O side of a device: what is due, the requests, and what their answers mean. Used by one thread.
#pragma once

#include <functional>
#include <vector>

#include "core/modbus/backoff.hpp"
#include "core/modbus/device.hpp"
#include "core/modbus/grouping.hpp"
#include "core/modbus/link.hpp"

namespace invar::modbus {

/// Gives the time of an answer.
using Clock = std::function<Instant()>;

class DeviceIo {
 public:
  DeviceIo(Device& device, Backoff backoff, Duration answer_timeout);

  /// Takes in what the owner asked for since the last call; drops writes that waited too long.
  void take_in(Instant now);
  [[nodiscard]] bool may_try(Instant now) const { return backoff_.may_try(now); }
  [[nodiscard]] bool has_something_to_do(Instant now) const;
  /// When to look again if nobody asks for anything.
  [[nodiscard]] Instant next_due(Instant now) const;

  /// The outcome: no fault, only exception answers, or the device cannot be reached (the link may be closed).
  enum class Done { all, refused, failed };
  enum class Reads { none, if_due, now };
  /// Heartbeat if due, queued writes, then the reads. Precondition: the link was open once.
  Done exchange(Link& link, const Clock& clock, Reads reads);
  /// The link could not be opened.
  void offline(const Failure& why);
  [[nodiscard]] const Device& device() const { return device_; }

 private:
  Outcome counted(Outcome outcome, Instant now);
  void count(const Failure& failure);
  Outcome put(Link& link, const Register& reg, std::span<const std::uint16_t> words, const Clock& clock);
  Outcome beat(Link& link, const Clock& clock);
  Outcome write_next(Link& link, const Clock& clock);
  Outcome read_pending(Link& link, const Clock& clock, bool& refused);
  void take_answer(std::size_t request, std::span<const std::uint16_t> words, Instant now);
  bool ask_again(std::size_t request, int exception, Instant now);
  void part_refused();
  void plan(std::vector<ReadRequest> requests);
  void learn_delay(const Link& link);
  void judge_read_backs(Instant now);
  [[nodiscard]] bool beats(Instant now) const;

  Device& device_;
  Backoff backoff_;
  Duration answer_timeout_;
  /// A register in an answer.
  struct Field {
    Encoding how;
    std::uint16_t at = 0;  // its first word, counted from the request's address
    std::size_t reg = 0;
    Range shown;  // what the device may show: the register's range and its rounding
  };
  std::vector<ReadRequest> whole_plan_;  // before any request was parted
  std::vector<ReadRequest> plan_;
  std::vector<std::vector<Field>> fields_;    // by request
  std::vector<bool> pending_;                 // by request: to be read in this poll
  std::vector<std::size_t> refused_;          // requests of this poll that the device calls illegal
  Instant busy_until_{INT64_MIN};             // it said so: nothing is asked again before
  unsigned busy_answers_ = 0;                 // in this poll
  bool multiple_ = false;                     // it has no function for one value
  std::uint64_t late_ = 0;                    // answers that this device has learnt from
  std::vector<std::uint16_t> words_;          // of one answer
  std::uint64_t round_ = 0;                   // of reads
  std::vector<std::uint64_t> read_in_round_;  // by register: the last round that brought it
  std::vector<std::size_t> queue_;            // registers with a queued write, oldest first
  std::vector<std::size_t> unresolved_;       // registers whose write awaits its read-back
  Instant next_poll_{INT64_MIN};
  Instant next_beat_{INT64_MIN};
  Instant beat_until_{INT64_MIN};  // the owner's refresh holds until then
  double beat_count_ = 0;
};

}  // namespace invar::modbus

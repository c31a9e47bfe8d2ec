// One TCP connection to a Modbus device or gateway: bounded in time, and every failure by its cause.
//
// The frames are built and checked by frame.hpp. An answer that comes after its time-out is told by its transaction and
// dropped, so the connection outlives a late answer. It is closed after an answer that is cut or malformed, and
// after two time-outs in a row without a byte (a cable that was pulled). A device that closed the connection while
// nothing was asked gets a new one before the next request: no request is lost, no write is repeated.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/time.hpp"
#include "core/modbus/frame.hpp"
#include "core/modbus/map.hpp"

namespace invar::modbus {

/// Why a request has no answer.
enum class Cause {
  refused,       // nobody listens there
  unreachable,   // no route, no such host, or no answer to the connection request in time
  timeout,       // connected, but no byte of an answer in time
  reset,         // the connection ended before the answer
  short_answer,  // the answer began and did not end
  malformed,     // the answer is not one to this request
  exception,     // the device answered that it will not; the link is sound
};
[[nodiscard]] std::string_view name_of(Cause cause);

struct Failure {
  Cause cause = Cause::timeout;
  int exception = 0;       // Modbus exception code 1 to 255, where the cause is one
  Flaw flaw = Flaw::none;  // which part of the answer is wrong, where it is malformed
};
/// Nothing, or why it failed.
using Outcome = std::optional<Failure>;

/// Events of the connection since the start, by cause.
struct LinkCounters {
  std::uint64_t connects = 0;
  std::uint64_t refused = 0;
  std::uint64_t unreachable = 0;
  std::uint64_t losses = 0;    // connections closed because a request failed
  std::uint64_t closings = 0;  // by the device, while nothing was asked
  std::uint64_t late = 0;      // answers that came after their time-out, or twice: dropped
  std::uint64_t stray = 0;     // times that bytes came which answer nothing: dropped
  bool one_answer = false;     // the device closes after each answer: a connection is made for each request
  Duration latest;             // longest that an answer took which came after its time-out
};

/// Used by one thread at a time.
class Link {
 public:
  Link(std::string host, std::uint16_t port);
  ~Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  [[nodiscard]] bool is_open() const { return socket_ >= 0; }
  /// Connects within `timeout` (per address of the host). Precondition: not open.
  Outcome open(Duration timeout);
  void close();

  /// Unit of the next requests, and the time that an answer may take to begin and may pause. A whole answer takes at most that
  /// and 20 ms a byte more (a serial line of 600 baud behind a gateway takes 18.3).
  void address(std::uint8_t unit, Duration answer_timeout);
  /// Reads `words.size()` registers, or bits as 0/1; at most 125 or 2000.
  Outcome read(Kind kind, std::uint16_t address, std::span<std::uint16_t> words);
  /// Writes one coil (0/1) or one or two holding registers, by functions 5, 6 and 16; `multiple`: by 15 and 16 only.
  /// A link that was open once and is closed opens itself again before a request.
  Outcome write(Kind kind, std::uint16_t address, std::span<const std::uint16_t> words,
                bool multiple = false);
  [[nodiscard]] const LinkCounters& counters() const { return counters_; }

 private:
  static constexpr unsigned remembered = 16;  // requests whose answers may still come
  Outcome ask(Question question, std::span<std::uint16_t> words);
  Outcome ready();
  Outcome exchange(const Question& question, std::span<std::uint16_t> words);
  Outcome send(const Question& question, Instant until);
  /// Meaning of the bytes so far: nothing yet, or the outcome.
  std::optional<Outcome> look(const Question& question, std::span<std::uint16_t> words);
  Outcome lost(Cause cause, Flaw flaw = Flaw::none);
  bool drop_strays();
  [[nodiscard]] bool was_asked(std::uint16_t transaction) const;
  void note_late(std::uint16_t transaction);
  void note_closing();

  std::string host_;
  std::string service_;
  int socket_ = -1;
  Duration connect_timeout_;
  std::uint8_t unit_ = 1;
  Duration answer_timeout_;
  std::uint16_t transaction_ = 0;
  std::vector<std::uint8_t> received_;
  std::array<Instant, remembered> asked_at_{};  // by transaction
  std::uint64_t asked_ = 0;                     // on this connection
  std::uint64_t answers_ = 0;                   // on this connection
  unsigned silences_ = 0;                       // time-outs since the last byte
  unsigned single_answers_ = 0;                 // connections in a row that were closed after one answer
  Instant last_answer_;
  LinkCounters counters_;
};

}  // namespace invar::modbus

// One TCP connection to a Modbus device or gateway: bounded in time, and every failure by its cause.
//
// libmodbus builds and checks the frames; its own recovery is off, since its resend loop can block for ever
// (libmodbus issues 734, 735). After any failure but an exception answer the caller closes the link: an
// answer that comes late would otherwise be taken for that of the next request.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/base/time.hpp"
#include "core/modbus/map.hpp"

struct _modbus;

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
  int exception = 0;  // Modbus exception code 1 to 11, where the cause is one
};
/// Nothing, or why it failed.
using Outcome = std::optional<Failure>;

/// Used by one thread at a time.
class Link {
 public:
  Link(std::string host, std::uint16_t port);
  ~Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  [[nodiscard]] bool is_open() const { return context_ != nullptr; }
  /// Connects within `timeout` (per address of the host). Precondition: not open.
  Outcome open(Duration timeout);
  void close();

  /// Whom the next requests are for and how long the whole answer may take.
  void address(std::uint8_t unit, Duration answer_timeout);
  /// Reads `words.size()` registers, or bits as 0/1. Precondition: open; at most 125 or 2000.
  Outcome read(Kind kind, std::uint16_t address, std::span<std::uint16_t> words);
  /// Writes one coil (0/1) or one or two holding registers, by functions 5, 6 and 16.
  Outcome write(Kind kind, std::uint16_t address, std::span<const std::uint16_t> words);

 private:
  struct Free {
    void operator()(_modbus* context) const;
  };
  Outcome outcome(int result, int wanted, int error, std::size_t answer_bytes);
  [[nodiscard]] std::uint64_t bytes_received() const;

  std::string host_;
  std::string service_;
  std::unique_ptr<_modbus, Free> context_;
  std::uint64_t bytes_expected_ = 0;  // of all answers so far on this connection
};

}  // namespace invar::modbus

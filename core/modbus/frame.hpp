// Modbus TCP frames as a client sees them: requests as bytes, and whether bytes are the answer to one.
//
// Every field of an answer is checked: transaction, protocol, length, unit, function, byte count, and the echo of a write.
// Sources: Modbus Messaging on TCP/IP V1.0b, 3.1.3; application protocol V1.1b3, 6. Pure functions.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace invar::modbus {

inline constexpr std::size_t largest_frame = 260;
using Frame = std::array<std::uint8_t, largest_frame>;

/// The functions that the client uses.
enum class Function : std::uint8_t {
  read_coils = 1,
  read_discrete = 2,
  read_holding = 3,
  read_input = 4,
  write_coil = 5,
  write_register = 6,
  write_coils = 15,
  write_registers = 16,
};

/// One request.
struct Question {
  std::uint16_t transaction = 0;
  std::uint8_t unit = 1;
  Function function = Function::read_holding;
  std::uint16_t address = 0;
  std::uint16_t count = 1;                // registers or bits
  std::array<std::uint16_t, 2> values{};  // to write; a coil 0 or 1

  [[nodiscard]] bool is_write() const { return function >= Function::write_coil; }
  [[nodiscard]] bool is_of_bits() const {
    return function <= Function::read_discrete || function == Function::write_coil ||
           function == Function::write_coils;
  }
};

/// The request as bytes in `frame`; gives their number.
std::size_t write_frame(const Question& question, Frame& frame);
/// How long a sound answer that is no exception is.
[[nodiscard]] std::size_t answer_length(const Question& question);

/// Which part of an answer is wrong.
enum class Flaw { none, protocol, length, transaction, unit, function, byte_count, echo, exception_code };
[[nodiscard]] std::string_view name_of(Flaw flaw);

/// The first frame in bytes that came.
struct Head {
  std::size_t length = 0;  // of the whole frame; 0 while it is incomplete
  std::uint16_t transaction = 0;
  Flaw flaw = Flaw::none;  // this can be no frame, and none behind it can be found
};
[[nodiscard]] Head first_frame(std::span<const std::uint8_t> bytes);

struct Judgement {
  Flaw flaw = Flaw::none;
  int exception = 0;  // its code, where the answer is one
};
/// Judges a whole frame as the answer to `question`; fills `words` (registers, or bits as 0 and 1) where it is a sound answer to
/// a read. Precondition: `words` holds `question.count` for a read.
[[nodiscard]] Judgement judge(const Question& question, std::span<const std::uint8_t> frame,
                              std::span<std::uint16_t> words);

}  // namespace invar::modbus

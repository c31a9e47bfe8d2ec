#include "core/modbus/frame.hpp"

#include "core/base/contract.hpp"

namespace invar::modbus {

namespace {

constexpr std::size_t header = 7;  // transaction 2, protocol 2, length 2, unit 1
constexpr std::uint8_t exception_bit = 0x80;
constexpr std::uint16_t coil_on = 0xFF00;

std::uint16_t word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>((unsigned{bytes[at]} << 8) | bytes[at + 1]);
}

/// Appends to a frame.
class Writer {
 public:
  explicit Writer(Frame& frame) : frame_{frame} {}
  void byte(unsigned value) { frame_[size_++] = static_cast<std::uint8_t>(value); }
  void word(unsigned value) {
    byte(value >> 8);
    byte(value & 0xFFU);
  }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  Frame& frame_;
  std::size_t size_ = 0;
};

std::uint16_t single_value(const Question& question) {
  if (question.function == Function::write_register) return question.values[0];
  return question.values[0] != 0 ? coil_on : 0;
}

bool is_single(const Question& question) {
  return question.function == Function::write_coil || question.function == Function::write_register;
}

std::size_t data_bytes(const Question& question) {
  return question.is_of_bits() ? (question.count + 7U) / 8U : 2U * question.count;
}

void fill(const Question& question, std::span<const std::uint8_t> data, std::span<std::uint16_t> words) {
  for (std::size_t i = 0; i < question.count; ++i)
    words[i] = question.is_of_bits()
                   ? static_cast<std::uint16_t>((static_cast<unsigned>(data[i / 8]) >> (i % 8)) & 1U)
                   : word_at(data, 2 * i);
}

}  // namespace

std::string_view name_of(Flaw flaw) {
  constexpr std::array<std::string_view, 9> names{"none",     "protocol",   "length", "transaction",   "unit",
                                                  "function", "byte count", "echo",   "exception code"};
  return names[static_cast<std::size_t>(flaw)];
}

std::size_t write_frame(const Question& question, Frame& frame) {
  Writer out{frame};
  const bool multiple = question.is_write() && !is_single(question);
  const std::size_t bytes = multiple ? data_bytes(question) : 0;
  out.word(question.transaction);
  out.word(0);
  out.word(static_cast<unsigned>(6 + (multiple ? 1 + bytes : 0)));
  out.byte(question.unit);
  out.byte(static_cast<unsigned>(question.function));
  out.word(question.address);
  out.word(is_single(question) ? single_value(question) : question.count);
  if (!multiple) return out.size();
  out.byte(static_cast<unsigned>(bytes));
  if (question.is_of_bits()) {
    out.byte(question.values[0] != 0 ? 1 : 0);
  } else {
    for (std::size_t i = 0; i < question.count; ++i) out.word(question.values[i]);
  }
  return out.size();
}

std::size_t answer_length(const Question& question) {
  return question.is_write() ? header + 5 : header + 2 + data_bytes(question);
}

Head first_frame(std::span<const std::uint8_t> bytes) {
  Head head;
  if (bytes.size() >= 4 && word_at(bytes, 2) != 0) head.flaw = Flaw::protocol;
  if (bytes.size() < 6 || head.flaw != Flaw::none) return head;
  head.transaction = word_at(bytes, 0);
  const std::size_t length = word_at(bytes, 4);  // unit, function and one byte at least
  if (length < 3 || length > largest_frame - 6)
    head.flaw = Flaw::length;
  else if (bytes.size() >= 6 + length)
    head.length = 6 + length;
  return head;
}

Judgement judge(const Question& question, std::span<const std::uint8_t> frame,
                std::span<std::uint16_t> words) {
  const Head head = first_frame(frame);
  if (head.flaw != Flaw::none) return {head.flaw};
  if (head.length == 0 || head.length != frame.size()) return {Flaw::length};
  if (head.transaction != question.transaction) return {Flaw::transaction};
  if (frame[6] != question.unit) return {Flaw::unit};
  const auto function = static_cast<std::uint8_t>(question.function);
  if (frame[7] == (function | exception_bit)) {
    if (frame.size() != header + 2) return {Flaw::length};
    return frame[8] == 0 ? Judgement{Flaw::exception_code} : Judgement{Flaw::none, frame[8]};
  }
  if (frame[7] != function) return {Flaw::function};
  if (question.is_write()) {
    if (frame.size() != header + 5) return {Flaw::length};
    const std::uint16_t echoed = is_single(question) ? single_value(question) : question.count;
    const bool same = word_at(frame, 8) == question.address && word_at(frame, 10) == echoed;
    return {same ? Flaw::none : Flaw::echo};
  }
  const std::size_t bytes = data_bytes(question);
  if (frame[8] != bytes) return {Flaw::byte_count};
  if (frame.size() != header + 2 + bytes) return {Flaw::length};
  INVAR_EXPECTS(words.size() >= question.count, words.size(), question.count);
  fill(question, frame.subspan(header + 2), words);
  return {};
}

}  // namespace invar::modbus

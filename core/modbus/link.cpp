#include "core/modbus/link.hpp"

#include <linux/tcp.h>
#include <modbus.h>
#include <netinet/in.h>
#include <sys/select.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "core/base/contract.hpp"

namespace invar::modbus {

namespace {

// Bytes of an answer on TCP: header 7, function 1, then what the function brings.
constexpr std::size_t write_answer_bytes = 12;
constexpr std::size_t exception_answer_bytes = 9;

std::uint32_t whole_seconds(Duration d) { return static_cast<std::uint32_t>(d.ns / 1'000'000'000); }
std::uint32_t microseconds(Duration d) { return static_cast<std::uint32_t>(d.ns % 1'000'000'000 / 1'000); }

}  // namespace

std::string_view name_of(Cause cause) {
  switch (cause) {
    case Cause::refused:
      return "refused";
    case Cause::unreachable:
      return "unreachable";
    case Cause::timeout:
      return "timeout";
    case Cause::reset:
      return "reset";
    case Cause::short_answer:
      return "short answer";
    case Cause::malformed:
      return "malformed answer";
    case Cause::exception:
      break;
  }
  return "exception";
}

void Link::Free::operator()(_modbus* context) const {
  modbus_close(context);
  modbus_free(context);
}

Link::Link(std::string host, std::uint16_t port) : host_{std::move(host)}, service_{std::to_string(port)} {}
Link::~Link() = default;

Outcome Link::open(Duration timeout) {
  INVAR_EXPECTS(!is_open());
  std::unique_ptr<_modbus, Free> context{modbus_new_tcp_pi(host_.c_str(), service_.c_str())};
  if (!context) return Failure{Cause::unreachable};
  modbus_set_error_recovery(context.get(), MODBUS_ERROR_RECOVERY_NONE);
  // While connecting the library takes the response timeout for the connection.
  modbus_set_response_timeout(context.get(), whole_seconds(timeout), std::max(1U, microseconds(timeout)));
  // Without a byte timeout the response timeout bounds the whole answer, however it trickles in.
  modbus_set_byte_timeout(context.get(), 0, 0);
  errno = 0;
  if (modbus_connect(context.get()) != 0)
    return Failure{errno == ECONNREFUSED ? Cause::refused : Cause::unreachable};
  // The library waits with select(), which writes beyond its set for larger numbers.
  if (modbus_get_socket(context.get()) >= FD_SETSIZE) return Failure{Cause::unreachable};
  context_ = std::move(context);
  bytes_expected_ = 0;
  return std::nullopt;
}

void Link::close() { context_.reset(); }

void Link::address(std::uint8_t unit, Duration answer_timeout) {
  INVAR_EXPECTS(is_open());
  modbus_set_slave(context_.get(), unit);
  modbus_set_response_timeout(context_.get(), whole_seconds(answer_timeout),
                              std::max(1U, microseconds(answer_timeout)));
}

Outcome Link::read(Kind kind, std::uint16_t address, std::span<std::uint16_t> words) {
  INVAR_EXPECTS(is_open());
  const int count = static_cast<int>(words.size());
  _modbus* context = context_.get();
  errno = 0;
  if (kind == Kind::holding || kind == Kind::input) {
    const int result = kind == Kind::holding
                           ? modbus_read_registers(context, address, count, words.data())
                           : modbus_read_input_registers(context, address, count, words.data());
    return outcome(result, count, errno, 9 + 2 * words.size());
  }
  std::array<std::uint8_t, MODBUS_MAX_READ_BITS> bits;
  INVAR_EXPECTS(words.size() <= bits.size(), words.size());
  const int result = kind == Kind::coil ? modbus_read_bits(context, address, count, bits.data())
                                        : modbus_read_input_bits(context, address, count, bits.data());
  const auto failed = outcome(result, count, errno, 9 + (words.size() + 7) / 8);
  if (!failed) std::copy_n(bits.begin(), words.size(), words.begin());
  return failed;
}

Outcome Link::write(Kind kind, std::uint16_t address, std::span<const std::uint16_t> words) {
  INVAR_EXPECTS(is_open());
  INVAR_EXPECTS(kind == Kind::coil || kind == Kind::holding);
  const int count = static_cast<int>(words.size());
  errno = 0;
  int result = -1;
  if (kind == Kind::coil)
    result = modbus_write_bit(context_.get(), address, words[0] != 0 ? 1 : 0);
  else if (count == 1)
    result = modbus_write_register(context_.get(), address, words[0]);
  else
    result = modbus_write_registers(context_.get(), address, count, words.data());
  return outcome(result, count, errno, write_answer_bytes);
}

Outcome Link::outcome(int result, int wanted, int error, std::size_t answer_bytes) {
  if (result == wanted) {
    bytes_expected_ += answer_bytes;
    return std::nullopt;
  }
  if (error > MODBUS_ENOBASE && error <= EMBXGTAR) {
    bytes_expected_ += exception_answer_bytes;
    return Failure{Cause::exception, error - MODBUS_ENOBASE};
  }
  if (error >= EMBBADCRC || result >= 0) return Failure{Cause::malformed};
  const bool silent = error == ETIMEDOUT;
  const std::uint64_t end_of_connection = silent ? 0 : 1;  // the kernel counts the closing FIN as a byte
  if (bytes_received() > bytes_expected_ + end_of_connection) return Failure{Cause::short_answer};
  return Failure{silent ? Cause::timeout : Cause::reset};
}

/// The library does not tell a silent device from one that stops within its answer; the kernel's count does.
std::uint64_t Link::bytes_received() const {
  tcp_info info{};
  socklen_t size = sizeof info;
  if (getsockopt(modbus_get_socket(context_.get()), IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return 0;
  return info.tcpi_bytes_received;
}

}  // namespace invar::modbus

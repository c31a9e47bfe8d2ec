#include "core/modbus/image.hpp"

#include <modbus.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <system_error>

#include "core/base/contract.hpp"
#include "core/modbus/grouping.hpp"

namespace invar::modbus {

namespace {

constexpr std::size_t header = 7;  // transaction 2, protocol 2, length 2, unit 1

std::size_t number(Kind kind) { return static_cast<std::size_t>(kind); }

unsigned word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  return (unsigned{bytes[at]} << 8) | bytes[at + 1];
}

/// The range as the wire can show it: a bound may be rounded outwards by the type.
bool allowed(const Register& reg, double value) {
  const double slack = 1e-6 * std::max(std::abs(reg.range.lower), std::abs(reg.range.upper));
  return value >= reg.range.lower - slack && value <= reg.range.upper + slack;
}

}  // namespace

void Image::FreeContext::operator()(_modbus* context) const {
  modbus_close(context);
  modbus_free(context);
}
void Image::FreeMapping::operator()(_modbus_mapping_t* mapping) const { modbus_mapping_free(mapping); }

Image::Image(const RegisterMap& map) : map_{map} {
  for (std::size_t i = 0; i < map.registers.size(); ++i) {
    const Register& reg = map.registers[i];
    Span& span = spans_[number(reg.kind)];
    const unsigned end = reg.address + reg.width();
    span = span.end == 0 ? Span{reg.address, end}
                         : Span{std::min<unsigned>(span.begin, reg.address), std::max(span.end, end)};
    for (unsigned address = reg.address; address < end; ++address)
      named_[number(reg.kind)].emplace(address, i);
  }
  const auto size = [&](Kind kind) { return spans_[number(kind)].end - spans_[number(kind)].begin; };
  mapping_.reset(modbus_mapping_new_start_address(spans_[number(Kind::coil)].begin, size(Kind::coil),
                                                  spans_[number(Kind::discrete)].begin, size(Kind::discrete),
                                                  spans_[number(Kind::holding)].begin, size(Kind::holding),
                                                  spans_[number(Kind::input)].begin, size(Kind::input)));
  context_.reset(modbus_new_tcp("127.0.0.1", MODBUS_TCP_DEFAULT_PORT));  // never connected: frames only
  std::array<int, 2> ends{};
  if (!mapping_ || !context_ ||
      socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends.data()) != 0)
    throw std::system_error{errno, std::generic_category(), "register image"};
  modbus_set_socket(context_.get(), ends[0]);
  modbus_set_response_timeout(context_.get(), 0, 1);  // the library sleeps it before some exception answers
  reply_end_ = ends[1];
  for (std::size_t i = 0; i < map.registers.size(); ++i) set(i, map.registers[i].initial);
}

Image::~Image() {
  if (reply_end_ >= 0) ::close(reply_end_);
}

double Image::value(std::size_t index) const {
  const Register& reg = map_.registers[index];
  const unsigned at = reg.address - spans_[number(reg.kind)].begin;
  switch (reg.kind) {
    case Kind::coil:
      return mapping_->tab_bits[at] != 0 ? 1.0 : 0.0;
    case Kind::discrete:
      return mapping_->tab_input_bits[at] != 0 ? 1.0 : 0.0;
    case Kind::input:
      return decode(reg, {mapping_->tab_input_registers + at, reg.width()});
    case Kind::holding:
      break;
  }
  return decode(reg, {mapping_->tab_registers + at, reg.width()});
}

void Image::set(std::size_t index, double value) {
  const Register& reg = map_.registers[index];
  if (reg.type != Type::float32 && std::isnan(value)) return;  // no count stands for it: it shows what it did
  const unsigned at = reg.address - spans_[number(reg.kind)].begin;
  const Words words = encode(reg, value);
  if (reg.is_bit()) {
    auto* bits = reg.kind == Kind::coil ? mapping_->tab_bits : mapping_->tab_input_bits;
    bits[at] = words.word[0] != 0 ? 1 : 0;
    return;
  }
  auto* registers = reg.kind == Kind::input ? mapping_->tab_input_registers : mapping_->tab_registers;
  if (reg.bit) {
    const unsigned others = registers[at] & ~(1U << *reg.bit);
    registers[at] = static_cast<std::uint16_t>(others | words.word[0]);
    return;
  }
  std::copy_n(words.word.begin(), reg.width(), registers + at);
}

Request Image::parse(std::span<const std::uint8_t> request) {
  if (request.size() < header + 5) return {};
  const unsigned address = word_at(request, header + 1);
  const unsigned count = word_at(request, header + 3);
  switch (request[header]) {
    case MODBUS_FC_READ_COILS:
      return {Kind::coil, false, address, count};
    case MODBUS_FC_READ_DISCRETE_INPUTS:
      return {Kind::discrete, false, address, count};
    case MODBUS_FC_READ_HOLDING_REGISTERS:
      return {Kind::holding, false, address, count};
    case MODBUS_FC_READ_INPUT_REGISTERS:
      return {Kind::input, false, address, count};
    case MODBUS_FC_WRITE_SINGLE_COIL:
      return {Kind::coil, true, address, 1};
    case MODBUS_FC_WRITE_SINGLE_REGISTER:
      return {Kind::holding, true, address, 1};
    case MODBUS_FC_WRITE_MULTIPLE_COILS:
      return {Kind::coil, true, address, count};
    case MODBUS_FC_WRITE_MULTIPLE_REGISTERS:
      return {Kind::holding, true, address, count};
    default:
      return {};
  }
}

bool Image::touches(const Request& request, std::size_t index) const {
  const Register& reg = map_.registers[index];
  return reg.kind == request.kind && reg.address < request.address + request.count &&
         request.address < reg.address + reg.width();
}

const Register* Image::named(Kind kind, unsigned address) const {
  const auto& names = named_[number(kind)];
  const auto found = names.find(address);
  return found == names.end() ? nullptr : &map_.registers[found->second];
}

std::uint8_t Image::refusal(const Request& wanted, std::span<const std::uint8_t> request) const {
  const std::uint8_t function = request.size() > header ? request[header] : 0;
  const bool ours = (function >= 1 && function <= 6) || function == MODBUS_FC_WRITE_MULTIPLE_COILS ||
                    function == MODBUS_FC_WRITE_MULTIPLE_REGISTERS;
  if (!ours) return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
  const bool bits = wanted.kind == Kind::coil || wanted.kind == Kind::discrete;
  const unsigned limit = wanted.is_write ? (bits ? MODBUS_MAX_WRITE_BITS : MODBUS_MAX_WRITE_REGISTERS)
                                         : (bits ? map_.max_bits : map_.max_registers);
  if (wanted.count == 0 || wanted.count > limit) return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
  if (wanted.is_write) return refusal_of_write(wanted, request);
  const Span span = spans_[number(wanted.kind)];
  if (wanted.address < span.begin || wanted.address + wanted.count > span.end)
    return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
  if (map_.gaps_readable) return 0;
  for (unsigned i = 0; i < wanted.count; ++i) {
    const Register* reg = named(wanted.kind, wanted.address + i);
    if (reg == nullptr || !reg->readable) return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
  }
  return 0;
}

std::uint8_t Image::refusal_of_write(const Request& wanted, std::span<const std::uint8_t> request) const {
  const bool multiple = request[header] >= MODBUS_FC_WRITE_MULTIPLE_COILS;
  const std::size_t data = header + (multiple ? 6 : 3);
  const std::size_t bytes = !multiple                   ? 2
                            : wanted.kind == Kind::coil ? (wanted.count + 7) / 8
                                                        : 2 * wanted.count;
  // libmodbus believes the count and would read beyond a frame that is too short for it.
  if (request.size() != data + bytes || (multiple && request[data - 1] != bytes))
    return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
  for (unsigned address = wanted.address; address < wanted.address + wanted.count; ++address) {
    const Register* reg = named(wanted.kind, address);
    if (reg == nullptr || !reg->writable || reg->address < wanted.address ||
        reg->address + reg->width() > wanted.address + wanted.count)
      return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    if (wanted.kind == Kind::coil || address != reg->address) continue;
    std::array<std::uint16_t, 2> words{};
    for (unsigned i = 0; i < reg->width(); ++i)
      words[i] = static_cast<std::uint16_t>(word_at(request, data + 2 * (address - wanted.address + i)));
    if (!allowed(*reg, decode(*reg, words))) return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
  }
  return 0;
}

std::size_t Image::answer(std::span<const std::uint8_t> request, Reply& reply,
                          std::vector<std::size_t>& written) {
  const Request wanted = parse(request);
  if (const std::uint8_t code = refusal(wanted, request); code != 0)
    return answer_exception(request, code, reply);
  const int sent =
      modbus_reply(context_.get(), request.data(), static_cast<int>(request.size()), mapping_.get());
  if (sent < 0) return 0;
  if (wanted.is_write)
    for (std::size_t i = 0; i < map_.registers.size(); ++i)
      if (touches(wanted, i)) written.push_back(i);
  return take_reply(reply);
}

std::size_t Image::answer_exception(std::span<const std::uint8_t> request, std::uint8_t code, Reply& reply) {
  if (request.size() <= header) return 0;
  if (modbus_reply_exception(context_.get(), request.data(), code) < 0) return 0;
  return take_reply(reply);
}

std::size_t Image::take_reply(Reply& reply) {
  const ssize_t size = ::recv(reply_end_, reply.data(), reply.size(), 0);
  return size > 0 ? static_cast<std::size_t>(size) : 0;
}

}  // namespace invar::modbus

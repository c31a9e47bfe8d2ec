// A simulated device's registers as they stand on the wire, and the answers to requests for them.
//
// Functions 1 to 6, 15 and 16; others are answered with exception 1, addresses outside the map with 2 (reads
// may cross gaps where the map says so), values outside a register's range with 3. A write of half a 32-bit
// value is refused with 2: it would tear.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "core/modbus/codec.hpp"
#include "core/modbus/map.hpp"

struct _modbus;
struct _modbus_mapping_t;

namespace invar::modbus {

/// A request, as far as our functions go.
struct Request {
  Kind kind = Kind::holding;
  bool is_write = false;
  unsigned address = 0;
  unsigned count = 0;
};

class Image {
 public:
  using Reply = std::array<std::uint8_t, 260>;

  explicit Image(const RegisterMap& map);
  ~Image();
  Image(const Image&) = delete;
  Image& operator=(const Image&) = delete;

  [[nodiscard]] double value(std::size_t reg) const;
  void set(std::size_t reg, double value);

  /// Carries out a complete request (header included) and gives the answer's length in `reply`; appends the
  /// registers that it wrote to `written`.
  std::size_t answer(std::span<const std::uint8_t> request, Reply& reply, std::vector<std::size_t>& written);
  /// An exception answer to the request, which is not carried out.
  std::size_t answer_exception(std::span<const std::uint8_t> request, std::uint8_t code, Reply& reply);
  /// The meaning of the request; count 0 when the function is none of ours or the frame is cut.
  [[nodiscard]] static Request parse(std::span<const std::uint8_t> request);
  [[nodiscard]] bool touches(const Request& request, std::size_t reg) const;

 private:
  struct FreeContext {
    void operator()(_modbus* context) const;
  };
  struct FreeMapping {
    void operator()(_modbus_mapping_t* mapping) const;
  };
  [[nodiscard]] std::uint8_t refusal(const Request& wanted, std::span<const std::uint8_t> request) const;
  [[nodiscard]] std::uint8_t refusal_of_write(const Request& wanted,
                                              std::span<const std::uint8_t> request) const;
  [[nodiscard]] const Register* named(Kind kind, unsigned address) const;
  std::size_t take_reply(Reply& reply);

  const RegisterMap& map_;
  struct Span {
    unsigned begin = 0, end = 0;
  };
  std::array<Span, 4> spans_{};  // by kind: all addresses from the first to the last named one
  // By kind: address to register; bits in one word stand under the first of them.
  std::array<std::unordered_map<unsigned, std::size_t>, 4> named_;
  std::unique_ptr<_modbus_mapping_t, FreeMapping> mapping_;
  std::unique_ptr<_modbus, FreeContext> context_;
  int reply_end_ = -1;  // libmodbus sends its answer to the other end of this socket pair
};

}  // namespace invar::modbus

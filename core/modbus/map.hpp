// The register map: what stands at which address of a device, in which type and unit, and what keeps it safe.
//
// One YAML file a kind of device (deployment/maps/heater.yaml is an example of every key). The client reads
// by it and the simulated device serves by it, so the two cannot disagree. Addresses are those on the wire,
// counted from 0: what a manual calls 40001 or 4x1 is `kind: holding, address: 0`.
//
// Outside the map every value is in SI (temperatures in degC); `scale`, `offset`, `unit` and `range` of the
// file are in the device's unit and converted once, here.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/range.hpp"
#include "core/base/time.hpp"

namespace invar::modbus {

/// Bounds of one request (Modbus application protocol V1.1b3, 6.1 and 6.3).
inline constexpr unsigned largest_word_read = 125;
inline constexpr unsigned largest_bit_read = 2000;

enum class Kind { coil, discrete, input, holding };
enum class Type { boolean, int16, uint16, int32, uint32, float32 };
/// Where the bytes A (highest) to D of a 32-bit value stand in its two registers: abcd is the
/// specification's.
enum class WordOrder { abcd, cdab, badc, dcba };

[[nodiscard]] std::string_view name_of(Kind kind);
[[nodiscard]] std::string_view name_of(Type type);

/// How a value stands on the wire. Small, since every answer is decoded by a list of them.
struct Encoding {
  Type type = Type::uint16;
  WordOrder word_order = WordOrder::abcd;
  std::optional<unsigned> bit;  // of a boolean inside a 16-bit register
  double scale = 1.0;           // SI = scale * raw + offset
  double offset = 0.0;

  /// Registers (or bits, for coils and discrete inputs) that it occupies: 1 or 2.
  [[nodiscard]] unsigned width() const {
    return type == Type::int32 || type == Type::uint32 || type == Type::float32 ? 2 : 1;
  }
};

/// One named value of a device.
struct Register : Encoding {
  std::string name;
  std::string description;
  std::uint16_t address = 0;
  Kind kind = Kind::holding;
  std::string unit;      // as written in the file, for people
  Range range;           // SI; a write outside it is refused, by the client and by the simulated device
  double initial = 0.0;  // SI; what a simulated device shows before anything is written
  bool readable = true;
  bool writable = false;
  bool is_actuator = false;              // moves, heats or presses something: must be made safe on comm loss
  std::optional<std::size_t> read_back;  // the register that shows what a write did, often this one itself
  Duration stale_after;

  [[nodiscard]] bool is_bit() const { return kind == Kind::coil || kind == Kind::discrete; }
};

/// The word that proves to the device that its master lives.
struct Heartbeat {
  std::size_t reg = 0;
  Duration period;                             // the client counts it up this often,
  Duration refresh_within;                     // as long as its owner called refresh() this recently
  Duration timeout;                            // the device acts when it stood still this long
  std::optional<std::size_t> timeout_setting;  // the register that holds `timeout`, if the device has one
};

/// Action of the device when the heartbeat stands still, or before the first one. An actuator is then off (a
/// temperature has no off). One that is safe when on, as a vent that lets the pressure out, says why beside its value:
/// `set: {vent: {value: 1, because: open it lets the pressure out}}`.
struct CommLoss {
  struct Set {
    std::size_t reg = 0;
    double value = 0.0;  // SI
  };
  std::vector<Set> set;
  std::vector<std::size_t> hold;    // actuators that keep their last command, by decision
  std::optional<std::size_t> flag;  // the register that shows the loss
};

/// A device's registers in file order, its timing and its safety. Made by the loader only.
struct RegisterMap {
  std::string device;
  std::string description;
  std::uint8_t unit = 1;
  bool gaps_readable = false;  // whether a read may run across addresses that the map does not name
  unsigned max_registers = largest_word_read;  // in one read: many devices allow fewer than the protocol
  unsigned max_bits = largest_bit_read;
  Duration poll;
  Duration answer_timeout;
  Duration write_deadline;      // a queued write older than this is dropped, and said so
  Duration read_back_deadline;  // a read-back that still differs after this is a mismatch
  std::vector<Register> registers;
  std::optional<Heartbeat> heartbeat;
  CommLoss comm_loss;

  [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;
};

/// Reads and checks a map. Throws InputError holding every fault of the file as "file:line: key: what; mend".
/// Set-up only.
[[nodiscard]] RegisterMap load_map(const std::filesystem::path& file);
/// The same from text; `name` stands where the file's name would.
[[nodiscard]] RegisterMap parse_map(const std::string& text, const std::string& name);

}  // namespace invar::modbus

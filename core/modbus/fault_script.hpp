// Fault scripts: what goes wrong with a simulated device, when and for how long.
//
//   invar_modbus_faults: 1
//   faults:
//     - {at: 10, for: 2, do: refuse}                       # times in s (or {value: 10, unit: min}) of the
//     - {at: 20, for: 0.5, do: delay, by: 0.4}             # device's clock since its first step
//     - {at: 30, for: 5, do: exception, code: 6, on: writes}
//     - {at: 40, for: 5, do: freeze, register: slide_temperature}
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "core/modbus/map.hpp"

namespace invar::modbus {

enum class FaultKind {
  refuse,       // connections are closed and new ones refused
  drop,         // the connection is closed when a request comes, which is not carried out
  lose_answer,  // the request is carried out, then the connection closed without an answer
  delay,  // the request is carried out, the answer comes later (in real time, whatever the device's clock)
  exception,  // the request is answered with an exception and not carried out
  freeze,     // one register keeps showing its value
  garbage,    // the request is carried out, the answer is no Modbus
  cut_short,  // the request is carried out, half of the answer comes
};

struct ScriptedFault {
  Duration at;
  Duration length;
  FaultKind kind = FaultKind::drop;
  bool on_reads = true;
  bool on_writes = true;
  std::optional<std::size_t> reg;  // freeze: which; exception: only requests that touch it
  std::uint8_t code = 4;           // of the exception
  Duration by;                     // of the delay

  [[nodiscard]] bool is_active(Duration since_start) const {
    return since_start >= at && since_start < at + length;
  }
};

using FaultScript = std::vector<ScriptedFault>;

/// Reads and checks a script for a device of this map. Throws InputError with every fault. Set-up only.
[[nodiscard]] FaultScript load_faults(const std::filesystem::path& file, const RegisterMap& map);
/// The same from text; `name` stands where the file's name would.
[[nodiscard]] FaultScript parse_faults(const std::string& text, const std::string& name,
                                       const RegisterMap& map);

}  // namespace invar::modbus

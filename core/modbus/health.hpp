// Notices about a device for its owner: it is lost, shows nonsense, refuses writes, or is well again.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "core/modbus/bus.hpp"

namespace invar::modbus {

struct HealthChange {
  enum class Level { note, warning, fault };  // over; readings still come; the device is lost, or refuses
  Level level = Level::note;
  std::string text;
};

/// Turns readings, write fates and counters into one change when something begins and one when it is over.
class Health {
 public:
  /// `where` stands in the texts: host and port.
  explicit Health(std::string where = {}) : where_{std::move(where)} {}

  /// To be called once a cycle, after the readings came.
  [[nodiscard]] std::vector<HealthChange> look(const Device& device, const LinkCounters& link, Instant now);
  /// A write was refused, or acknowledged and not followed, lately: for 1 s after the last one. The time doubles, up to
  /// 1 min, whenever the first try after it fails again.
  [[nodiscard]] bool refuses() const { return refuses_; }

 private:
  /// Something that lasts: told once when it has lasted, and once when it is over.
  struct Lasting {
    std::optional<Instant> since;
    bool told = false;
    bool begins(bool holds, Instant now, Duration patience);
    bool ends(bool holds);
  };
  /// Something that happens now and then while readings still come: told when it is a habit.
  struct Habit {
    std::uint64_t begun = 0;  // the count when it began
    Instant since{INT64_MIN};
    Instant quiet_until{INT64_MIN};
  };
  void look_at_readings(const Device& device, const LinkCounters& link, Instant now);
  void look_at_writes(const Device& device, Instant now);
  void look_at_habits(const Device& device, const LinkCounters& link, Instant now);
  void tell_habit(Habit& habit, std::uint64_t count, std::uint64_t enough, Instant now,
                  const std::string& text);
  void say(HealthChange::Level level, const std::string& text) { changes_.push_back({level, text}); }
  [[nodiscard]] std::string subject(const Device& device) const;

  std::string where_;
  Lasting lost_;
  Lasting outside_;
  Lasting slow_;
  std::array<Habit, 9> habits_{};
  bool was_well_ = false;
  bool told_refusal_ = false;
  bool refuses_ = false;
  std::uint64_t judged_ = 0;  // the newest write that failed
  Duration hold_ = Duration::seconds(1.0);
  Instant hold_until_{INT64_MIN};
  std::vector<HealthChange> changes_;
};

}  // namespace invar::modbus

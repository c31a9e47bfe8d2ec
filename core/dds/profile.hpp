// Profiles: what a port asks of the transport, by name; and whether a writer's and a reader's wishes meet.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/time.hpp"
#include "core/config/yaml.hpp"

namespace invar::dds {

/// Which participant of a process carries it.
enum class Traffic : std::uint8_t { realtime, general };
enum class Durability : std::uint8_t { volatile_, transient_local, transient, persistent };
enum class Liveliness : std::uint8_t { automatic, manual_by_participant, manual_by_topic };

/// The QoS of one end of a topic, ours or a foreign one that was discovered. A duration of zero: none asked
/// for (infinite).
struct Profile {
  std::string name;
  std::string purpose;
  Traffic traffic = Traffic::general;
  bool reliable = false;
  /// false: the newest `depth` samples of each instance. true: all, at most `depth` of each.
  bool keep_all = false;
  std::int64_t depth = 1;
  Durability durability = Durability::volatile_;
  Duration deadline;
  Duration lifespan;
  Liveliness liveliness = Liveliness::automatic;
  Duration lease;
  bool exclusive = false;
  std::int64_t strength = 0;
  std::int64_t max_instances = 64;
  /// The longest that a reliable writer waits for room in its history; then the sample is refused and counted.
  Duration blocking = Duration::milliseconds(100);
  /// Reliable writers ask for acknowledgement with every sample, not only every 5 ms: a loss is mended sooner, at
  /// the cost of as many messages again.
  bool asks_at_once = true;
  /// Bytes a second that writers of this profile in one process send at most; 0: no bound.
  std::int64_t flow = 0;
  std::vector<std::string> partitions;
  /// DDS-XTypes data representations: 0 XCDR1, 2 XCDR2. Empty means {0}.
  std::vector<std::int16_t> representations;
};

using Profiles = std::map<std::string, Profile, std::less<>>;

/// Reads a profiles file. Throws InputError with all its faults.
[[nodiscard]] Profiles load_profiles(const std::filesystem::path& file);
/// For a text without a file.
[[nodiscard]] Profiles parse_profiles(const std::string& text, const std::string& name);
/// The profiles that ship with Invar (deployment/profiles.yaml, built in), for tools that have no cell file.
[[nodiscard]] const Profiles& standard_profiles();

/// A policy on which a writer and a reader do not meet.
struct Mismatch {
  std::string policy;   // "reliability", "deadline", ...
  std::string offered;  // "best_effort", "100 ms"
  std::string requested;
  /// "deadline: writer offers 100 ms, reader asks for 50 ms"
  [[nodiscard]] std::string text() const;
};

/// The policies that keep `writer` and `reader` of one topic apart, by the rules of DDS 1.4 section 2.2.3 and
/// DDS-XTypes 1.3 section 7.6.3.1; none: they match.
[[nodiscard]] std::vector<Mismatch> mismatches(const Profile& writer, const Profile& reader);

}  // namespace invar::dds

// KeptModels: the models in use and those before them, kept in a folder so that the next start goes on with them.
#pragma once

#include <array>
#include <atomic>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "components/compensation/live_model.hpp"
#include "core/component/component.hpp"

namespace invar::compensation {

/// The folder holds a copy of each model, its checksum in its name, and `models.yaml`, with a checksum, which lists those in use
/// and those before.
/// That list is renamed into place after the copies, so a cut of power leaves either the old models or the new ones. Writing
/// is left to a thread of the owner's, never done in the loop (in simulated time at once, so that runs repeat).
class KeptModels {
 public:
  /// The geometric model, then those of position and temperature by axis; nullptr: none.
  using Selection = std::array<const LiveModel*, 4>;
  struct Selections {
    Selection in_use{};
    std::optional<Selection> before;  // what a rollback goes back to; nothing: not known
  };
  struct Entry {
    std::filesystem::path file;
    std::uint32_t checksum = 0;
  };
  struct Kept {
    bool any = false;  // there is a list, though it may be empty: corrections were taken out on purpose
    std::vector<Entry> models;
    std::optional<std::vector<Entry>> before;  // nothing: not known
  };
  /// Set-up. Throws InputError for a list that is damaged.
  [[nodiscard]] static Kept read(const std::filesystem::path& folder);
  /// Throws where the folder cannot be written. Not real-time.
  static void write(const std::filesystem::path& folder, const Selections& models);

  explicit KeptModels(const Component& owner) : owner_{owner} {}

  /// Set-up: from the component's configure; an empty folder keeps nothing.
  void open(const std::filesystem::path& folder) { folder_ = folder; }
  /// Real-time where time is real.
  void keep(const Selections& models) noexcept;
  /// Keeps the models that the loop left, if any. On one thread, while the models stand. Not real-time.
  void write_waiting() noexcept;
  /// True once after models could not be written. Real-time.
  [[nodiscard]] bool failed() noexcept { return failed_.exchange(false); }

 private:
  void put(const Selections& models) noexcept;

  const Component& owner_;
  std::filesystem::path folder_;
  Ring<Selections> waiting_{8};  // loop to thread
  std::atomic<bool> failed_{false};
};

}  // namespace invar::compensation

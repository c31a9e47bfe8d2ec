// KeyWatch: keys of a secured cell on the disk, while a program runs. Fast DDS reads them when a participant is made, and never again.
#pragma once

#include <ctime>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/dds/discovery.hpp"
#include "core/dds/holder_id.hpp"
#include "core/dds/identity.hpp"

namespace invar::dds {

/// Holders that are revoked by the list in `public/revoked.pem`, ascending. Throws InputError where it cannot be read or the authority of
/// identities has not signed it. Certificates whose numbers do not tell their holders are left out.
[[nodiscard]] std::vector<HolderId> revoked_holders(const KeyFolder& keys);

/// One thread at a time. Not for the loop.
class KeyWatch {
 public:
  explicit KeyWatch(Identity identity);
  struct News {
    std::optional<std::vector<HolderId>> revoked;  // the list, where it is another than at the last look
    std::vector<Alarm> alarms;
  };
  /// Once a second.
  [[nodiscard]] News look();

 private:
  struct Version {  // of a file
    std::filesystem::file_time_type written;
    std::uintmax_t size = 0;
    bool operator==(const Version&) const = default;
  };
  [[nodiscard]] static Version version_of(const std::filesystem::path& file);
  void look_at_list(News& news);
  void look_at_certificate(News& news);

  Identity identity_;
  std::optional<Version> list_;
  Version certificate_;
  std::time_t end_told_ = 0;
};

}  // namespace invar::dds

// KeyRing: the folder of a cell's keys - what is missing in it is made, what is there is kept.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/keys/rights.hpp"

namespace invar::tools {

struct KeyOrder {
  std::filesystem::path folder;
  int days = 730;                          // how long a new certificate is valid
  std::vector<std::string> renew, revoke;  // names
};

struct KeyState {
  std::string name;
  Role role = Role::process;
  std::string until;  // UTC
  std::string state;  // "new", "kept", "renewed", "revoked", "over"
};

/// Governance and permissions are signed anew each time: the deployment may have changed. Throws InputError for a name that is
/// none, a folder that cannot be written, and half an authority.
[[nodiscard]] std::vector<KeyState> make_keys(LoadedCell& cell, const KeyOrder& order);

}  // namespace invar::tools

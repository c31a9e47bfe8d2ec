// Identity: the certificate by which a participant is known in a secured cell, and the files that belong to it.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace invar::dds {

/// `invar keys` writes this layout. Everyone has `public`; who takes part has the folder of its own name.
struct KeyFolder {
  std::filesystem::path path;

  [[nodiscard]] std::filesystem::path identity_authority() const { return path / "public/identity_ca.pem"; }
  [[nodiscard]] std::filesystem::path permissions_authority() const {
    return path / "public/permissions_ca.pem";
  }
  [[nodiscard]] std::filesystem::path governance() const { return path / "public/governance.p7s"; }
  [[nodiscard]] std::filesystem::path revoked() const { return path / "public/revoked.pem"; }
  [[nodiscard]] std::filesystem::path certificate(const std::string& name) const {
    return path / name / "certificate.pem";
  }
  [[nodiscard]] std::filesystem::path key(const std::string& name) const { return path / name / "key.pem"; }
  [[nodiscard]] std::filesystem::path permissions(const std::string& name) const {
    return path / name / "permissions.p7s";
  }
};

/// A process that records, and each tool, has a second participant for bytes of any type: a participant knows one type support
/// for a type's name. Two participants with one certificate would not always find each other, so it has its own.
[[nodiscard]] inline std::string second_name(const std::string& name) { return name + "/second"; }

struct Identity {
  KeyFolder keys;
  std::string name;         // whose: a process, a person, a program
  bool may_command = true;  // otherwise it writes no requests
};

/// Throws InputError where a file is missing, the key can be read by others, or the certificate is over, not yet valid or revoked.
void check_identity(const Identity& identity);

/// Properties of DDS Security 1.1: authentication PKI-DH, access control by permissions, AES-GCM-GMAC. Paths as URIs.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> security_properties(const Identity& identity);

}  // namespace invar::dds

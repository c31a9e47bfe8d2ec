// Authority: one of the two authorities of a secured cell. That of identities issues and revokes certificates, that of permissions
// signs what each of them may do.
#pragma once

#include <filesystem>
#include <string>

#include "tools/keys/openssl_object.hpp"

namespace invar::tools {

/// Where the handshake of a participant begins: Fast DDS 2.9 and Cyclone DDS 0.10 understand one another only where the one with
/// the lower GUID is Cyclone's. The first bytes of a secured GUID follow from a hash of the subject's name.
enum class GuidPlace { high, low };

struct IssuedCertificate {
  OpensslCertificate certificate;
  OpensslKey key;
};

class Authority {
 public:
  /// Reads the authority whose certificate and key these are, or makes it where neither is there. Throws InputError where one
  /// of the two is missing: an authority is never overwritten.
  Authority(const std::filesystem::path& certificate, const std::filesystem::path& key,
            const std::string& name);

  [[nodiscard]] bool is_new() const { return is_new_; }
  [[nodiscard]] X509* certificate() const { return certificate_.get(); }
  /// `owner` becomes the common name, `cell` stands in the organisation. [days] from now.
  [[nodiscard]] IssuedCertificate issue(const std::string& cell, const std::string& owner, GuidPlace place,
                                        int days) const;
  /// S/MIME: the document in clear text with a detached signature, as DDS Security wants it.
  [[nodiscard]] std::string sign(const std::string& document) const;
  /// The list in `file`, or an empty one, with this certificate too; null: as it is. Signed anew.
  [[nodiscard]] std::string revocations(const std::filesystem::path& file, const X509* revoked) const;

 private:
  OpensslKey key_;
  OpensslCertificate certificate_;
  bool is_new_ = false;
};

[[nodiscard]] OpensslCertificate read_certificate(const std::filesystem::path& file);
[[nodiscard]] std::string pem_of(X509* certificate);
/// "CN=motion,OU=17,O=Invar xy_table", as RFC 2253 writes it.
[[nodiscard]] std::string subject_of(const X509* certificate);
/// "2028-11-26T18:00:00": UTC, as XML writes a time; so many days later.
[[nodiscard]] std::string time_text(const ASN1_TIME* time, int later = 0);
/// Whether the list in `file` has the certificate.
[[nodiscard]] bool is_revoked(const std::filesystem::path& file, X509* certificate);
/// Writes a private key that only its owner reads.
void write_key(const std::filesystem::path& file, EVP_PKEY* key);

}  // namespace invar::tools

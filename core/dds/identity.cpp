#include "core/dds/identity.hpp"

#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <memory>

#include "core/base/fault.hpp"
#include "core/dds/openssl_object.hpp"

namespace invar::dds {

namespace {

OpensslFile open_file(const std::filesystem::path& path, const std::string& whose) {
  OpensslFile file{BIO_new_file(path.c_str(), "r")};
  if (!file)
    throw InputError{path.string(), errno == EACCES ? "cannot be read by this user" : "is not there",
                     "`invar keys CELL` makes the keys of the cell; bring `public` and `" + whose +
                         "` of their folder to this PC, for the user that runs it"};
  return file;
}

std::string date_text(const ASN1_TIME* time) {
  std::tm utc{};
  std::array<char, 32> text{};
  ASN1_TIME_to_tm(time, &utc);
  return {text.data(), std::strftime(text.data(), text.size(), "%F %R UTC", &utc)};
}

void check_key(const std::filesystem::path& path, const std::string& whose) {
  (void)open_file(path, whose);
  struct stat state {};
  if (stat(path.c_str(), &state) == 0 && (state.st_mode & 077U) != 0)
    throw InputError{path.string(), "can be read by others than its owner", "chmod 600"};
}

}  // namespace

void check_identity(const Identity& identity) {
  const KeyFolder& keys = identity.keys;
  for (const auto& file : {keys.identity_authority(), keys.permissions_authority(), keys.governance(),
                           keys.permissions(identity.name)})
    (void)open_file(file, identity.name);
  check_key(keys.key(identity.name), identity.name);
  const auto path = keys.certificate(identity.name);
  const OpensslCertificate certificate{
      PEM_read_bio_X509(open_file(path, identity.name).get(), nullptr, nullptr, nullptr)};
  if (!certificate) throw InputError{path.string(), "is no certificate", "`invar keys CELL --renew NAME`"};
  const std::string renew = "`invar keys CELL --renew " + identity.name + "` makes another one";
  const ASN1_TIME* end = X509_get0_notAfter(certificate.get());
  const ASN1_TIME* begin = X509_get0_notBefore(certificate.get());
  if (X509_cmp_current_time(end) < 0)
    throw InputError{path.string(), "was valid until " + date_text(end), renew};
  if (X509_cmp_current_time(begin) > 0)
    throw InputError{path.string(), "is valid from " + date_text(begin) + " on",
                     "look at the clock of this PC"};
  const OpensslRevocations list{
      PEM_read_bio_X509_CRL(open_file(keys.revoked(), identity.name).get(), nullptr, nullptr, nullptr)};
  X509_REVOKED* entry = nullptr;
  if (list && X509_CRL_get0_by_cert(list.get(), &entry, certificate.get()) == 1)
    throw InputError{path.string(), "is revoked", renew};
}

std::vector<std::pair<std::string, std::string>> security_properties(const Identity& identity) {
  const KeyFolder& keys = identity.keys;
  const auto uri = [](const std::filesystem::path& path) {
    return "file://" + std::filesystem::absolute(path).string();
  };
  const std::string authentication = "dds.sec.auth.builtin.PKI-DH.";
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  return {{"dds.sec.auth.plugin", "builtin.PKI-DH"},
          {authentication + "identity_ca", uri(keys.identity_authority())},
          {authentication + "identity_certificate", uri(keys.certificate(identity.name))},
          {authentication + "identity_crl", uri(keys.revoked())},
          {authentication + "private_key", uri(keys.key(identity.name))},
          {"dds.sec.access.plugin", "builtin.Access-Permissions"},
          {access + "permissions_ca", uri(keys.permissions_authority())},
          {access + "governance", uri(keys.governance())},
          {access + "permissions", uri(keys.permissions(identity.name))},
          {"dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC"}};
}

}  // namespace invar::dds

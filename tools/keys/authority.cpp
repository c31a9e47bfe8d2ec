#include "tools/keys/authority.hpp"

#include <fcntl.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <ctime>
#include <vector>

#include "core/base/fault.hpp"
#include "core/base/new_file.hpp"
#include "core/dds/holder_id.hpp"

namespace invar::tools {

namespace {

constexpr int authority_days = 20 * 365;
constexpr long day = 24L * 3600L;

std::string text_of(BIO* file) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(file, &data);
  return {data, static_cast<std::size_t>(size)};
}

OpensslFile memory() { return OpensslFile{BIO_new(BIO_s_mem())}; }

void add_to(X509_NAME* name, const char* field, const std::string& value) {
  require_openssl(X509_NAME_add_entry_by_txt(name, field, MBSTRING_UTF8,
                                             reinterpret_cast<const unsigned char*>(value.data()),
                                             static_cast<int>(value.size()), -1, 0) == 1,
                  "write a subject's name");
}

OpensslName name_of(const std::string& organisation, const std::string& serial, const std::string& common) {
  OpensslName name{X509_NAME_new()};
  add_to(name.get(), "O", organisation);
  if (!serial.empty()) add_to(name.get(), "OU", serial);
  add_to(name.get(), "CN", common);
  return name;
}

using Hash = std::array<unsigned char, EVP_MAX_MD_SIZE>;

/// From which a secured GUID is made (DDS Security 1.1, 9.3.3).
Hash hash_of(const X509_NAME* name) {
  Hash hash{};
  unsigned size = 0;
  require_openssl(X509_NAME_digest(name, EVP_sha256(), hash.data(), &size) == 1, "hash a subject's name");
  return hash;
}

/// A subject that nobody had before, whose GUID lies where it shall.
OpensslName subject_at(GuidPlace place, const std::string& cell, const std::string& owner) {
  constexpr unsigned highest = 0xfe, lowest = 0x40;  // of the first octet; each second one of 128 and of 4
  std::uint32_t serial = 0;
  require_openssl(RAND_bytes(reinterpret_cast<unsigned char*>(&serial), 3) == 1, "draw a number");
  while (true) {
    OpensslName name = name_of("Invar " + cell, std::to_string(++serial), owner);
    const unsigned octet = hash_of(name.get()).front();
    if (place == GuidPlace::high ? octet >= highest : octet < lowest) return name;
  }
}

void add_extension(X509* certificate, int kind, const char* value) {
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, nullptr, kind, value);
  require_openssl(extension != nullptr && X509_add_ext(certificate, extension, -1) == 1,
                  "extend a certificate");
  X509_EXTENSION_free(extension);
}

OpensslCertificate certificate_for(const X509_NAME* subject, EVP_PKEY* key, int days) {
  OpensslCertificate certificate{X509_new()};
  const std::vector<unsigned char> serial = dds::serial_of(hash_of(subject));
  BIGNUM* number = BN_bin2bn(serial.data(), static_cast<int>(serial.size()), nullptr);
  BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate.get()));
  BN_free(number);
  X509_set_version(certificate.get(), 2);
  X509_set_subject_name(certificate.get(), subject);
  X509_set_pubkey(certificate.get(), key);
  // A PC whose clock is a little behind takes it, too.
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -3600);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), day * days);
  return certificate;
}

OpensslKey new_key() {
  OpensslKey key{EVP_EC_gen("P-256")};
  require_openssl(key != nullptr, "make a key");
  return key;
}

OpensslKey read_key(const std::filesystem::path& path) {
  const OpensslFile file{BIO_new_file(path.c_str(), "r")};
  OpensslKey key{file ? PEM_read_bio_PrivateKey(file.get(), nullptr, nullptr, nullptr) : nullptr};
  if (!key)
    throw InputError{
        path.string(), "is no private key that can be read",
        "bring it back from a copy; without it the cell needs new authorities in another folder"};
  return key;
}

OpensslRevocations read_revocations(const std::filesystem::path& path) {
  const OpensslFile file{BIO_new_file(path.c_str(), "r")};
  return OpensslRevocations{file ? PEM_read_bio_X509_CRL(file.get(), nullptr, nullptr, nullptr) : nullptr};
}

}  // namespace

Authority::Authority(const std::filesystem::path& certificate, const std::filesystem::path& key,
                     const std::string& name) {
  namespace fs = std::filesystem;
  if (fs::exists(key) != fs::exists(certificate))
    throw InputError{(fs::exists(key) ? certificate : key).string(), "is not there, but its other half is",
                     "bring it back from a copy, or begin with an empty folder: `--out DIR`"};
  is_new_ = !fs::exists(key);
  if (!is_new_) {
    key_ = read_key(key);
    certificate_ = read_certificate(certificate);
    if (X509_check_private_key(certificate_.get(), key_.get()) != 1)
      throw InputError{key.string(), "does not belong to " + certificate.string(),
                       "bring both back from a copy"};
    return;
  }
  key_ = new_key();
  const OpensslName subject = name_of("Invar", "", name);
  certificate_ = certificate_for(subject.get(), key_.get(), authority_days);
  X509_set_issuer_name(certificate_.get(), subject.get());
  add_extension(certificate_.get(), NID_basic_constraints, "critical,CA:TRUE");
  add_extension(certificate_.get(), NID_key_usage, "critical,keyCertSign,cRLSign,digitalSignature");
  require_openssl(X509_sign(certificate_.get(), key_.get(), EVP_sha256()) > 0, "sign a certificate");
  write_key(key, key_.get());
  write_file(certificate, pem_of(certificate_.get()));
}

IssuedCertificate Authority::issue(const std::string& cell, const std::string& owner, GuidPlace place,
                                   int days) const {
  IssuedCertificate issued{nullptr, new_key()};
  const OpensslName subject = subject_at(place, cell, owner);
  issued.certificate = certificate_for(subject.get(), issued.key.get(), days);
  X509* certificate = issued.certificate.get();
  X509_set_issuer_name(certificate, X509_get_subject_name(certificate_.get()));
  add_extension(certificate, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(certificate, NID_key_usage, "critical,digitalSignature");
  require_openssl(X509_sign(certificate, key_.get(), EVP_sha256()) > 0, "sign a certificate");
  return issued;
}

std::string Authority::sign(const std::string& document) const {
  constexpr int flags = PKCS7_TEXT | PKCS7_DETACHED;
  const OpensslFile in{BIO_new_mem_buf(document.data(), static_cast<int>(document.size()))};
  const OpensslSigned signature{PKCS7_sign(certificate_.get(), key_.get(), nullptr, in.get(), flags)};
  require_openssl(signature != nullptr && BIO_reset(in.get()) == 1, "sign a document");
  const OpensslFile out = memory();
  require_openssl(SMIME_write_PKCS7(out.get(), signature.get(), in.get(), flags) == 1,
                  "write a signed document");
  return text_of(out.get());
}

std::string Authority::revocations(const std::filesystem::path& file, const X509* revoked) const {
  OpensslRevocations list = read_revocations(file);
  if (!list) {
    list.reset(X509_CRL_new());
    X509_CRL_set_version(list.get(), 1);
    X509_CRL_set_issuer_name(list.get(), X509_get_subject_name(certificate_.get()));
  }
  // Nobody lets anybody in with a list that is over: it lives as long as its authority.
  const std::unique_ptr<ASN1_TIME, OpensslRelease<ASN1_TIME_free>> now{X509_gmtime_adj(nullptr, -3600)},
      next{X509_gmtime_adj(nullptr, day * authority_days)};
  X509_CRL_set1_lastUpdate(list.get(), now.get());
  X509_CRL_set1_nextUpdate(list.get(), next.get());
  if (revoked != nullptr) {
    X509_REVOKED* entry = X509_REVOKED_new();
    X509_REVOKED_set_serialNumber(entry,
                                  const_cast<ASN1_INTEGER*>(X509_get0_serialNumber(revoked)));  // NOLINT
    X509_REVOKED_set_revocationDate(entry, now.get());
    require_openssl(X509_CRL_add0_revoked(list.get(), entry) == 1, "revoke a certificate");
  }
  X509_CRL_sort(list.get());
  require_openssl(X509_CRL_sign(list.get(), key_.get(), EVP_sha256()) > 0, "sign the list of the revoked");
  const OpensslFile out = memory();
  require_openssl(PEM_write_bio_X509_CRL(out.get(), list.get()) == 1, "write the list of the revoked");
  return text_of(out.get());
}

OpensslCertificate read_certificate(const std::filesystem::path& path) {
  const OpensslFile file{BIO_new_file(path.c_str(), "r")};
  OpensslCertificate certificate{file ? PEM_read_bio_X509(file.get(), nullptr, nullptr, nullptr) : nullptr};
  if (!certificate)
    throw InputError{path.string(), "is no certificate that can be read",
                     "bring it back from a copy, or remove it"};
  return certificate;
}

std::string pem_of(X509* certificate) {
  const OpensslFile out = memory();
  require_openssl(PEM_write_bio_X509(out.get(), certificate) == 1, "write a certificate");
  return text_of(out.get());
}

std::string subject_of(const X509* certificate) {
  const OpensslFile out = memory();
  X509_NAME_print_ex(out.get(), X509_get_subject_name(certificate), 0,
                     XN_FLAG_RFC2253 & ~ASN1_STRFLGS_ESC_MSB);
  return text_of(out.get());
}

std::string time_text(const ASN1_TIME* time, int later) {
  std::tm utc{};
  std::array<char, 32> text{};
  ASN1_TIME_to_tm(time, &utc);
  const std::time_t seconds = timegm(&utc) + day * later;
  gmtime_r(&seconds, &utc);
  return {text.data(), std::strftime(text.data(), text.size(), "%FT%T", &utc)};
}

bool is_revoked(const std::filesystem::path& file, X509* certificate) {
  const OpensslRevocations list = read_revocations(file);
  X509_REVOKED* entry = nullptr;
  return list && X509_CRL_get0_by_cert(list.get(), &entry, certificate) == 1;
}

void write_key(const std::filesystem::path& file, EVP_PKEY* key) {
  const std::filesystem::path made = file.string() + ".new";
  std::filesystem::remove(made);
  const int descriptor =
      open(made.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, S_IRUSR | S_IWUSR);
  if (descriptor < 0)
    throw InputError{file.string(), "cannot be written", "check the permissions and the space of its folder"};
  const OpensslFile out{BIO_new_fd(descriptor, BIO_CLOSE)};
  require_openssl(PEM_write_bio_PKCS8PrivateKey(out.get(), key, nullptr, nullptr, 0, nullptr, nullptr) == 1 &&
                      fsync(descriptor) == 0,
                  "write a key");
  std::filesystem::rename(made, file);
}

}  // namespace invar::tools

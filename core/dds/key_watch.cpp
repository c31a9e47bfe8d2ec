#include "core/dds/key_watch.hpp"

#include <openssl/pem.h>

#include <algorithm>
#include <array>

#include "core/base/fault.hpp"
#include "core/dds/openssl_object.hpp"

namespace invar::dds {

namespace {

constexpr std::time_t day = 24L * 3600L;
constexpr std::time_t told_before = 30 * day;  // its end: time to bring another one
constexpr const char* subject = "keys";

template <class Object, class Read>
Object read_pem(const std::filesystem::path& path, Read read) {
  const OpensslFile file{BIO_new_file(path.c_str(), "r")};
  return Object{file ? read(file.get(), nullptr, nullptr, nullptr) : nullptr};
}

std::optional<HolderId> holder_of(const ASN1_INTEGER* serial) {
  std::array<unsigned char, serial_size> octets{};
  BIGNUM* number = ASN1_INTEGER_to_BN(serial, nullptr);
  const bool fits = BN_num_bytes(number) == static_cast<int>(octets.size()) &&
                    BN_bn2bin(number, octets.data()) == static_cast<int>(octets.size()) &&
                    octets.front() == serial_mark;
  BN_free(number);
  if (!fits) return std::nullopt;
  return holder_of_hash(std::span{octets}.subspan(1));
}

std::time_t end_of(const X509* certificate) {
  std::tm utc{};
  ASN1_TIME_to_tm(X509_get0_notAfter(certificate), &utc);
  return timegm(&utc);
}

}  // namespace

std::vector<HolderId> revoked_holders(const KeyFolder& keys) {
  const auto list = read_pem<OpensslRevocations>(keys.revoked(), PEM_read_bio_X509_CRL);
  const auto authority = read_pem<OpensslCertificate>(keys.identity_authority(), PEM_read_bio_X509);
  const char* mend = "bring `public` of the cell's keys to this PC again";
  if (!list || !authority) throw InputError{keys.revoked().string(), "cannot be read", mend};
  if (X509_CRL_verify(list.get(), X509_get0_pubkey(authority.get())) != 1)
    throw InputError{keys.revoked().string(), "is not signed by the authority of this cell", mend};
  std::vector<HolderId> holders;
  const STACK_OF(X509_REVOKED)* entries = X509_CRL_get_REVOKED(list.get());
  for (int i = 0; i < sk_X509_REVOKED_num(entries); ++i)
    if (const auto holder = holder_of(X509_REVOKED_get0_serialNumber(sk_X509_REVOKED_value(entries, i))))
      holders.push_back(*holder);
  std::sort(holders.begin(), holders.end());
  return holders;
}

KeyWatch::KeyWatch(Identity identity)
    : identity_{std::move(identity)}, certificate_{version_of(identity_.keys.certificate(identity_.name))} {}

KeyWatch::Version KeyWatch::version_of(const std::filesystem::path& file) {
  std::error_code none;
  return {std::filesystem::last_write_time(file, none), std::filesystem::file_size(file, none)};
}

KeyWatch::News KeyWatch::look() {
  News news;
  look_at_list(news);
  look_at_certificate(news);
  return news;
}

void KeyWatch::look_at_list(News& news) {
  const Version now = version_of(identity_.keys.revoked());
  if (list_ == now) return;
  list_ = now;
  try {
    news.revoked = revoked_holders(identity_.keys);
  } catch (const InputError& error) {
    news.alarms.push_back(
        {subject, error.faults().front().line() + "; the list that was read before counts", true});
  }
}

void KeyWatch::look_at_certificate(News& news) {
  const auto path = identity_.keys.certificate(identity_.name);
  if (const Version now = version_of(path); now != certificate_) {
    certificate_ = now;
    news.alarms.push_back(
        {subject,
         path.string() +
             ": another certificate is there, which counts from the next start of this process on",
         false});
  }
  const std::time_t now = std::time(nullptr);
  if (now - end_told_ < day) return;
  end_told_ = now;
  const auto certificate = read_pem<OpensslCertificate>(path, PEM_read_bio_X509);
  if (!certificate || end_of(certificate.get()) - now > told_before) return;
  const std::time_t days = (end_of(certificate.get()) - now) / day;
  news.alarms.push_back(
      {subject,
       path.string() + ": " + (days < 0 ? "is over" : "ends in " + std::to_string(days) + " days") +
           "; this process goes on, but does not start again beyond its end: `invar keys CELL --renew " +
           identity_.name + "`, bring it to this PC, and start the process anew",
       false});
}

}  // namespace invar::dds

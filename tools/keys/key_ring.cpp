#include "tools/keys/key_ring.hpp"

#include <openssl/pem.h>
#include <sys/stat.h>

#include <algorithm>

#include "core/base/fault.hpp"
#include "core/base/new_file.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/identity.hpp"
#include "tools/keys/authority.hpp"
#include "tools/keys/documents.hpp"

namespace invar::tools {

namespace fs = std::filesystem;

namespace {

bool is_among(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name.substr(0, name.find('/'))) != names.end();
}

void make_folder(const fs::path& folder, fs::perms mode) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!error) fs::permissions(folder, mode, error);
  if (error)
    throw InputError{folder.string(), "cannot be made (" + error.message() + ")",
                     "name another folder with --out"};
}

class KeyRing {
 public:
  KeyRing(const config::Cell& cell, const KeyOrder& order)
      : cell_{cell},
        order_{order},
        keys_{order.folder},
        identities_{keys_.identity_authority(), order.folder / "authority/identity_ca.key",
                    cell.name + " identities"},
        permissions_{keys_.permissions_authority(), order.folder / "authority/permissions_ca.key",
                     cell.name + " permissions"} {}

  /// Also of names that the cell file does not have any more.
  void revoke(const std::string& name) {
    bool found = false;
    for (const std::string& each : {name, dds::second_name(name)}) {
      if (!fs::exists(keys_.certificate(each))) continue;
      found = true;
      const OpensslCertificate certificate = read_certificate(keys_.certificate(each));
      if (!is_revoked(keys_.revoked(), certificate.get()))
        write_file(keys_.revoked(), identities_.revocations(keys_.revoked(), certificate.get()));
    }
    if (!found)
      throw InputError{"--revoke", "`" + name + "` has no certificate in " + order_.folder.string(),
                       "`invar keys CELL` lists the names"};
  }

  void sign_common() {
    if (!fs::exists(keys_.revoked()))
      write_file(keys_.revoked(), identities_.revocations(keys_.revoked(), nullptr));
    write_file(keys_.governance(), permissions_.sign(governance(cell_.domain)));
  }

  KeyState provide(const Rights& rights) {
    make_folder(order_.folder / rights.name, fs::perms::owner_all);
    KeyState state{rights.name, rights.role, "", "kept"};
    OpensslCertificate certificate = known(rights.name);
    const bool renews = is_among(order_.renew, rights.name);
    if (!certificate || renews) {
      state.state = certificate ? "renewed" : "new";
      certificate = issue(rights);
    } else if (is_revoked(keys_.revoked(), certificate.get())) {
      state.state = "revoked";
    } else if (X509_cmp_current_time(X509_get0_notAfter(certificate.get())) < 0) {
      state.state = "over";
    }
    state.until = time_text(X509_get0_notAfter(certificate.get()));
    // Fast DDS reads these times as those of the PC's time zone: a day more on both sides; the certificate has the last word.
    const std::string document =
        permissions_.sign(permissions(cell_.domain, subject_of(certificate.get()), rights,
                                      time_text(X509_get0_notBefore(certificate.get()), -1),
                                      time_text(X509_get0_notAfter(certificate.get()), 1)));
    constexpr std::size_t most =
        48'000;  // with the certificate and the answers of a handshake in one datagram
    if (document.size() > most)
      throw InputError{"permissions of `" + rights.name + "`",
                       "have " + std::to_string(document.size()) + " bytes, and a handshake carries " +
                           std::to_string(most),
                       "let several processes share its components"};
    write_file(keys_.permissions(rights.name), document);
    return state;
  }

 private:
  /// Null where there is none, or its key is not there.
  OpensslCertificate known(const std::string& name) const {
    if (!fs::exists(keys_.certificate(name)) || !fs::exists(keys_.key(name))) return nullptr;
    OpensslCertificate certificate = read_certificate(keys_.certificate(name));
    const OpensslFile file{BIO_new_file(keys_.key(name).c_str(), "r")};
    const OpensslKey key{file ? PEM_read_bio_PrivateKey(file.get(), nullptr, nullptr, nullptr) : nullptr};
    if (!key || X509_check_private_key(certificate.get(), key.get()) != 1) return nullptr;
    return certificate;
  }

  OpensslCertificate issue(const Rights& rights) {
    std::string owner = rights.name;
    std::replace(owner.begin(), owner.end(), '/', '.');
    const GuidPlace place = rights.role == Role::plant ? GuidPlace::low : GuidPlace::high;
    IssuedCertificate issued = identities_.issue(cell_.name, owner, place, order_.days);
    write_key(keys_.key(rights.name), issued.key.get());
    write_file(keys_.certificate(rights.name), pem_of(issued.certificate.get()));
    return std::move(issued.certificate);
  }

  const config::Cell& cell_;
  const KeyOrder& order_;
  dds::KeyFolder keys_;
  Authority identities_, permissions_;
};

}  // namespace

std::vector<KeyState> make_keys(LoadedCell& loaded, const KeyOrder& order) {
  const std::vector<Rights> all = rights_of(loaded);
  for (const std::string& name : order.renew)
    if (std::none_of(all.begin(), all.end(), [&](const Rights& rights) { return rights.name == name; })) {
      std::vector<std::string> names;
      names.reserve(all.size());
      for (const Rights& rights : all) names.push_back(rights.name);
      throw InputError{"--renew", "`" + name + "` is nobody of this cell", config::mend_name(name, names)};
    }
  make_folder(order.folder / "public", fs::perms{0755});
  make_folder(order.folder / "authority", fs::perms::owner_all);
  KeyRing ring{*loaded.cell, order};
  for (const std::string& name : order.revoke) ring.revoke(name);
  ring.sign_common();
  std::vector<KeyState> states;
  states.reserve(all.size());
  for (const Rights& rights : all) states.push_back(ring.provide(rights));
  return states;
}

}  // namespace invar::tools

// KeyWatch: keys made and lists signed by the openssl program.
#include "core/dds/key_watch.hpp"

#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>

#include "core/base/fault.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::dds {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// An authority of openssl's, and certificates whose serial numbers the caller chooses.
class Authority : public ::testing::Test {
 protected:
  Authority() {
    run("mkdir -p public loop other && openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes "
        "-keyout ca.key "
        "-out public/identity_ca.pem -days 10 -subj /CN=ca");
    std::ofstream{path() / "ca.cnf"}
        << "[ca]\ndefault_ca=d\n[d]\ndatabase=index.txt\ncrlnumber=crlnumber\ndefault_md=sha256\n"
           "default_crl_days=10\n";
    std::ofstream{path() / "crlnumber"} << "01\n";
    std::ofstream{path() / "index.txt"};
    certify(60);
    list("ca.key", "public/identity_ca.pem");
  }
  [[nodiscard]] std::filesystem::path path() const { return folder.path(); }
  void run(const std::string& command) const {
    ASSERT_EQ(std::system(("cd " + path().string() + " && " + command + " 2>>log").c_str()), 0)
        << command;  // NOLINT
  }
  void certify(int days) const {
    run("openssl req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout loop/key.pem -out loop.csr "
        "-subj /CN=loop && "
        "openssl x509 -req -in loop.csr -CA public/identity_ca.pem -CAkey ca.key -CAcreateserial -days " +
        std::to_string(days) + " -out loop/certificate.pem");
  }
  /// Puts a serial number into the authority's book.
  void revoke(const std::string& serial) const {
    std::ofstream{path() / "index.txt", std::ios::app} << "R\t350101000000Z\t260101000000Z\t" << serial
                                                       << "\tunknown\t/CN=x\n";
  }
  void list(const std::string& key, const std::string& certificate) const {
    run("openssl ca -gencrl -config ca.cnf -keyfile " + key + " -cert " + certificate +
        " -out new.pem && mv new.pem public/revoked.pem");
  }

  testing::TemporaryFolder folder;
  const Identity identity{{folder.path()}, "loop"};
};

TEST_F(Authority, ANumberThatTellsItsHolderIsReadAndOthersAreLeftOut) {
  KeyWatch watch{identity};
  const auto first = watch.look();
  ASSERT_TRUE(first.revoked.has_value());
  EXPECT_THAT(*first.revoked, IsEmpty());
  EXPECT_THAT(first.alarms, IsEmpty());
  EXPECT_FALSE(watch.look().revoked.has_value()) << "nothing has changed";

  revoke("4900112233445566778899AABBCCDDEEFF");
  revoke("0123456789ABCDEF");                    // of before the rule
  revoke("4A00112233445566778899AABBCCDDEEFF");  // of another mark
  list("ca.key", "public/identity_ca.pem");
  const auto second = watch.look();
  ASSERT_TRUE(second.revoked.has_value());
  // Octets 00 11 22 33 44 55 of the hash, one bit further and a bit before: 80 08 91 19 a2 2a.
  EXPECT_THAT(*second.revoked, ElementsAre(0x80089119a22aU));
  const GuidPrefix prefix{std::byte{0x80}, std::byte{0x08}, std::byte{0x91}, std::byte{0x19},
                          std::byte{0xa2}, std::byte{0x2a}, std::byte{7}};
  EXPECT_EQ(holder_of(prefix), second.revoked->front());
}

TEST_F(Authority, AListThatAnotherSignedOrThatIsCutChangesNothingAndIsTold) {
  KeyWatch watch{identity};
  (void)watch.look();
  run("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout foreign.key -out "
      "foreign.pem -days 10 -subj /CN=ca");
  revoke("4900112233445566778899AABBCCDDEEFF");
  list("foreign.key", "foreign.pem");
  auto news = watch.look();
  EXPECT_FALSE(news.revoked.has_value());
  ASSERT_THAT(news.alarms, SizeIs(1));
  EXPECT_THAT(news.alarms[0].text, HasSubstr("is not signed by the authority of this cell"));
  EXPECT_TRUE(news.alarms[0].fault);
  std::filesystem::resize_file(path() / "public/revoked.pem", 100);
  news = watch.look();
  EXPECT_FALSE(news.revoked.has_value());
  ASSERT_THAT(news.alarms, SizeIs(1));
  EXPECT_THAT(news.alarms[0].text, HasSubstr("cannot be read"));
}

TEST_F(Authority, ACertificateThatEndsOrIsAnotherIsTold) {
  certify(5);
  KeyWatch watch{identity};
  auto news = watch.look();
  ASSERT_THAT(news.alarms, SizeIs(1));
  EXPECT_THAT(news.alarms[0].text, ::testing::ContainsRegex("ends in [45] days"));
  EXPECT_THAT(news.alarms[0].text, HasSubstr("`invar keys CELL --renew loop`"));
  EXPECT_THAT(watch.look().alarms, IsEmpty()) << "once a day";
  certify(700);
  news = watch.look();
  ASSERT_THAT(news.alarms, SizeIs(1));
  EXPECT_THAT(news.alarms[0].text, HasSubstr("another certificate is there"));
}

}  // namespace
}  // namespace invar::dds

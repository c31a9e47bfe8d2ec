// The register image: which requests are carried out and which answered with which exception.
#include "core/modbus/image.hpp"

#include <gmock/gmock.h>

#include <random>

namespace invar::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;

RegisterMap map_of(bool gaps_readable) {
  RegisterMap map = parse_map(
      "invar_modbus_map: 1\ndevice: d\nregisters:\n"
      "  a: {address: 10, kind: holding, type: uint16, range: [0, 100], access: read_write, role: setting}\n"
      "  b: {address: 12, kind: holding, type: float32, range: [-1, 1], access: read_write, role: setting}\n"
      "  c: {address: 15, kind: holding, type: uint16, access: read}\n"
      "  d: {address: 16, kind: holding, type: uint16, access: write, role: setting}\n"
      "  e: {address: 3, kind: coil, type: bool, access: read_write, role: setting}\n"
      "  f: {address: 0, kind: discrete, type: bool, access: read}\n",
      "d.yaml");
  map.gaps_readable = gaps_readable;
  return map;
}

Bytes framed(Bytes pdu) {
  Bytes frame{0x12, 0x34, 0, 0, 0, static_cast<std::uint8_t>(pdu.size() + 1), 1};
  frame.insert(frame.end(), pdu.begin(), pdu.end());
  return frame;
}

/// The answer without its header, or empty.
Bytes answered(Image& image, const Bytes& pdu) {
  Image::Reply reply{};
  std::vector<std::size_t> written;
  const std::size_t size = image.answer(framed(pdu), reply, written);
  return size > 7 ? Bytes(reply.begin() + 7, reply.begin() + static_cast<std::ptrdiff_t>(size)) : Bytes{};
}

struct Case {
  const char* what;
  Bytes pdu;
  Bytes answer;
};

// Expected bytes by hand from the Modbus application protocol V1.1b3, section 6.
TEST(Image, AnswersAsTheSpecificationSays) {
  const RegisterMap strict = map_of(false);
  Image image{strict};
  for (const auto& [what, pdu, answer] : std::vector<Case>{
           {"write one register", {6, 0, 10, 0, 77}, {6, 0, 10, 0, 77}},
           {"read it back", {3, 0, 10, 0, 1}, {3, 2, 0, 77}},
           {"write a float 0.5", {16, 0, 12, 0, 2, 4, 0x3F, 0, 0, 0}, {16, 0, 12, 0, 2}},
           {"read half of it", {3, 0, 12, 0, 1}, {3, 2, 0x3F, 0}},
           {"set a coil", {5, 0, 3, 0xFF, 0}, {5, 0, 3, 0xFF, 0}},
           {"read a coil", {1, 0, 3, 0, 1}, {1, 1, 1}},
           {"set several coils", {15, 0, 3, 0, 1, 1, 0}, {15, 0, 3, 0, 1}},
           {"read a discrete input", {2, 0, 0, 0, 1}, {2, 1, 0}},
           {"unknown function", {43, 14, 1, 0, 0}, {0xAB, 1}},
           {"no input registers at all", {4, 0, 0, 0, 1}, {0x84, 2}},
           {"read across a gap", {3, 0, 10, 0, 4}, {0x83, 2}},
           {"read beyond the end", {3, 0, 16, 0, 2}, {0x83, 2}},
           {"read what is only written", {3, 0, 16, 0, 1}, {0x83, 2}},
           {"write what is only read", {6, 0, 15, 0, 1}, {0x86, 2}},
           {"write half a float", {6, 0, 12, 0, 1}, {0x86, 2}},
           {"write into a gap", {6, 0, 11, 0, 1}, {0x86, 2}},
           {"write above the range", {6, 0, 10, 0, 101}, {0x86, 3}},
           {"write a float above the range", {16, 0, 12, 0, 2, 4, 0x40, 0, 0, 0}, {0x90, 3}},
           {"write a float that is no number", {16, 0, 12, 0, 2, 4, 0x7F, 0xC0, 0, 0}, {0x90, 3}},
           {"fewer bytes than registers", {16, 0, 12, 0, 2, 4, 0x3F, 0}, {0x90, 3}},
           {"byte count that does not fit", {16, 0, 12, 0, 2, 2, 0x3F, 0, 0, 0}, {0x90, 3}},
           {"read nothing", {3, 0, 10, 0, 0}, {0x83, 3}},
           {"read too much", {3, 0, 10, 0, 126}, {0x83, 3}},
           {"a coil neither on nor off", {5, 0, 3, 1, 0}, {0x85, 3}},
       }) {
    EXPECT_EQ(answered(image, pdu), answer) << what;
  }
  EXPECT_EQ(image.value(0), 77.0);
  EXPECT_EQ(image.value(1), 0.5);
}

TEST(Image, ReadsAcrossGapsWhereTheMapSaysSo) {
  const RegisterMap lax = map_of(true);
  Image image{lax};
  image.set(2, 5);
  EXPECT_EQ(answered(image, {3, 0, 10, 0, 6}), (Bytes{3, 12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 5}));
  EXPECT_EQ(answered(image, {3, 0, 9, 0, 2}), (Bytes{0x83, 2}));
}

TEST(Image, SurvivesAnyBytesAndNeverLeavesItsRanges) {
  constexpr unsigned seed = 4242;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random{seed};
  const RegisterMap map = map_of(true);
  Image image{map};
  for (int i = 0; i < 20000; ++i) {
    Bytes pdu(1 + random() % 40);
    for (auto& byte : pdu) byte = static_cast<std::uint8_t>(random());
    if (random() % 4 != 0) pdu[0] = static_cast<std::uint8_t>(random() % 24);
    if (pdu.size() > 4 && random() % 2 == 0) {
      pdu[1] = 0;
      pdu[2] = static_cast<std::uint8_t>(random() % 20);
      pdu[3] = 0;
    }
    const Bytes answer = answered(image, pdu);
    ASSERT_FALSE(answer.empty()) << "seed " << seed;
    ASSERT_EQ(answer[0] & 0x7F, pdu[0] & 0x7F) << "seed " << seed;
    ASSERT_LE(image.value(0), 100.0);
    ASSERT_LE(std::abs(image.value(1)), 1.0);
    ASSERT_EQ(image.value(2), 0.0);
  }
}

}  // namespace
}  // namespace invar::modbus

#include "core/modbus/codec.hpp"

#include <gmock/gmock.h>
#include <modbus.h>

#include <array>
#include <bit>
#include <cmath>
#include <random>

namespace invar::modbus {
namespace {

Register of(Type type, WordOrder order = WordOrder::abcd, double scale = 1.0, double offset = 0.0) {
  Register reg;
  reg.name = "value";
  reg.type = type;
  reg.word_order = order;
  reg.scale = scale;
  reg.offset = offset;
  return reg;
}

TEST(Codec, PutsTheBytesOf32BitValuesWhereEachWordOrderWantsThem) {
  const double value = 0x0A0B0C0D;
  EXPECT_EQ(encode(of(Type::uint32, WordOrder::abcd), value), (Words{{0x0A0B, 0x0C0D}}));
  EXPECT_EQ(encode(of(Type::uint32, WordOrder::cdab), value), (Words{{0x0C0D, 0x0A0B}}));
  EXPECT_EQ(encode(of(Type::uint32, WordOrder::badc), value), (Words{{0x0B0A, 0x0D0C}}));
  EXPECT_EQ(encode(of(Type::uint32, WordOrder::dcba), value), (Words{{0x0D0C, 0x0B0A}}));
}

// libmodbus reads floats in the four orders: an independent truth. (Its 3.1.6 writes them wrongly.)
TEST(Codec, AgreesWithLibmodbusOnFloatsInEveryWordOrder) {
  const std::array orders{WordOrder::abcd, WordOrder::cdab, WordOrder::badc, WordOrder::dcba};
  const std::array read{modbus_get_float_abcd, modbus_get_float_cdab, modbus_get_float_badc,
                        modbus_get_float_dcba};
  for (std::size_t i = 0; i < orders.size(); ++i) {
    for (const float value : {0.0F, 1.5F, -30.1F, 3.4e38F, 1e-30F, 805.436F}) {
      const Register reg = of(Type::float32, orders[i]);
      const Words words = encode(reg, static_cast<double>(value));
      EXPECT_EQ(read[i](words.word.data()), value) << i;
      EXPECT_EQ(decode(reg, words.word), static_cast<double>(value)) << i;
    }
  }
}

TEST(Codec, ScalesAndRoundsToTheNearestCount) {
  const Register centiwatt = of(Type::uint16, WordOrder::abcd, 0.01);
  EXPECT_EQ(encode(centiwatt, 30.1).word[0], 3010);
  EXPECT_EQ(encode(centiwatt, 30.104).word[0], 3010);
  EXPECT_EQ(encode(centiwatt, 30.106).word[0], 3011);
  EXPECT_DOUBLE_EQ(decode(centiwatt, std::array<std::uint16_t, 1>{3010}), 30.1);
  const Register kelvin = of(Type::uint16, WordOrder::abcd, 0.1, -273.15);
  EXPECT_DOUBLE_EQ(decode(kelvin, std::array<std::uint16_t, 1>{2982}), 298.2 - 273.15);
  EXPECT_EQ(encode(kelvin, 25.05).word[0], 2982);
}

TEST(Codec, ReadsSignedTypesInTwosComplement) {
  EXPECT_EQ(decode(of(Type::int16), std::array<std::uint16_t, 1>{0xFFFE}), -2.0);
  EXPECT_EQ(decode(of(Type::uint16), std::array<std::uint16_t, 1>{0xFFFE}), 65534.0);
  EXPECT_EQ(decode(of(Type::int32), std::array<std::uint16_t, 2>{0xFFFF, 0xFFFE}), -2.0);
  EXPECT_EQ(decode(of(Type::uint32), std::array<std::uint16_t, 2>{0xFFFF, 0xFFFE}), 4294967294.0);
}

TEST(Codec, ClampsToWhatTheTypeHolds) {
  EXPECT_EQ(encode(of(Type::uint16), -5).word[0], 0);
  EXPECT_EQ(encode(of(Type::uint16), 7e4).word[0], 65535);
  EXPECT_EQ(encode(of(Type::int16), 4e4).word[0], 0x7FFF);
  EXPECT_EQ(encode(of(Type::int32), -1e12), (Words{{0x8000, 0x0000}}));
  EXPECT_EQ(encode(of(Type::uint32), HUGE_VAL), (Words{{0xFFFF, 0xFFFF}}));
}

TEST(Codec, FindsABooleanInItsWord) {
  Register reg = of(Type::boolean);
  reg.bit = 9;
  EXPECT_EQ(decode(reg, std::array<std::uint16_t, 1>{0x0200}), 1.0);
  EXPECT_EQ(decode(reg, std::array<std::uint16_t, 1>{0xFDFF}), 0.0);
  EXPECT_EQ(encode(reg, 1).word[0], 0x0200);
}

TEST(Codec, GivesBackEveryRawValueThatItReads) {
  constexpr unsigned seed = 20240607;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random{seed};
  for (const Type type : {Type::int16, Type::uint16, Type::int32, Type::uint32}) {
    for (const WordOrder order : {WordOrder::abcd, WordOrder::cdab, WordOrder::badc, WordOrder::dcba}) {
      Register reg = of(type, order, 0.001, -12.5);
      for (int i = 0; i < 500; ++i) {
        Words words;
        for (unsigned w = 0; w < reg.width(); ++w) words.word[w] = static_cast<std::uint16_t>(random());
        EXPECT_EQ(encode(reg, decode(reg, words.word)), words) << "seed " << seed;
      }
    }
  }
}

}  // namespace
}  // namespace invar::modbus

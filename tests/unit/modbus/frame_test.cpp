// Requests as bytes against the specification's examples, and answers with one wrong field each.
#include "core/modbus/frame.hpp"

#include <gmock/gmock.h>

#include <vector>

namespace invar::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;
using ::testing::ElementsAre;

Bytes bytes_of(const Question& question) {
  Frame frame;
  const std::size_t size = write_frame(question, frame);
  return {frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size)};
}

// The requests of the Modbus application protocol V1.1b3, 6.1 to 6.12, behind a header.
TEST(Frame, WritesTheRequestsOfTheSpecification) {
  EXPECT_THAT(bytes_of({0x1501, 0xFF, Function::read_coils, 0x13, 0x13, {}}),
              ElementsAre(0x15, 1, 0, 0, 0, 6, 0xFF, 1, 0, 0x13, 0, 0x13));
  EXPECT_THAT(bytes_of({1, 2, Function::read_holding, 0x6B, 3, {}}),
              ElementsAre(0, 1, 0, 0, 0, 6, 2, 3, 0, 0x6B, 0, 3));
  EXPECT_THAT(bytes_of({1, 2, Function::write_coil, 0xAC, 1, {1, 0}}),
              ElementsAre(0, 1, 0, 0, 0, 6, 2, 5, 0, 0xAC, 0xFF, 0));
  EXPECT_THAT(bytes_of({1, 2, Function::write_register, 1, 1, {3, 0}}),
              ElementsAre(0, 1, 0, 0, 0, 6, 2, 6, 0, 1, 0, 3));
  EXPECT_THAT(bytes_of({1, 2, Function::write_coils, 0x13, 1, {1, 0}}),
              ElementsAre(0, 1, 0, 0, 0, 8, 2, 15, 0, 0x13, 0, 1, 1, 1));
  EXPECT_THAT(bytes_of({1, 2, Function::write_registers, 1, 2, {0x0A, 0x102}}),
              ElementsAre(0, 1, 0, 0, 0, 11, 2, 16, 0, 1, 0, 2, 4, 0, 0x0A, 1, 2));
}

const Question two_words{7, 1, Function::read_holding, 0x6B, 2, {}};
const Bytes sound{0, 7, 0, 0, 0, 7, 1, 3, 4, 0x02, 0x2B, 0x00, 0x64};

Flaw flaw_of(const Bytes& answer, const Question& question = two_words) {
  std::array<std::uint16_t, 32> words{};
  return judge(question, answer, words).flaw;
}

TEST(Frame, ReadsASoundAnswer) {
  std::array<std::uint16_t, 2> words{};
  const Judgement judgement = judge(two_words, sound, words);
  EXPECT_EQ(judgement.flaw, Flaw::none);
  EXPECT_EQ(judgement.exception, 0);
  EXPECT_THAT(words, ElementsAre(0x22B, 100));
  std::array<std::uint16_t, 19> bits{};
  // 6.1: coils 20 to 38 as CD 6B 05.
  const Question coils{7, 1, Function::read_coils, 0x13, 19, {}};
  EXPECT_EQ(judge(coils, Bytes{0, 7, 0, 0, 0, 6, 1, 1, 3, 0xCD, 0x6B, 0x05}, bits).flaw, Flaw::none);
  EXPECT_THAT(bits, ElementsAre(1, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 0, 1));
}

TEST(Frame, FindsEveryWrongField) {
  const auto changed = [](std::size_t at, std::uint8_t to) {
    Bytes answer = sound;
    answer[at] = to;
    return answer;
  };
  EXPECT_EQ(flaw_of(changed(1, 8)), Flaw::transaction);
  EXPECT_EQ(flaw_of(changed(3, 1)), Flaw::protocol);
  EXPECT_EQ(flaw_of(changed(5, 6)), Flaw::length);  // one byte stands behind the frame
  EXPECT_EQ(flaw_of(changed(5, 8)), Flaw::length);  // one byte is missing
  EXPECT_EQ(flaw_of(changed(6, 2)), Flaw::unit);
  EXPECT_EQ(flaw_of(changed(7, 4)), Flaw::function);
  EXPECT_EQ(flaw_of(changed(7, 0x84)), Flaw::function);
  EXPECT_EQ(flaw_of(changed(7, 0x83)), Flaw::length);  // an exception is not that long
  for (const std::uint8_t count : Bytes{0, 2, 3, 5, 6, 255})
    EXPECT_EQ(flaw_of(changed(8, count)), Flaw::byte_count);
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 9, 1, 3, 4, 2, 0x2B, 0, 0x64, 0, 0}),
            Flaw::length);  // more than it counts
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 3, 1, 0x83, 0}), Flaw::exception_code);
  std::array<std::uint16_t, 2> words{};
  EXPECT_EQ(judge(two_words, Bytes{0, 7, 0, 0, 0, 3, 1, 0x83, 6}, words).exception, 6);
}

TEST(Frame, AWriteIsEchoedWhole) {
  const Question one{7, 1, Function::write_register, 0x102, 1, {0x304, 0}};
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 6, 1, 6, 1, 2, 3, 4}, one), Flaw::none);
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 6, 1, 6, 1, 3, 3, 4}, one), Flaw::echo);
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 6, 1, 6, 1, 2, 3, 5}, one), Flaw::echo);
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 7, 1, 6, 1, 2, 3, 4, 0}, one), Flaw::length);
  const Question two{7, 1, Function::write_registers, 0x102, 2, {1, 2}};
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 6, 1, 16, 1, 2, 0, 2}, two), Flaw::none);
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 6, 1, 16, 1, 2, 0, 1}, two), Flaw::echo);
  const Question coil{7, 1, Function::write_coil, 0x102, 1, {1, 0}};
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 6, 1, 5, 1, 2, 0xFF, 0}, coil), Flaw::none);
  EXPECT_EQ(flaw_of({0, 7, 0, 0, 0, 6, 1, 5, 1, 2, 0, 0}, coil), Flaw::echo);
}

}  // namespace
}  // namespace invar::modbus

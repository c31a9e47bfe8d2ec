// Mutated Modbus answers: no crash, no hang, and no value of an answer whose header, length, unit, function or count is wrong.
//
// The oracle parses nothing: it writes the only sound answer with these data byte by byte from the request and compares. INVAR_FUZZ_RUNS sets
// the number of answers (default 4000 over a connection, 100,000 without), INVAR_FUZZ_SEED the seed.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iostream>
#include <mutex>
#include <random>
#include <string>

#include "core/base/clock.hpp"
#include "core/modbus/frame.hpp"
#include "core/modbus/link.hpp"
#include "tests/support/modbus_peer.hpp"

namespace invar::modbus {
namespace {

using test::Bytes;
using test::ModbusPeer;
using test::Talk;

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

double resident_mib() {
  std::ifstream status{"/proc/self/statm"};
  double total = 0.0, resident = 0.0;
  status >> total >> resident;
  return resident * 4096.0 / 1048576.0;
}

/// What stands before the data in the only sound answer to a read of registers.
Bytes sound_beginning(const Bytes& request) {
  const unsigned count = request[10] * 256U + request[11];
  return {request[0],
          request[1],
          0,
          0,
          static_cast<std::uint8_t>((2 * count + 3) / 256),
          static_cast<std::uint8_t>((2 * count + 3) % 256),
          request[6],
          request[7],
          static_cast<std::uint8_t>(2 * count)};
}

/// Where `answer` is at `at` exactly that, the values in it.
bool is_sound(const Bytes& request, const Bytes& answer, std::size_t at,
              const std::vector<std::uint16_t>& words) {
  const Bytes beginning = sound_beginning(request);
  if (answer.size() < at + beginning.size() + 2 * words.size()) return false;
  const auto from = answer.begin() + static_cast<std::ptrdiff_t>(at);
  if (!std::equal(beginning.begin(), beginning.end(), from)) return false;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::size_t byte = at + beginning.size() + 2 * i;
    if (answer[byte] * 256U + answer[byte + 1] != words[i]) return false;
  }
  return true;
}

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_{seed} {}
  std::size_t below(std::size_t limit) { return random_() % limit; }
  bool one_in(std::size_t n) { return below(n) == 0; }
  std::uint8_t byte() {
    constexpr std::uint8_t odd[] = {0, 1, 2, 3, 4, 0x7F, 0x80, 0x83, 0xFE, 0xFF};
    return one_in(2) ? odd[below(std::size(odd))] : static_cast<std::uint8_t>(below(256));
  }
  /// One to three changes, half of them in the header.
  void change(Bytes& answer) {
    for (std::size_t changes = 1 + below(3); changes > 0; --changes) {
      const std::size_t at =
          below(one_in(2) ? std::min<std::size_t>(9, answer.size() + 1) : answer.size() + 1);
      const auto place = answer.begin() + static_cast<std::ptrdiff_t>(std::min(at, answer.size()));
      switch (below(6)) {
        case 0:
          answer.resize(at);
          break;
        case 1:
          answer.insert(place, byte());
          break;
        case 2:
          if (place != answer.end()) answer.erase(place);
          break;
        case 3:
          if (place != answer.end()) *place = static_cast<std::uint8_t>(*place ^ (1U << below(8)));
          break;
        case 4:
          for (std::size_t n = below(300); n > 0; --n) answer.push_back(byte());
          break;
        default:
          if (place != answer.end()) *place = byte();
      }
    }
  }

 private:
  std::mt19937_64 random_;
};

TEST(ModbusAnswers, NoMutatedFrameIsTakenForTheAnswer) {
  const std::uint64_t seed = from_environment("INVAR_FUZZ_SEED", 30);
  const std::uint64_t runs = from_environment("INVAR_FUZZ_RUNS", 100'000);
  std::cout << "seed " << seed << ", " << runs << " frames\n";
  Mutator mutator{seed};
  std::uint64_t taken = 0;
  for (std::uint64_t run = 0; run < runs; ++run) {
    Question question{static_cast<std::uint16_t>(mutator.below(65536)),
                      static_cast<std::uint8_t>(1 + mutator.below(247)),
                      mutator.one_in(2) ? Function::read_holding : Function::read_input,
                      static_cast<std::uint16_t>(mutator.below(60000)),
                      static_cast<std::uint16_t>(1 + mutator.below(125)),
                      {}};
    Frame frame;
    const std::size_t size = write_frame(question, frame);
    const Talk talk{-1, 1, 1, Bytes{frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size)}};
    Bytes answer = talk.honest();
    if (!mutator.one_in(50)) mutator.change(answer);
    std::vector<std::uint16_t> words(question.count);
    const Judgement judgement = judge(question, answer, words);
    const bool good = judgement.flaw == Flaw::none && judgement.exception == 0;
    // A sound answer in which only data were changed is one all the same.
    const Bytes beginning = sound_beginning(talk.request);
    const bool sound = answer.size() == beginning.size() + 2U * question.count &&
                       std::equal(beginning.begin(), beginning.end(), answer.begin());
    ASSERT_EQ(good, sound) << "run " << run;
    ASSERT_TRUE(!good || is_sound(talk.request, answer, 0, words)) << "run " << run;
    taken += good ? 1 : 0;
  }
  std::cout << taken << " sound\n";
  EXPECT_GT(taken, runs / 100);
}

/// A peer that says nonsense, and remembers what it said on the present connection.
struct Liar {
  explicit Liar(std::uint64_t seed) : mutator{seed} {}

  void answer(Talk& talk) {
    Bytes bytes = talk.honest();
    bool closes = false;
    {
      const std::lock_guard lock{mutex};
      if (!is_honest) {
        if (!mutator.one_in(10)) mutator.change(bytes);
        if (mutator.one_in(8)) {  // two answers at once, the second of another request
          Bytes other = talk.honest();
          mutator.change(other);
          bytes.insert(mutator.one_in(2) ? bytes.begin() : bytes.end(), other.begin(), other.end());
        }
        closes = mutator.one_in(3);
      }
      if (talk.number == 1) said.clear();
      said.insert(said.end(), bytes.begin(), bytes.end());
      request = talk.request;
    }
    talk.send(bytes);
    if (closes) talk.close();
  }

  std::mutex mutex;
  Mutator mutator;
  bool is_honest = false;
  Bytes said;  // on the connection of the latest request
  Bytes request;
};

TEST(ModbusAnswers, NoMutatedStreamGivesAWrongValueHangsOrGrows) {
  const std::uint64_t seed = from_environment("INVAR_FUZZ_SEED", 30);
  const std::uint64_t runs = from_environment("INVAR_FUZZ_RUNS", 4000);
  std::cout << "seed " << seed << ", " << runs << " answers\n";
  Liar liar{seed};
  ModbusPeer peer{[&](Talk& talk) { liar.answer(talk); }};
  Link link{"127.0.0.1", peer.port};
  std::uint64_t good = 0, causes[7]{};
  double longest = 0.0;
  double resident = 0.0;
  std::vector<std::uint16_t> words;
  for (std::uint64_t run = 0; run < runs; ++run) {
    if (run == runs / 10) resident = resident_mib();
    if (!link.is_open() && link.open(Duration::seconds(20))) continue;
    link.address(static_cast<std::uint8_t>(1 + run % 3), Duration::milliseconds(4));
    words.assign(1 + run % 20, 0);
    const Instant begin = monotonic_now();
    const auto failed = link.read(run % 2 == 0 ? Kind::holding : Kind::input, 100, words);
    longest = std::max(longest, (monotonic_now() - begin).in_seconds());
    if (failed) {
      ++causes[static_cast<std::size_t>(failed->cause)];
      continue;
    }
    ++good;
    const std::lock_guard lock{liar.mutex};
    bool said = false;
    for (std::size_t at = 0; at < liar.said.size() && !said; ++at)
      said = is_sound(liar.request, liar.said, at, words);
    ASSERT_TRUE(said) << "run " << run;
  }
  std::cout << good << " good";
  for (std::size_t i = 0; i < std::size(causes); ++i)
    std::cout << ", " << causes[i] << " " << name_of(static_cast<Cause>(i));
  std::cout << "; longest " << longest << " s, memory " << resident_mib() - resident << " MiB more\n";
  EXPECT_LT(longest, 20.0);
  EXPECT_LT(resident_mib() - resident, 16.0);
  EXPECT_GT(good, runs / 100);
  EXPECT_GT(causes[static_cast<std::size_t>(Cause::malformed)], runs / 100);

  {
    const std::lock_guard lock{liar.mutex};
    liar.is_honest = true;
  }
  link.close();
  ASSERT_FALSE(link.open(Duration::seconds(20)));
  link.address(1, Duration::seconds(20));
  words.assign(4, 0);
  EXPECT_FALSE(link.read(Kind::holding, 100, words));
  EXPECT_EQ(words[3], 1103);
}

}  // namespace
}  // namespace invar::modbus

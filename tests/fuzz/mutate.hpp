// Changes bytes at random, from a seed: the same number makes the same input again, on any machine.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace invar::fuzz {

using Bytes = std::vector<std::uint8_t>;

inline Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

/// Numbers at which readers go wrong: ends of ranges, lengths that overflow, counts beyond any memory.
constexpr std::array<std::uint64_t, 14> odd_numbers{0,
                                                    1,
                                                    2,
                                                    0x7F,
                                                    0x80,
                                                    0xFF,
                                                    0x7FFF,
                                                    0xFFFF,
                                                    0x7FFFFFFF,
                                                    0x80000000,
                                                    0xFFFFFFF0U,
                                                    0xFFFFFFFFU,
                                                    0x7FFFFFFFFFFFFFFF,
                                                    0xFFFFFFFFFFFFFFFF};

/// Words that steer a shell, a terminal, a page or a reader of texts.
inline const std::vector<std::string>& hostile_words() {
  static const std::vector<std::string> words{"`touch F`",
                                              "$(touch F)",
                                              ";",
                                              "\"",
                                              "'",
                                              "\n",
                                              std::string(1, '\0'),
                                              "\x1b[31m",
                                              "</script>",
                                              "{{",
                                              "[[[[",
                                              "&a *a",
                                              "!!binary",
                                              "- ",
                                              ": ",
                                              "?",
                                              "---\n",
                                              "nan",
                                              ".inf",
                                              "-1",
                                              "1e999",
                                              "0x",
                                              "%",
                                              "\xff",
                                              "\xC2\xB5",
                                              "\xE2\x80\xAE",
                                              "99999999999999999999",
                                              "(((((((((",
                                              ",,,,,,,,",
                                              "\t",
                                              "#",
                                              "|",
                                              ">",
                                              "@key",
                                              "sequence<",
                                              "[4294967295]",
                                              "../"};
  return words;
}

class Mutator {
 public:
  /// `words`: of the format, put in as they are.
  explicit Mutator(std::vector<std::string> words = {}) : words_{std::move(words)} {
    words_.insert(words_.end(), hostile_words().begin(), hostile_words().end());
  }

  /// Input `number` of `seed`: one of `seeds` with one to eight changes. Every 64th is a seed as it is.
  [[nodiscard]] Bytes input(const std::vector<Bytes>& seeds, std::uint64_t seed, std::uint64_t number) const {
    std::mt19937_64 random{seed * 0x9E3779B97F4A7C15U + number};
    Bytes bytes = seeds[random() % seeds.size()];
    if (number % 64 == 0) return bytes;
    for (auto left = 1 + random() % 8; left > 0; --left) change(bytes, seeds, random);
    return bytes;
  }

 private:
  static void insert(Bytes& bytes, std::size_t at, const Bytes& what) {
    bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), what.begin(), what.end());
  }
  static Bytes part(const Bytes& bytes, std::mt19937_64& random) {
    if (bytes.empty()) return {};
    const std::size_t begin = random() % bytes.size();
    const std::size_t length = std::min<std::size_t>(1 + random() % 64, bytes.size() - begin);
    return {bytes.begin() + static_cast<std::ptrdiff_t>(begin),
            bytes.begin() + static_cast<std::ptrdiff_t>(begin + length)};
  }

  void change(Bytes& bytes, const std::vector<Bytes>& seeds, std::mt19937_64& random) const {
    constexpr std::size_t longest = 1U << 20U;
    const std::size_t at = bytes.empty() ? 0 : random() % bytes.size();
    const auto left = static_cast<std::ptrdiff_t>(bytes.size() - at);
    switch (bytes.empty() ? 5 : random() % 10) {
      case 0:
        bytes[at] ^= static_cast<std::uint8_t>(1U << random() % 8);
        break;
      case 1:
        bytes[at] = static_cast<std::uint8_t>(random());
        break;
      case 2: {  // a number in either byte order
        auto number = odd_numbers[random() % odd_numbers.size()];
        const std::size_t size = std::size_t{1} << random() % 4;
        const bool big = random() % 2 == 0;
        for (std::size_t i = 0; i < size && at + i < bytes.size(); ++i)
          bytes[at + i] = static_cast<std::uint8_t>(number >> 8U * (big ? size - 1 - i : i));
        break;
      }
      case 3:
        bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                    bytes.begin() + static_cast<std::ptrdiff_t>(at) +
                        std::min<std::ptrdiff_t>(left, 1 + static_cast<std::ptrdiff_t>(random() % 32)));
        break;
      case 4:
        bytes.resize(at);
        break;
      case 5:
        insert(bytes, at, bytes_of(words_[random() % words_.size()]));
        break;
      case 6:
        insert(bytes, at, part(seeds[random() % seeds.size()], random));
        break;
      case 7: {  // a part many times
        const Bytes again = part(bytes, random);
        for (auto times = random() % 200; times > 0 && bytes.size() < longest; --times)
          insert(bytes, at, again);
        break;
      }
      case 8: {  // a number as letters
        auto digit = std::find_if(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end(),
                                  [](std::uint8_t c) { return c >= '0' && c <= '9'; });
        if (digit == bytes.end()) break;
        const Bytes text = bytes_of(std::to_string(odd_numbers[random() % odd_numbers.size()]));
        const auto place = static_cast<std::size_t>(bytes.erase(digit) - bytes.begin());
        insert(bytes, place, text);
        break;
      }
      default: {  // two parts change places
        const std::size_t other = random() % bytes.size();
        const std::size_t length =
            std::min({bytes.size() - std::max(at, other), std::size_t{1} + random() % 32});
        for (std::size_t i = 0; i < length; ++i) std::swap(bytes[at + i], bytes[other + i]);
      }
    }
  }

  std::vector<std::string> words_;
};

}  // namespace invar::fuzz

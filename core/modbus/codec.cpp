#include "core/modbus/codec.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "core/base/contract.hpp"

namespace invar::modbus {

namespace {

constexpr std::uint16_t swapped(std::uint16_t word) {
  return static_cast<std::uint16_t>((word << 8) | (word >> 8));
}

// The order is its own inverse: swapping words and bytes twice gives the same again.
Words reordered(WordOrder order, Words words) {
  if (order == WordOrder::cdab || order == WordOrder::dcba) std::swap(words.word[0], words.word[1]);
  if (order == WordOrder::badc || order == WordOrder::dcba)
    for (auto& word : words.word) word = swapped(word);
  return words;
}

template <class Integer>
Integer rounded(double raw) {
  constexpr double lowest = std::numeric_limits<Integer>::min();
  constexpr double highest = std::numeric_limits<Integer>::max();
  return static_cast<Integer>(std::clamp(std::nearbyint(raw), lowest, highest));
}

Words split(std::uint32_t raw) {
  return {{static_cast<std::uint16_t>(raw >> 16), static_cast<std::uint16_t>(raw & 0xFFFFU)}};
}

/// Apart, since printing a broken contract would weigh on a function that runs for every value of every poll.
[[noreturn, gnu::noinline]] void too_few_words(std::size_t words) {
  INVAR_EXPECTS(false && "a 32-bit value needs two words, others one", words);
  std::abort();
}

}  // namespace

double decode(const Encoding& how, std::span<const std::uint16_t> words) {
  if (words.size() < how.width()) [[unlikely]]
    too_few_words(words.size());
  const auto joined = [&] {
    const Words ordered = reordered(how.word_order, {{words[0], words[1]}});
    return (std::uint32_t{ordered.word[0]} << 16) | ordered.word[1];
  };
  switch (how.type) {
    case Type::boolean:
      return how.bit ? (unsigned{words[0]} >> *how.bit) & 1U : (words[0] != 0 ? 1.0 : 0.0);
    case Type::int16:
      return how.scale * static_cast<std::int16_t>(words[0]) + how.offset;
    case Type::uint16:
      return how.scale * words[0] + how.offset;
    case Type::int32:
      return how.scale * static_cast<std::int32_t>(joined()) + how.offset;
    case Type::uint32:
      return how.scale * joined() + how.offset;
    case Type::float32:
      break;
  }
  return how.scale * static_cast<double>(std::bit_cast<float>(joined())) + how.offset;
}

Words encode(const Encoding& how, double value) {
  const double raw = (value - how.offset) / how.scale;
  INVAR_EXPECTS(how.type == Type::float32 || !std::isnan(value), value);
  switch (how.type) {
    case Type::boolean:
      return {{static_cast<std::uint16_t>(value != 0.0 ? 1U << how.bit.value_or(0) : 0U), 0}};
    case Type::int16:
      return {{static_cast<std::uint16_t>(rounded<std::int16_t>(raw)), 0}};
    case Type::uint16:
      return {{rounded<std::uint16_t>(raw), 0}};
    case Type::int32:
      return reordered(how.word_order, split(static_cast<std::uint32_t>(rounded<std::int32_t>(raw))));
    case Type::uint32:
      return reordered(how.word_order, split(rounded<std::uint32_t>(raw)));
    case Type::float32:
      break;
  }
  constexpr double largest = std::numeric_limits<float>::max();
  const auto number = static_cast<float>(std::isnan(raw) ? raw : std::clamp(raw, -largest, largest));
  return reordered(how.word_order, split(std::bit_cast<std::uint32_t>(number)));
}

Range representable(const Encoding& how) {
  double lower = 0.0;
  double upper = 1.0;
  switch (how.type) {
    case Type::boolean:
      return {0.0, 1.0};
    case Type::int16:
      lower = std::numeric_limits<std::int16_t>::min();
      upper = std::numeric_limits<std::int16_t>::max();
      break;
    case Type::uint16:
      upper = std::numeric_limits<std::uint16_t>::max();
      break;
    case Type::int32:
      lower = std::numeric_limits<std::int32_t>::min();
      upper = std::numeric_limits<std::int32_t>::max();
      break;
    case Type::uint32:
      upper = std::numeric_limits<std::uint32_t>::max();
      break;
    case Type::float32:
      upper = std::numeric_limits<float>::max();
      lower = -upper;
      break;
  }
  const double a = how.scale * lower + how.offset;
  const double b = how.scale * upper + how.offset;
  return {std::min(a, b), std::max(a, b)};
}

}  // namespace invar::modbus

// RtpsMutator: RTPS messages as nobody sends them, made from some that somebody sent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <vector>

namespace invar::testing {

using RtpsCorpus = std::vector<std::vector<std::byte>>;

inline void write_corpus(const std::string& path, const RtpsCorpus& corpus) {
  std::ofstream file{path, std::ios::binary};
  for (const auto& message : corpus) {
    const auto size = static_cast<std::uint32_t>(message.size());
    file.write(reinterpret_cast<const char*>(&size), sizeof size);
    file.write(reinterpret_cast<const char*>(message.data()), size);
  }
}

inline RtpsCorpus read_corpus(const std::string& path) {
  std::ifstream file{path, std::ios::binary};
  RtpsCorpus corpus;
  std::uint32_t size = 0;
  while (file.read(reinterpret_cast<char*>(&size), sizeof size)) {
    corpus.emplace_back(size);
    file.read(reinterpret_cast<char*>(corpus.back().data()), size);
  }
  return corpus;
}

class RtpsMutator {
 public:
  RtpsMutator(RtpsCorpus corpus, std::uint32_t seed) : corpus_{std::move(corpus)}, dice_{seed} {}

  /// A message with one to three changes; valid until the next call.
  const std::vector<std::byte>& next() {
    message_ = any();
    for (std::size_t changes = 1 + below(3); changes > 0 && !message_.empty(); --changes) change();
    return message_;
  }

 private:
  std::size_t below(std::size_t bound) { return dice_() % bound; }
  const std::vector<std::byte>& any() { return corpus_[below(corpus_.size())]; }

  /// Where submessages begin.
  std::vector<std::size_t> heads(const std::vector<std::byte>& message) const {
    std::vector<std::size_t> out;
    for (std::size_t at = 20; at + 4 <= message.size();) {
      out.push_back(at);
      const std::size_t size =
          std::to_integer<std::size_t>(message[at + 2]) | std::to_integer<std::size_t>(message[at + 3]) << 8U;
      at += 4 + (size + 3) / 4 * 4;
    }
    return out;
  }
  void put(std::size_t at, std::uint32_t value, std::size_t size) {
    if (at + size <= message_.size()) std::memcpy(message_.data() + at, &value, size);
  }
  std::uint32_t odd_number() {
    constexpr std::array<std::uint32_t, 16> odd{0,       1,      2,          3,         4,      0x7f,
                                                0x80,    0xff,   0x100,      0x7fff,    0x8000, 0xffff,
                                                0x10000, 0xfffc, 0x7fffffff, 0xffffffff};
    return below(4) == 0 ? static_cast<std::uint32_t>(dice_()) : odd[below(odd.size())];
  }

  void change() {
    const auto starts = heads(message_);
    const std::size_t head = starts.empty() ? 0 : starts[below(starts.size())];
    const std::size_t anywhere = below(message_.size());
    switch (below(11)) {
      case 0:  // bits
        message_[anywhere] ^= static_cast<std::byte>(1U << below(8));
        break;
      case 1:  // an octet
        message_[anywhere] = static_cast<std::byte>(odd_number());
        break;
      case 2:  // a number
        put(anywhere & ~std::size_t{1}, odd_number(), 2);
        break;
      case 3:
        put(anywhere & ~std::size_t{3}, odd_number(), 4);
        break;
      case 4:  // a number of the fields that all submessages begin with
        put(head + 4 + 4 * below(12), odd_number(), 4);
        break;
      case 5:  // kind, flags or length of a submessage
        put(head + below(3), odd_number(), 1 + below(2));
        break;
      case 6:  // cut off
        message_.resize(below(message_.size() + 1));
        break;
      case 7: {  // submessages of another message, under this one's name
        const auto& other = any();
        const auto theirs = heads(other);
        if (theirs.empty() || message_.size() > 60'000) break;
        const std::size_t from = theirs[below(theirs.size())];
        message_.insert(message_.end(), other.begin() + static_cast<std::ptrdiff_t>(from), other.end());
        break;
      }
      case 8: {  // this message, under another's name
        const auto& other = any();
        if (message_.size() >= 20 && other.size() >= 20)
          std::memcpy(message_.data() + 8, other.data() + 8, 12);
        break;
      }
      case 9:  // for any reader
        put(head + 8, 0, 4);
        break;
      default: {  // what kills Fast DDS 2.9.1: statistics that are not the last
        std::vector<std::byte> statistics(60);
        statistics[0] = std::byte{0x80};
        statistics[2] = std::byte{56};
        if (head != 0)
          message_.insert(message_.begin() + static_cast<std::ptrdiff_t>(head), statistics.begin(),
                          statistics.end());
      }
    }
    if (message_.size() > 65'000) message_.resize(65'000);
  }

  RtpsCorpus corpus_;
  std::mt19937 dice_;
  std::vector<std::byte> message_;
};

}  // namespace invar::testing

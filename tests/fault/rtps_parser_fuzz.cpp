// A million broken RTPS messages through the parser of the filter, with the sanitizers on. Arguments: a corpus of messages that
// were really sent, how many to make of them, and optionally the seed.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "core/dds/rtps_message.hpp"
#include "core/dds/sequence_guard.hpp"
#include "tests/support/rtps_mutator.hpp"

int main(int count, char** words) {
  using namespace invar;
  if (count < 3) return 2;
  const auto corpus = testing::read_corpus(words[1]);
  const long runs = std::atol(words[2]);
  const auto seed = count > 3 ? static_cast<std::uint32_t>(std::atol(words[3])) : std::random_device{}();
  std::printf("seed %u, %zu messages\n", seed, corpus.size());
  if (corpus.empty()) return 1;
  const dds::RtpsLimits limits;
  dds::SequenceGuard guard;
  dds::RtpsContent content;
  for (const auto& message : corpus) {
    if (dds::examine(message, limits, guard, content) != dds::Flaw::none)
      return std::puts("a sound one is dropped"), 1;
    // The writers of the corpus are known, so that leaps are looked for.
    dds::GuidPrefix prefix;
    std::copy_n(message.begin() + 8, prefix.size(), prefix.begin());
    for (const std::uint32_t entity : {0x103U, 0x203U, 0x3c2U, 0x4c2U}) guard.know(prefix, entity);
  }
  testing::RtpsMutator mutator{corpus, seed};
  std::array<long, dds::flaws> found{};
  std::chrono::nanoseconds spent{};
  for (long run = 0; run < runs; ++run) {
    const auto& broken = mutator.next();
    // Exactly as long as the message, so that no octet behind it can be read unnoticed.
    const auto exact = std::make_unique<std::byte[]>(broken.size());
    std::copy(broken.begin(), broken.end(), exact.get());
    const auto begin = std::chrono::steady_clock::now();
    const auto flaw = dds::examine({exact.get(), broken.size()}, limits, guard, content);
    spent += std::chrono::steady_clock::now() - begin;
    if (flaw == dds::Flaw::none && (content.size > broken.size() || content.size < 20))
      return std::puts("a wrong size"), 1;
    ++found[static_cast<std::size_t>(flaw)];
  }
  std::printf("%ld messages, %.0f ns each\n", runs,
              static_cast<double>(spent.count()) / static_cast<double>(runs));
  for (std::size_t i = 0; i < found.size(); ++i)
    std::printf("%8ld %s\n", found[i], std::string{dds::flaw_text(static_cast<dds::Flaw>(i))}.c_str());
  // A fuzz in which one of the causes never comes up does not try it.
  for (const long number : found)
    if (number == 0) return std::puts("one cause was never met"), 1;
  return 0;
}

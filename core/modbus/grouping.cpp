#include "core/modbus/grouping.hpp"

#include <algorithm>
#include <utility>

namespace invar::modbus {

namespace {

/// Cost of covering the registers up to some point: requests first, then words.
using Cost = std::pair<unsigned, unsigned>;

void plan_kind(const RegisterMap& map, Kind kind, std::vector<ReadRequest>& plan) {
  std::vector<std::size_t> sorted;
  for (std::size_t i = 0; i < map.registers.size(); ++i)
    if (map.registers[i].kind == kind && map.registers[i].readable) sorted.push_back(i);
  if (sorted.empty()) return;
  const auto begin_of = [&](std::size_t k) -> unsigned { return map.registers[sorted[k]].address; };
  const auto end_of = [&](std::size_t k) { return begin_of(k) + map.registers[sorted[k]].width(); };
  std::stable_sort(sorted.begin(), sorted.end(), [&](std::size_t a, std::size_t b) {
    return map.registers[a].address < map.registers[b].address;
  });

  const unsigned limit = kind == Kind::coil || kind == Kind::discrete ? largest_bit_read : largest_word_read;
  // best[k]: the cheapest cover of the first k registers, whose last request begins at register first[k].
  std::vector<Cost> best(sorted.size() + 1);
  std::vector<std::size_t> first(sorted.size() + 1);
  for (std::size_t k = 1; k <= sorted.size(); ++k) {
    best[k] = {~0U, ~0U};
    const unsigned end = end_of(k - 1);
    for (std::size_t j = k; j-- > 0;) {
      const unsigned words = end - begin_of(j);
      if (words > limit) break;
      // Two bits of one word must not be parted: the second request would read the same word again.
      const bool parts_a_word = j > 0 && end_of(j - 1) > begin_of(j);
      const Cost cost{best[j].first + 1, best[j].second + words};
      if (!parts_a_word && cost < best[k]) {
        best[k] = cost;
        first[k] = j;
      }
      if (j > 0 && !map.gaps_readable && end_of(j - 1) < begin_of(j)) break;
    }
  }
  std::vector<ReadRequest> requests;
  for (std::size_t k = sorted.size(); k > 0; k = first[k]) {
    ReadRequest request;
    request.kind = kind;
    request.address = static_cast<std::uint16_t>(begin_of(first[k]));
    request.count = static_cast<std::uint16_t>(end_of(k - 1) - begin_of(first[k]));
    request.registers.assign(sorted.begin() + static_cast<std::ptrdiff_t>(first[k]),
                             sorted.begin() + static_cast<std::ptrdiff_t>(k));
    requests.push_back(std::move(request));
  }
  plan.insert(plan.end(), std::make_move_iterator(requests.rbegin()),
              std::make_move_iterator(requests.rend()));
}

}  // namespace

std::vector<ReadRequest> plan_reads(const RegisterMap& map) {
  std::vector<ReadRequest> plan;
  for (const Kind kind : {Kind::coil, Kind::discrete, Kind::input, Kind::holding}) plan_kind(map, kind, plan);
  return plan;
}

}  // namespace invar::modbus

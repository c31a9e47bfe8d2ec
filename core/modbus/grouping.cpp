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

  const unsigned limit = kind == Kind::coil || kind == Kind::discrete ? map.max_bits : map.max_registers;
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

std::vector<ReadRequest> parted(const RegisterMap& map, const ReadRequest& request) {
  const auto begin_of = [&](std::size_t k) -> unsigned {
    return map.registers[request.registers[k]].address;
  };
  const auto end_of = [&](std::size_t k) {
    return begin_of(k) + map.registers[request.registers[k]].width();
  };
  const unsigned middle = request.address + request.count / 2;
  std::size_t best = 0;
  std::pair<unsigned, unsigned> best_is{0, 0};  // the gap, then how near the middle
  for (std::size_t k = 1; k < request.registers.size(); ++k) {
    if (begin_of(k) < end_of(k - 1)) continue;  // bits of one word
    const unsigned off = begin_of(k) > middle ? begin_of(k) - middle : middle - begin_of(k);
    const std::pair<unsigned, unsigned> is{begin_of(k) - end_of(k - 1), request.count - off};
    if (best == 0 || is > best_is) best = k, best_is = is;
  }
  if (best == 0) return {request};
  const auto part = [&](std::size_t from, std::size_t to) {
    ReadRequest result;
    result.kind = request.kind;
    result.address = static_cast<std::uint16_t>(begin_of(from));
    result.count = static_cast<std::uint16_t>(end_of(to - 1) - begin_of(from));
    result.registers.assign(request.registers.begin() + static_cast<std::ptrdiff_t>(from),
                            request.registers.begin() + static_cast<std::ptrdiff_t>(to));
    return result;
  };
  return {part(0, best), part(best, request.registers.size())};
}

}  // namespace invar::modbus

#include "core/modbus/grouping.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <random>
#include <set>

namespace invar::modbus {
namespace {

Register at(unsigned address, Type type = Type::uint16, Kind kind = Kind::holding) {
  Register reg;
  reg.name = "r" + std::to_string(address);
  reg.address = static_cast<std::uint16_t>(address);
  reg.type = type;
  reg.kind = kind;
  return reg;
}

RegisterMap map_of(std::vector<Register> registers, bool gaps_readable) {
  RegisterMap map;
  map.registers = std::move(registers);
  map.gaps_readable = gaps_readable;
  return map;
}

struct Cost {
  unsigned requests = 0;
  unsigned words = 0;
  friend auto operator<=>(const Cost&, const Cost&) = default;
};

Cost cost_of(const std::vector<ReadRequest>& plan) {
  Cost cost;
  for (const auto& request : plan) {
    ++cost.requests;
    cost.words += request.count;
  }
  return cost;
}

/// Tries every way to cut the sorted registers into runs.
Cost cheapest(const std::vector<Register>& sorted, bool gaps_readable) {
  Cost best{~0U, ~0U};
  for (unsigned cuts = 0; cuts < 1U << (sorted.size() - 1); ++cuts) {
    Cost cost;
    bool valid = true;
    std::size_t first = 0;
    for (std::size_t i = 0; i < sorted.size(); ++i) {
      if (i + 1 < sorted.size() && (cuts >> i & 1U) == 0) {
        if (!gaps_readable && sorted[i].address + sorted[i].width() < sorted[i + 1].address) valid = false;
        continue;
      }
      const unsigned words = sorted[i].address + sorted[i].width() - sorted[first].address;
      valid = valid && words <= 125;
      cost.words += words;
      ++cost.requests;
      first = i + 1;
    }
    if (valid) best = std::min(best, cost);
  }
  return best;
}

TEST(Grouping, FindsTheCheapestPlanThatTryingAllFinds) {
  constexpr unsigned seed = 71;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random{seed};
  const auto below = [&](unsigned limit) { return static_cast<unsigned>(random() % limit); };
  for (int trial = 0; trial < 400; ++trial) {
    std::vector<Register> registers;
    unsigned address = below(50);
    const unsigned spread = 1 + below(90);
    const unsigned count = 1 + below(11);
    for (unsigned i = 0; i < count; ++i) {
      registers.push_back(at(address, below(2) == 0 ? Type::uint16 : Type::float32));
      address += registers.back().width() + (below(2) == 0 ? 0 : below(spread));
    }
    for (const bool gaps_readable : {false, true}) {
      auto shuffled = registers;
      std::shuffle(shuffled.begin(), shuffled.end(), random);
      EXPECT_EQ(cost_of(plan_reads(map_of(shuffled, gaps_readable))), cheapest(registers, gaps_readable))
          << "seed " << seed << " trial " << trial;
    }
  }
}

TEST(Grouping, ReadsEveryRegisterOnceAndWhole) {
  std::vector<Register> registers;
  for (unsigned i = 0; i < 300; ++i) registers.push_back(at(3 * i, Type::float32));
  const auto map = map_of(registers, true);
  std::multiset<std::size_t> seen;
  for (const auto& request : plan_reads(map)) {
    EXPECT_LE(request.count, 125);
    for (const std::size_t index : request.registers) {
      seen.insert(index);
      const Register& reg = map.registers[index];
      EXPECT_GE(reg.address, request.address);
      EXPECT_LE(reg.address + reg.width(), request.address + request.count);
    }
  }
  EXPECT_EQ(seen.size(), 300U);
  EXPECT_EQ(*seen.rbegin(), 299U);
}

TEST(Grouping, KeepsKindsApartAndSkipsWhatCannotBeRead) {
  auto write_only = at(1);
  write_only.readable = false;
  const auto plan = plan_reads(map_of({at(0), write_only, at(0, Type::boolean, Kind::coil),
                                       at(1999, Type::boolean, Kind::coil), at(0, Type::uint16, Kind::input)},
                                      true));
  ASSERT_EQ(plan.size(), 3U);
  EXPECT_EQ(plan[0].kind, Kind::coil);
  EXPECT_EQ(plan[0].count, 2000);
  EXPECT_EQ(plan[2].count, 1);
}

TEST(Grouping, ReadsAWordWithSeveralBitsOnce) {
  auto low = at(10, Type::boolean, Kind::input);
  auto high = low;
  low.bit = 0;
  high.bit = 15;
  const auto plan = plan_reads(map_of({high, low}, false));
  ASSERT_EQ(plan.size(), 1U);
  EXPECT_EQ(plan[0].count, 1);
  EXPECT_EQ(plan[0].registers.size(), 2U);
}

}  // namespace
}  // namespace invar::modbus

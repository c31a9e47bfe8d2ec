#include "core/diagnosis/evidence/foretold.hpp"

#include <array>
#include <cmath>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"

namespace invar::diagnosis {

namespace {

constexpr std::size_t quarters = 4;

/// The rows of a quarter alone, or all others.
Weighing rows_of_quarter(Weighing weighing, std::size_t quarter, bool inside) {
  for (auto& recording : weighing.present)
    for (auto& rows : recording)
      for (std::size_t i = 0; i < rows.size(); ++i)
        if ((i * quarters / rows.size() == quarter) != inside) rows[i] = false;
  return weighing;
}

}  // namespace

bool Foretold::is_plain() const {
  constexpr double seen = 0.3;  // a sixth of the RMS
  return quarters > 0 && share > seen && better + 1 >= quarters;
}

Foretold foretold(const Case& data, const Fit& with, const Fit& without) {
  if (data.windows.count > 0 || data.windows.anew > 0) return {};
  const auto near = simulate(data, with.model);
  const auto plain = weigh(data, near, false);
  std::vector<double> noise;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) noise.push_back(instrument_noise(data, near, o));
  std::array<std::array<double, 2>, quarters> left{};
  in_parallel(2 * quarters, [&](std::size_t k) {
    const auto quarter = k / 2;
    const auto& whole = k % 2 == 0 ? with : without;
    constexpr int steps = 4;
    const auto fitted =
        fit(data, rows_of_quarter(plain, quarter, false), whole.model, data.model, steps, &whole);
    const auto squares =
        squares_left(data, simulate(data, fitted.model), rows_of_quarter(plain, quarter, true));
    for (std::size_t o = 0; o < squares.size(); ++o)
      if (noise[o] > 0.0) left[quarter][k % 2] += squares[o].sum / (noise[o] * noise[o]);
  });
  Foretold all;
  double sum = 0.0, sum_without = 0.0;
  for (const auto& [one, other] : left) {
    if (!(other > 0.0)) continue;
    sum += one, sum_without += other, ++all.quarters;
    if (one < other) ++all.better;
  }
  all.share = sum_without > 0.0 ? 1.0 - sum / sum_without : 0.0;
  return all;
}

}  // namespace invar::diagnosis

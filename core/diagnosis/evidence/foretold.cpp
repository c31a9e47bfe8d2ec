#include "core/diagnosis/evidence/foretold.hpp"

#include <array>
#include <cmath>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

constexpr std::size_t quarters = 4;

/// Rows that a quarter keeps from a fit. Where states begin anew within a recording: the later half of every fourth stretch
/// that has states of its own, since these must be known from rows of the stretch itself.
std::vector<bool> kept_back(const physics::Record& inputs, std::size_t quarter) {
  const std::size_t rows = inputs.rows();
  std::vector<bool> kept(rows, false);
  if (inputs.restarts.empty()) {
    for (std::size_t i = 0; i < rows; ++i) kept[i] = i * quarters / rows == quarter;
    return kept;
  }
  std::size_t begin = 0;
  for (std::size_t stretch = 0; stretch <= inputs.restarts.size(); ++stretch) {
    const std::size_t end = stretch < inputs.restarts.size() ? inputs.restarts[stretch] : rows;
    if (stretch % quarters == quarter)
      for (std::size_t i = begin + (end - begin) / 2; i < end; ++i) kept[i] = true;
    begin = end;
  }
  return kept;
}

enum class Rows { kept_back, others };

/// The weighing of the rows that a quarter keeps back, or of all others.
Weighing rows_of_quarter(const Case& data, Weighing weighing, std::size_t quarter, Rows rows_of) {
  const bool inside = rows_of == Rows::kept_back;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto kept = kept_back(data.recordings[r].inputs, quarter);
    for (auto& rows : weighing.present[r])
      for (std::size_t i = 0; i < rows.size(); ++i)
        if (kept[i] != inside) rows[i] = false;
  }
  return weighing;
}

/// Are there stretches with states of their own, but too few to keep some of them back?
bool has_few_stretches(const Case& data) {
  std::size_t stretches = 0;
  for (const auto& recording : data.recordings)
    if (!recording.inputs.restarts.empty()) stretches += recording.inputs.restarts.size() + 1;
  return stretches > 0 && stretches < 2 * quarters;
}

}  // namespace

bool Foretold::is_plain() const {
  return quarters > 0 && share > thresholds::foretold_share && better + 1 >= quarters;
}

Foretold foretold(const Case& data, const Fit& with, const Fit& without) {
  if (has_few_stretches(data)) return {};
  const auto near = simulate(data, with.model);
  const auto plain = weigh(data, near, Colour::white);
  std::vector<double> noise;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) noise.push_back(instrument_noise(data, near, o));
  std::array<std::array<double, 2>, quarters> left{};
  in_parallel(2 * quarters, [&](std::size_t k) {
    const auto quarter = k / 2;
    const auto& whole = k % 2 == 0 ? with : without;
    const auto fitted = fit(data, rows_of_quarter(data, plain, quarter, Rows::others), whole.model,
                            data.model, Effort::follow(4), &whole);
    const auto squares = squares_left(data, simulate(data, fitted.model),
                                      rows_of_quarter(data, plain, quarter, Rows::kept_back));
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

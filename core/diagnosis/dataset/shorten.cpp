#include "core/diagnosis/dataset/shorten.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/diagnosis/dataset/statistics.hpp"

namespace invar::diagnosis {

namespace {

using physics::Record;

Record cut(const Record& record, std::size_t begin, std::size_t rows) {
  const auto part = [&](const std::vector<double>& values) {
    const auto first = values.begin() + static_cast<std::ptrdiff_t>(begin);
    return std::vector<double>{first, first + static_cast<std::ptrdiff_t>(rows)};
  };
  Record out;
  out.time = part(record.time);
  for (const auto& [name, values] : record.signals) out.signals[name] = part(values);
  return out;
}

Record one_in(const Record& record, std::size_t every) {
  const auto thinned = [every](const std::vector<double>& values) {
    std::vector<double> kept;
    for (std::size_t i = 0; i < values.size(); i += every) kept.push_back(values[i]);
    return kept;
  };
  Record out;
  out.time = thinned(record.time);
  for (const auto& [name, values] : record.signals) out.signals[name] = thinned(values);
  return out;
}

/// Inputs as what arrives in a span, outputs as the mean about its beginning; cells without a number do not count.
Record means_over(const Record& record, std::size_t every, const std::vector<std::string>& outputs) {
  Record out = one_in(record, every);
  for (auto& [name, means] : out.signals) {
    const auto& values = record.signals.at(name);
    const bool is_output = std::find(outputs.begin(), outputs.end(), name) != outputs.end();
    for (std::size_t k = 0; k < means.size(); ++k) {
      const std::size_t at = k * every, half = is_output ? every / 2 : 0;
      const std::size_t reach = std::min(half, at);  // about the first row there is only the row itself
      const std::size_t first = at - reach,
                        last = std::min(values.size(), is_output ? at + reach + 1 : at + every);
      double sum = 0.0, n = 0.0;
      for (std::size_t i = first; i < last; ++i)
        if (std::isfinite(values[i])) sum += values[i], n += 1.0;
      means[k] = n > 0.0 ? sum / n : std::numeric_limits<double>::quiet_NaN();
    }
  }
  return out;
}

/// Rows after which a loop no longer remembers how it came to where a stretch begins.
constexpr std::size_t until_forgotten = 300;

/// The row in [first, last) at which `place` has moved least over the rows before.
std::size_t stillest(const std::vector<double>& place, std::size_t first, std::size_t last) {
  constexpr std::size_t before = 50;
  std::size_t best = first;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = std::max(first, before); i < last; ++i) {
    const double moved = std::abs(place[i] - place[i - before]) + std::abs(place[i] - place[i - before / 2]);
    if (moved < least) least = moved, best = i;
  }
  return best;
}

}  // namespace

namespace {

/// Rows behind a gap in which a heater was switched: that heat came in nobody knows when, and the nodes keep it for long.
std::vector<std::size_t> switched_in_gaps(const physics::Model& model, const Record& record) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < record.rows(); ++i) steps.push_back(record.time[i] - record.time[i - 1]);
  const double gap = 2.5 * median(steps);
  std::vector<std::size_t> rows;
  for (std::size_t i = 1; i < record.rows(); ++i) {
    if (!(steps[i - 1] > gap)) continue;
    if (std::any_of(model.thermal.heaters.begin(), model.thermal.heaters.end(), [&](const auto& heater) {
          const auto& power = record.signals.at(heater.name);
          return std::abs(power[i] - power[i - 1]) >
                 0.02 * std::max(std::abs(power[i]), std::abs(power[i - 1]));
        }))
      rows.push_back(i);
  }
  return rows;
}

}  // namespace

std::vector<Stretch> without_pauses(const physics::Model& model, Record record) {
  std::vector<Stretch> out;
  constexpr double longest_bridge = 10000.0;                 // ticks
  const bool heat = model.plant == physics::Plant::thermal;  // begins anew with what its nodes show
  const std::size_t forget = heat ? 0 : until_forgotten, least_rows = heat ? 100 : 2 * until_forgotten;
  std::vector<std::size_t> begins{0};
  if (model.plant == physics::Plant::axis && model.controller)
    for (std::size_t i = 1; i < record.rows(); ++i)
      if ((record.time[i] - record.time[i - 1]) * model.controller->rate > longest_bridge)
        begins.push_back(i);
  if (heat)
    for (const std::size_t row : switched_in_gaps(model, record)) begins.push_back(row);
  begins.push_back(record.rows());
  std::size_t longest = 0;
  const auto rows_of = [&](std::size_t part) { return begins[part + 1] - begins[part]; };
  for (std::size_t k = 1; k + 1 < begins.size(); ++k)
    if (rows_of(k) > rows_of(longest)) longest = k;
  if (begins.size() == 2) {
    out.push_back({std::move(record), 0});
    return out;
  }
  for (std::size_t k = 0; k + 1 < begins.size(); ++k)
    if (k == longest || rows_of(k) >= least_rows)
      out.push_back({cut(record, begins[k], rows_of(k)), k > 0 ? forget : 0});
  return out;
}

std::string how_shortened(const physics::Model& model) {
  using physics::Plant;
  switch (model.plant) {
    case Plant::thermal:
      return "means over equal spans are";
    case Plant::error_map:
    case Plant::droplet:
      return "rows at equal steps are";
    case Plant::equations:
      return "its beginning is";
    case Plant::axis:
      return "stretches spread over it, each from where the axis stands, are";
    case Plant::sensor:
      break;
  }
  return "stretches spread over it are";
}

std::vector<Stretch> shortened(const physics::Model& model, Record record, std::size_t most) {
  using physics::Plant;
  const std::size_t rows = record.rows();
  std::vector<Stretch> out;
  if (rows <= most) {
    out.push_back({std::move(record), 0});
    return out;
  }
  const std::size_t every = (rows + most - 1) / most;
  switch (model.plant) {
    case Plant::thermal:
      out.push_back({means_over(record, every, model.outputs()), 0});
      return out;
    case Plant::error_map:
    case Plant::droplet:
      out.push_back({one_in(record, every), 0});
      return out;
    case Plant::equations:
      out.push_back({cut(record, 0, most), 0});
      return out;
    case Plant::axis:
    case Plant::sensor:
      break;
  }
  constexpr std::size_t stretches = 5;
  const std::size_t part = rows / stretches, length = std::min(part / 2, most / stretches);
  const auto* place = record.find(record.find("reference") != nullptr ? "reference" : "position");
  for (std::size_t s = 0; s < stretches; ++s) {
    std::size_t begin = s * part;
    if (s > 0 && place != nullptr) begin = stillest(*place, begin, begin + part - length);
    out.push_back({cut(record, begin, length), begin > 0 && model.controller ? until_forgotten : 0});
  }
  return out;
}

}  // namespace invar::diagnosis

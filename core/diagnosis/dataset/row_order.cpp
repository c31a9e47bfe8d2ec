#include "core/diagnosis/dataset/row_order.hpp"
#include "core/diagnosis/dataset/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace invar::diagnosis {

void put_in_order(physics::Record& record, DataCount& count) {
  const auto& time = record.time;
  std::vector<std::size_t> order;
  order.reserve(time.size());
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (std::isfinite(time[i]))
      order.push_back(i);
    else
      ++count.missing;
  }
  std::size_t out_of_order = 0;
  for (std::size_t i = 1; i < order.size(); ++i)
    if (time[order[i]] < time[order[i - 1]]) ++out_of_order;
  if (out_of_order > 0)
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return time[a] < time[b]; });
  count.out_of_order += out_of_order;
  const auto twice =
      std::unique(order.begin(), order.end(), [&](auto a, auto b) { return time[a] >= time[b]; });
  count.duplicates += static_cast<std::size_t>(order.end() - twice);
  order.erase(twice, order.end());
  std::vector<double> column;
  const auto reorder = [&](std::vector<double>& values) {
    column.clear();
    for (const auto i : order) column.push_back(values[i]);
    column.swap(values);
  };
  for (auto& [name, values] : record.signals) reorder(values);
  reorder(record.time);  // last: the order is by it
}

namespace {

/// How many rows on a reading has usually moved by no more than a small part of the way that it goes: forty rows of a swing.
std::size_t rows_alike(const std::vector<double>& values) {
  constexpr double small = 0.05;
  std::vector<double> known, steps;
  for (const double v : values)
    if (std::isfinite(v)) known.push_back(v);
  if (known.size() < 8) return values.size();  // a start value
  const auto [low, high] = std::minmax_element(known.begin(), known.end());
  const double bears = small * (*high - *low);
  std::size_t alike = 1;
  for (std::size_t every = 2; every < known.size() / 8; ++every) {
    steps.clear();
    for (std::size_t i = every; i < known.size(); i += every)
      steps.push_back(std::abs(known[i] - known[i - every]));
    if (!(median(steps) <= bears)) break;
    alike = every;
  }
  return alike;
}

}  // namespace

void thin(physics::Record& record, const std::vector<std::string>& outputs, std::size_t files) {
  constexpr std::size_t most = 6000;
  const auto parted = [&](std::size_t rows) { return (rows + most - 1) / most; };
  std::size_t alike = record.rows();
  for (const auto& output : outputs)
    if (const auto* values = record.find(output); values != nullptr && files > 1)
      alike = std::min(alike, rows_alike(*values));
  const std::size_t every =
      std::max(parted(record.rows()), files > 1 ? std::min(alike, parted(files * record.rows())) : 1);
  if (every < 2) return;
  const auto thinned = [every](std::vector<double>& values) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < values.size(); i += every) values[kept++] = values[i];
    values.resize(kept);
  };
  thinned(record.time);
  for (auto& [name, values] : record.signals) thinned(values);
}

}  // namespace invar::diagnosis

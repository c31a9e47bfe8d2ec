#include "core/diagnosis/dataset/even_rows.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/base/quantity.hpp"
#include "core/diagnosis/dataset/statistics.hpp"

namespace invar::diagnosis {

namespace {

struct Even {
  std::vector<double> time;
  double step = 0.0, scatter = 0.0;  // [s], of the stamps: root mean square
};

/// The usual step between stamps, also where many rows are lost: the median of those that are no two.
double usual_step(const std::vector<double>& time) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.size(); ++i) steps.push_back(time[i] - time[i - 1]);
  double usual = median(steps);
  for (int again = 0; again < 20; ++again) {
    std::vector<double> single;
    for (const double step : steps)
      if (step < 1.5 * usual) single.push_back(step);
    const double was = std::exchange(usual, median(single));
    if (usual == was) break;
  }
  return usual;
}

/// The even steps nearest to the stamps of a stretch without a gap; nothing where there are none.
std::optional<Even> even_steps_of(const std::vector<double>& time, double step) {
  constexpr double most_off = 0.5, follows = 0.05;
  Even even;
  std::vector<double> number(time.size(), 0.0);
  // Numbered along steps that follow the stamps slowly; then time over the number by least squares, and again with that step.
  double begin = 0.0;
  for (int again = 0; again < 3; ++again) {
    std::vector<double> first;
    for (std::size_t i = 0; i < std::min<std::size_t>(20, time.size()); ++i) {
      const double count = std::round((time[i] - time.front()) / step);
      first.push_back(time[i] - count * step);
    }
    double at = median(first), k = 0.0, sum_k = 0.0, sum_t = 0.0, sum_kk = 0.0, sum_kt = 0.0;
    for (std::size_t i = 0; i < time.size(); ++i) {
      if (i > 0) {
        const double count = std::max(1.0, std::round((time[i] - at) / step));
        k += count, at += count * step;
        at += follows * (time[i] - at);
      }
      number[i] = k;
      const double t = time[i] - time.front();
      sum_k += k, sum_t += t, sum_kk += k * k, sum_kt += k * t;
    }
    const double n = static_cast<double>(time.size());
    step = (n * sum_kt - sum_k * sum_t) / (n * sum_kk - sum_k * sum_k);
    begin = time.front() + (sum_t - step * sum_k) / n;
  }
  double squares = 0.0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    even.time.push_back(begin + step * number[i]);
    const double off = time[i] - even.time.back();
    squares += off * off;
    if (std::abs(off) > most_off * step) return std::nullopt;  // a clock that wanders, or none
  }
  even.step = step;
  even.scatter = std::sqrt(squares / static_cast<double>(time.size()));
  return even;
}

/// The same stretch by stretch: behind a gap a recorder begins anew. Nothing where the stamps are even already.
std::optional<Even> even_steps(const std::vector<double>& time) {
  constexpr double trifle = 2e-3, gap = 8.5;  // steps
  constexpr std::size_t enough = 50;
  const double usual = usual_step(time);
  Even even;
  double squares = 0.0;
  for (std::size_t from = 0; from < time.size();) {
    std::size_t to = from + 1;
    while (to < time.size() && time[to] - time[to - 1] < gap * usual) ++to;
    if (to - from < enough) return std::nullopt;
    const auto stretch = even_steps_of(
        {time.begin() + static_cast<std::ptrdiff_t>(from), time.begin() + static_cast<std::ptrdiff_t>(to)},
        usual);
    if (!stretch) return std::nullopt;
    even.time.insert(even.time.end(), stretch->time.begin(), stretch->time.end());
    even.step = stretch->step;
    squares += stretch->scatter * stretch->scatter * static_cast<double>(to - from);
    from = to;
  }
  even.scatter = std::sqrt(squares / static_cast<double>(time.size()));
  return even.scatter > trifle * even.step ? std::optional{even} : std::nullopt;
}

/// How far each row lies from the cubic through two on each side; NaN where one of them was not read.
std::vector<double> roughness(const std::vector<double>& time, const std::vector<double>& values) {
  std::vector<double> off(values.size(), std::nan(""));
  for (std::size_t i = 2; i + 2 < values.size(); ++i) {
    const std::size_t around[] = {i - 2, i - 1, i + 1, i + 2};
    double cubic = 0.0;
    for (const std::size_t a : around) {
      double weight = 1.0;
      for (const std::size_t b : around)
        if (a != b) weight *= (time[i] - time[b]) / (time[a] - time[b]);
      cubic += weight * values[a];
    }
    off[i] = std::abs(values[i] - cubic);
  }
  return off;
}

/// How rough the even steps leave an output beside the stamps, in the quarter of the rows where it moves the fastest; 1 where
/// nothing tells.
double rougher(const Even& even, const std::vector<double>& time, const std::vector<double>& values) {
  constexpr std::size_t enough = 50;
  const auto by_stamps = roughness(time, values), by_steps = roughness(even.time, values);
  std::vector<std::pair<double, std::size_t>> moving;
  for (std::size_t i = 2; i + 2 < values.size(); ++i)
    if (std::isfinite(by_stamps[i])) moving.emplace_back(std::abs(values[i + 1] - values[i - 1]), i);
  if (moving.size() < 4 * enough) return 1.0;
  std::sort(moving.rbegin(), moving.rend());
  moving.resize(moving.size() / 4);
  std::vector<double> stamps, steps;
  for (const auto& [speed, i] : moving) stamps.push_back(by_stamps[i]), steps.push_back(by_steps[i]);
  const double before = median(stamps);
  return before > 0.0 ? median(steps) / before : 1.0;
}

}  // namespace

void even_out(const physics::Model& model, physics::Record& record, const std::string& file,
              std::vector<std::string>& doubts) {
  using physics::Plant;
  if (model.plant == Plant::error_map || model.plant == Plant::droplet || model.controller ||
      record.rows() < 8)
    return;
  const auto even = even_steps(record.time);
  if (!even) return;
  constexpr double far_smoother = 0.6;
  bool any = false;
  for (const auto& signal : model.signals) {
    const auto* values = signal.is_output ? record.find(signal.name) : nullptr;
    if (values == nullptr) continue;
    const double ratio = rougher(*even, record.time, *values);
    if (ratio > 1.0 / far_smoother) return;
    any = any || ratio < far_smoother;
  }
  if (!any) return;
  doubts.push_back(file + ": column `" + model.signal("time")->column + "` scatters by " +
                   si(even->scatter, "s", 2) + " about even steps of " + si(even->step, "s", 4) +
                   ", what was read does not: the rows are put onto these steps");
  record.time = even->time;
}

}  // namespace invar::diagnosis

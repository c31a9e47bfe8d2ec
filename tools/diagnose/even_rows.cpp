#include "tools/diagnose/even_rows.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "tools/diagnose/statistics.hpp"
#include "tools/report/page.hpp"

namespace invar::diagnose {

namespace {

struct Even {
  std::vector<double> time;
  double step = 0.0, scatter = 0.0;  // [s], of the stamps: root mean square
};

/// The even steps nearest to these stamps; nothing where there are none, or none but these.
std::optional<Even> even_steps(const std::vector<double>& time) {
  constexpr double most_off = 0.45, trifle = 2e-3;  // of a step
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.size(); ++i) steps.push_back(time[i] - time[i - 1]);
  const double usual = median(steps);
  // Time over the number of the step, by least squares.
  double k = 0.0, sum_k = 0.0, sum_t = 0.0, sum_kk = 0.0, sum_kt = 0.0, off = 0.0;
  std::vector<double> number{0.0};
  const double n = static_cast<double>(time.size());
  for (const double step : steps) {
    const double count = std::max(1.0, std::round(step / usual));
    off += std::abs(step / usual - count) > most_off ? 1.0 : 0.0;
    number.push_back(k += count);
  }
  constexpr double some = 0.01;  // of the rows
  if (off > some * n) return std::nullopt;
  for (std::size_t i = 0; i < time.size(); ++i) {
    const double t = time[i] - time.front();
    sum_k += number[i], sum_t += t, sum_kk += number[i] * number[i], sum_kt += number[i] * t;
  }
  Even even;
  even.step = (n * sum_kt - sum_k * sum_t) / (n * sum_kk - sum_k * sum_k);
  const double begin = time.front() + (sum_t - even.step * sum_k) / n;
  double squares = 0.0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    even.time.push_back(begin + even.step * number[i]);
    squares += std::pow(time[i] - even.time.back(), 2);
    if (std::abs(time[i] - even.time.back()) > 0.5 * even.step) return std::nullopt;  // a clock that wanders
  }
  even.scatter = std::sqrt(squares / n);
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
                   report::si(even->scatter, "s", 2) + " about even steps of " +
                   report::si(even->step, "s", 4) +
                   ", what was read does not: the rows are put onto these steps");
  record.time = even->time;
}

}  // namespace invar::diagnose

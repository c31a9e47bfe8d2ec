#include "core/diagnosis/locate/fine_periods.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <sstream>

#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/segments/windows.hpp"

namespace invar::diagnosis {

namespace {

using Series = std::vector<double>;

Series steps_of(const Series& values) {
  Series steps(values.size(), 0.0);
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double step = values[i] - values[i - 1];
    steps[i] = std::isfinite(step) ? step : 0.0;
  }
  return steps;
}

/// How each output changes from row to row after the rate of `state` was pushed from one row to the next.
std::vector<Series> answer_of(const Recording& recording, const physics::Model& fitted,
                              const std::string& state, double push, std::size_t row, std::size_t rows) {
  const auto& time = recording.inputs.time;
  auto pushed = fitted;
  for (auto& one : pushed.equations.states)
    if (one.name == state) {
      std::ostringstream by;
      by.precision(17);
      by << "(" << one.derivative << ") + if(t < " << time[row] << ", 0, if(t < " << time[row + 1] << ", "
         << push << ", 0))";
      one.derivative = by.str();
    }
  physics::Outputs at, moved;
  physics::prepare(fitted, recording.inputs)->run(fitted, at);
  physics::prepare(pushed, recording.inputs)->run(pushed, moved);
  std::vector<Series> answer(at.size(), Series(rows, 0.0));
  for (std::size_t o = 0; o < at.size(); ++o)
    for (std::size_t k = 0; k < rows; ++k) answer[o][k] = (moved[o][row + k] - at[o][row + k]) / push;
  return answer;
}

/// Where `over` was: as measured, else as modelled.
Series place_of(const Case& data, const physics::Model& fitted, const std::string& over, std::size_t r) {
  const auto& recording = data.recordings[r];
  const auto& equations = data.model.equations;
  for (std::size_t o = 0; o < equations.outputs.size(); ++o)
    if (equations.outputs[o].expression == over)
      return physics::bridged(recording.inputs.time, recording.measured[o]);
  const auto shown = showing_states(fitted);
  physics::Outputs states;
  physics::prepare(shown, recording.inputs)->run(shown, states);
  for (std::size_t i = 0; i < equations.states.size(); ++i)
    if (equations.states[i].name == over) return states[i];
  return {};
}

}  // namespace

std::vector<std::vector<double>> rate_asked_for(const Case& data, const physics::Model& fitted,
                                                const std::string& state, double push) {
  constexpr std::size_t longest = 200, shortest = 10, fewest = 200;  // rows
  std::vector<Series> asked;
  for (const auto& recording : data.recordings) {
    auto& rate = asked.emplace_back();
    const std::size_t n = recording.inputs.rows();
    if (n < fewest) continue;
    // From a beginning of states of its own, where there are some: the answer must not be cut.
    const auto& restarts = recording.inputs.restarts;
    std::size_t row = n / 4, end = n;
    for (std::size_t k = 0; k < restarts.size(); ++k)
      if (restarts[k] <= n / 2) row = restarts[k], end = k + 1 < restarts.size() ? restarts[k + 1] : n;
    const std::size_t rows = std::min(longest, end - row - 1);
    if (rows < shortest) continue;
    const auto answer = answer_of(recording, fitted, state, push, row, rows);
    physics::Outputs simulated;
    recording.simulation->run(fitted, simulated);
    rate.assign(n, 0.0);
    for (std::size_t o = 0; o < answer.size(); ++o) {
      Series left = recording.measured[o];
      for (std::size_t i = 0; i < n; ++i) left[i] -= simulated[o][i];
      left = steps_of(left);
      const double noise = std::max(1e-300, robust_sigma(left));
      for (double& v : left) v = std::clamp(v / noise, -5.0, 5.0) / noise;
      const auto step = steps_of(answer[o]);
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = 1; k < std::min(rows, n - i); ++k) rate[i] += step[k] * left[i + k];
    }
  }
  return asked;
}

std::vector<double> fine_periods(const Case& data, const physics::Model& fitted,
                                 const std::vector<std::vector<double>>& asked, const std::string& over,
                                 std::size_t most) {
  constexpr double fine = 0.25, coarsest = 6.0;  // waves over the whole way
  double low = 1e300, high = -1e300, way = 0.0;
  std::vector<Series> places(data.recordings.size());
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    if (asked[r].empty()) continue;
    places[r] = place_of(data, fitted, over, r);
    for (std::size_t i = 0; i < places[r].size(); ++i) {
      const double x = places[r][i];
      if (!std::isfinite(x)) continue;
      low = std::min(low, x), high = std::max(high, x);
      if (i > 0 && std::isfinite(places[r][i - 1])) way = std::max(way, std::abs(x - places[r][i - 1]));
    }
  }
  if (!(high > low) || !(way > 0.0)) return {};
  // Between two rows at most a third of a wave.
  const double finest = std::min(200.0, (high - low) / (3.0 * way));
  if (finest < coarsest + 2.0) return {};
  const auto cells = static_cast<std::size_t>(8.0 * finest);
  Series sum(cells, 0.0);
  for (std::size_t r = 0; r < places.size(); ++r)
    for (std::size_t i = 0; i < places[r].size(); ++i)
      if (std::isfinite(places[r][i]) && std::isfinite(asked[r][i]))
        sum[std::min(cells - 1, static_cast<std::size_t>((places[r][i] - low) / (high - low) *
                                                         static_cast<double>(cells)))] += asked[r][i];
  Series power;
  for (double k = coarsest; k <= finest; k += fine) {
    const auto turn = std::polar(1.0, 2.0 * std::numbers::pi * k / static_cast<double>(cells));
    std::complex<double> at{1.0, 0.0}, all;
    for (const double s : sum) all += s * at, at *= turn;
    power.push_back(std::norm(all));
  }
  // A wave stands out of those beside it.
  std::vector<std::pair<double, double>> peaks;
  constexpr std::size_t about = 40;
  for (std::size_t i = 1; i + 1 < power.size(); ++i) {
    if (!(power[i] > power[i - 1] && power[i] >= power[i + 1])) continue;
    const auto from = i - std::min(i, about), to = std::min(power.size(), i + about + 1);
    const double usual = median(Series{power.begin() + static_cast<std::ptrdiff_t>(from),
                                       power.begin() + static_cast<std::ptrdiff_t>(to)});
    if (const double stands_out = power[i] / std::max(usual, 1e-300); stands_out > 12.0)
      peaks.emplace_back(stands_out, (high - low) / (coarsest + fine * static_cast<double>(i)));
  }
  std::sort(peaks.rbegin(), peaks.rend());
  std::vector<double> periods;
  for (std::size_t i = 0; i < std::min(most, peaks.size()); ++i) periods.push_back(peaks[i].second);
  return periods;
}

}  // namespace invar::diagnosis

#include "core/diagnosis/estimate/instrument_noise.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/dataset/statistics.hpp"

namespace invar::diagnosis {

using Series = std::vector<double>;

double counting_step(const Series& values) {
  double low = 1e300, high = -1e300, least = 1e300;
  for (const double v : values)
    if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  constexpr double rounding = 1e-9;  // of the range: decimal steps are not exact in binary
  for (std::size_t i = 1; i < values.size(); ++i)
    if (const double step = std::abs(values[i] - values[i - 1]); step > rounding * (high - low))
      least = std::min(least, step);
  return least < 1e300 ? least : 0.0;
}

namespace {

/// The signal that says when a machine rests; empty where none does: heat and levels go on by themselves.
std::string driven_by(const Case& data) {
  if (data.model.plant == physics::Plant::axis) return "reference";
  if (data.model.plant == physics::Plant::sensor) return "true_position";
  return "";
}

/// The spread of a reading within short pieces of rests, of the quieter quarter of these: a disturbance that acts at rest too
/// acts in some of them. 0: there are none.
double spread_at_rest(const Case& data, std::size_t output) {
  constexpr std::size_t piece = 50, settling = 100;  // rows
  const auto driving = driven_by(data);
  Series spreads;
  for (const auto& recording : data.recordings) {
    const auto* input = driving.empty() ? nullptr : recording.inputs.find(driving);
    if (input == nullptr) continue;
    std::size_t still = 0;  // rows since it last moved
    Series some;
    for (std::size_t i = 1; i < input->size(); ++i) {
      still = (*input)[i] == (*input)[i - 1] ? still + 1 : 0;
      if (still < settling) some.clear();
      if (still < settling) continue;
      some.push_back(recording.measured[output][i]);
      if (some.size() < piece) continue;
      if (const double spread = robust_sigma(some); spread > 0.0) spreads.push_back(spread);
      some.clear();
    }
  }
  if (spreads.empty()) return 0.0;
  std::sort(spreads.begin(), spreads.end());
  return spreads[spreads.size() / 4];
}

}  // namespace

double instrument_noise(const Case& data, const std::vector<physics::Outputs>& simulated,
                        std::size_t output) {
  if (std::isfinite(data.given_noise[output])) return data.given_noise[output];
  Series read, left;
  double step = 1e300;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto& measured = data.recordings[r].measured[output];
    step = std::min(step, counting_step(measured));
    for (std::size_t i = 0; i < measured.size(); ++i) {
      read.push_back(measured[i]);
      left.push_back(measured[i] - simulated[r][output][i]);
    }
    read.push_back(std::nan(""));  // rows of two recordings are no neighbours
    left.push_back(std::nan(""));
  }
  const double rounding = step < 1e300 ? step / std::sqrt(12.0) : 0.0;
  const double apart = std::fmin(spread_of_differences(read), spread_of_differences(left));
  return std::max({apart, rounding, spread_at_rest(data, output)});
}

double squares_in_noise(const Case& data, const Fit& fit, const Fit& best) {
  const auto near = simulate(data, best.model), simulated = simulate(data, fit.model);
  const auto left = squares_left(data, simulated, weigh(data, simulated, Colour::white));
  double sum = 0.0;
  for (std::size_t o = 0; o < left.size(); ++o)
    if (const double noise = instrument_noise(data, near, o); noise > 0.0)
      sum += std::pow(left[o].rms() / noise, 2);
  return sum;
}

bool leaves_less(const Case& data, const Fit& one, const Fit& other) {
  return squares_in_noise(data, one, other) < squares_in_noise(data, other, other);
}

}  // namespace invar::diagnosis

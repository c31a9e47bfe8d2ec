#include "tools/diagnose/axis_modes.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "tools/diagnose/carried_back.hpp"

namespace invar::diagnose {

namespace {

/// What a recording says of a push whose spectrum is known: how much of it shows, and how much of it is in the residual.
struct Heard {
  double hertz = 0.0;               // a bin
  Spectrum acceleration, velocity;  // of the carriage
  Spectrum back;                    // the residual, carried back
  std::vector<double> answer;       // power of the answer to a push
};

Heard heard(const Case& data, const Fit& fitted, const std::vector<std::vector<double>>& responses,
            std::size_t recording, const std::vector<double>& position) {
  const auto& time = data.recordings[recording].inputs.time;
  const std::size_t rows = position.size(), size = power_of_two(2 * rows);
  const double period = (time.back() - time.front()) / static_cast<double>(rows - 1);
  std::vector<double> speed(rows, 0.0), gained(rows, 0.0);
  for (std::size_t i = 1; i + 1 < rows; ++i) {
    speed[i] = (position[i + 1] - position[i - 1]) / (2.0 * period);
    gained[i] = (position[i + 1] - 2.0 * position[i] + position[i - 1]) / (period * period);
  }
  Heard all;
  all.hertz = 1.0 / (static_cast<double>(size) * period);
  all.acceleration = transform(std::move(gained), size);
  all.velocity = transform(std::move(speed), size);
  all.back = transform(carried_back(data, fitted, responses, recording), size);
  all.answer.assign(size / 2, 0.0);
  for (const auto& response : responses) {
    auto pulse = response;
    pulse.resize(std::min(pulse.size(), size));
    const auto one = transform(std::move(pulse), size);
    for (std::size_t k = 0; k < all.answer.size(); ++k) all.answer[k] += std::norm(one[k]);
  }
  return all;
}

/// Twice the log likelihood that a mode would win, its carriage's mass and damping fitted with it.
double gain_of_mode(const std::vector<Heard>& recordings, double frequency, double damping_ratio) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d slope = Eigen::Vector3d::Zero();
  for (const auto& r : recordings) {
    const double both_halves = 1.0 / static_cast<double>(r.answer.size());
    for (std::size_t k = 1; k < r.answer.size(); ++k) {
      const double ratio = static_cast<double>(k) * r.hertz / frequency;
      const Complex swings = -ratio * ratio / Complex{1.0 - ratio * ratio, 2.0 * damping_ratio * ratio};
      const std::array<Complex, 3> push{r.acceleration[k] * swings, r.acceleration[k], r.velocity[k]};
      for (int i = 0; i < 3; ++i) {
        const auto& one = push[static_cast<std::size_t>(i)];
        slope(i) += both_halves * (std::conj(one) * r.back[k]).real();
        for (int j = i; j < 3; ++j)
          normal(i, j) +=
              both_halves * (std::conj(one) * push[static_cast<std::size_t>(j)]).real() * r.answer[k];
      }
    }
  }
  normal = Eigen::Matrix3d{normal.selfadjointView<Eigen::Upper>()};
  const Eigen::Matrix2d rigid = normal.bottomRightCorner<2, 2>();
  const Eigen::Vector2d beside = rigid.ldlt().solve(normal.bottomLeftCorner<2, 1>());
  const double shows = normal(0, 0) - normal.topRightCorner<1, 2>().dot(beside);
  const double wins = slope(0) - slope.tail<2>().dot(beside);
  const bool pushes_back = wins <= 0.0 || !(shows > 1e-9 * normal(0, 0));  // no mass is negative
  return pushes_back ? 0.0 : wins * wins / shows;
}

}  // namespace

std::vector<double> mode_frequencies(const Case& data, const Weighing& weighing, const Fit& fitted) {
  const auto at = std::find(data.outputs.begin(), data.outputs.end(), "position");
  if (at == data.outputs.end()) return {};
  const auto responses = pulse_responses(data, weighing, fitted.model, "force", 1e-2);
  const auto simulated = simulate(data, fitted.model);
  std::vector<Heard> recordings;
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    recordings.push_back(
        heard(data, fitted, responses, r, simulated[r][static_cast<std::size_t>(at - data.outputs.begin())]));
  std::vector<double> frequencies, gains;
  for (double f = 4.0; f < 350.0; f *= 1.03) {
    frequencies.push_back(f);
    gains.push_back(std::max(gain_of_mode(recordings, f, 0.01), gain_of_mode(recordings, f, 0.05)));
  }
  std::vector<std::pair<double, double>> tops;
  for (std::size_t k = 1; k + 1 < gains.size(); ++k)
    if (gains[k] > 0.0 && gains[k] >= gains[k - 1] && gains[k] > gains[k + 1])
      tops.emplace_back(gains[k], frequencies[k]);
  std::sort(tops.rbegin(), tops.rend());
  constexpr std::size_t most = 4;
  if (tops.size() > most) tops.resize(most);
  std::vector<double> likeliest;
  for (const auto& [gain, frequency] : tops) likeliest.push_back(frequency);
  return likeliest;
}

}  // namespace invar::diagnose

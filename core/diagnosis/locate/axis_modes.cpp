#include "core/diagnosis/locate/axis_modes.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/diagnosis/locate/carried_back.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::diagnosis {

namespace {

/// Neighbouring frequencies, too near for a mode to tell them apart: what the carriage's acceleration there has in common
/// with the residual carried back, with itself and with its velocity, each as far as a push shows.
struct Cell {
  double hertz = 0.0;
  Complex with_back, with_velocity;
  double power = 0.0;
};

struct Heard {
  std::vector<Cell> cells;
  Eigen::Matrix2d rigid = Eigen::Matrix2d::Zero();  // of the carriage's mass and its damping
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

void hear(Heard& all, const std::vector<double>& time, const std::vector<double>& position,
          const std::vector<double>& back, const std::vector<std::vector<double>>& responses) {
  constexpr double apart = 0.003;  // relative; a mode's peak is as wide as twice its damping ratio
  const std::size_t rows = position.size(), size = power_of_two(2 * rows);
  const double period = (time.back() - time.front()) / static_cast<double>(rows - 1);
  std::vector<double> speed(rows, 0.0), gained(rows, 0.0);
  for (std::size_t i = 1; i + 1 < rows; ++i) {
    speed[i] = (position[i + 1] - position[i - 1]) / (2.0 * period);
    gained[i] = (position[i + 1] - 2.0 * position[i] + position[i - 1]) / (period * period);
  }
  const auto acceleration = transform(std::move(gained), size), velocity = transform(std::move(speed), size),
             residual = transform(back, size);
  const auto answer = answer_power(responses, size);
  const double hertz = 1.0 / (static_cast<double>(size) * period), halves = 2.0 / static_cast<double>(size);
  for (std::size_t k = 1, until = 0; k < answer.size(); ++k) {
    const Complex a = halves * std::conj(acceleration[k]), v = halves * std::conj(velocity[k]);
    const Complex with_back = a * residual[k], with_velocity = a * velocity[k] * answer[k];
    const double power = (a * acceleration[k]).real() * answer[k],
                 of_speed = (v * velocity[k]).real() * answer[k];
    all.rigid += Eigen::Matrix2d{{power, with_velocity.real()}, {with_velocity.real(), of_speed}};
    all.slope += Eigen::Vector2d{with_back.real(), (v * residual[k]).real()};
    if (k >= until) {
      until = k + std::max<std::size_t>(1, static_cast<std::size_t>(apart * static_cast<double>(k)));
      all.cells.push_back({hertz * 0.5 * static_cast<double>(k + until - 1), {}, {}, 0.0});
    }
    auto& cell = all.cells.back();
    cell.with_back += with_back, cell.with_velocity += with_velocity, cell.power += power;
  }
}

/// Twice the log likelihood that a mode would win, its carriage's mass and damping fitted with it.
double gain_of_mode(const Heard& heard, double frequency, double damping_ratio) {
  double shows = 0.0, wins = 0.0;
  Eigen::Vector2d beside = Eigen::Vector2d::Zero();
  for (const auto& cell : heard.cells) {
    const double ratio = cell.hertz / frequency;
    const Complex swings = -ratio * ratio / Complex{1.0 - ratio * ratio, 2.0 * damping_ratio * ratio};
    shows += std::norm(swings) * cell.power;
    wins += (std::conj(swings) * cell.with_back).real();
    beside += Eigen::Vector2d{swings.real() * cell.power, (std::conj(swings) * cell.with_velocity).real()};
  }
  const Eigen::Vector2d gives_way = numerics::solve_symmetric(heard.rigid, beside);
  const double left = shows - beside.dot(gives_way), pays = wins - heard.slope.dot(gives_way);
  const bool has_mass = pays > 0.0 && left > 1e-9 * shows;  // and none that is negative
  return has_mass ? pays * pays / left : 0.0;
}

}  // namespace

std::vector<double> mode_frequencies(const Case& data, const Fit& fitted,
                                     const std::vector<std::vector<double>>& responses,
                                     const std::vector<std::vector<double>>& back) {
  constexpr double lowest = 4.0, highest = 350.0, finer = 1.03;
  constexpr std::size_t most = 4;
  const auto at = std::find(data.outputs.begin(), data.outputs.end(), "position");
  if (at == data.outputs.end()) return {};
  const auto position = static_cast<std::size_t>(at - data.outputs.begin());
  const auto simulated = simulate(data, fitted.model);
  Heard heard;
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    hear(heard, data.recordings[r].inputs.time, simulated[r][position], back[r], responses);
  std::vector<double> frequencies, gains;
  for (double f = lowest; f < highest; f *= finer) {
    frequencies.push_back(f);
    gains.push_back(std::max(gain_of_mode(heard, f, 0.01), gain_of_mode(heard, f, 0.05)));
  }
  std::vector<std::pair<double, double>> tops;
  for (std::size_t k = 1; k + 1 < gains.size(); ++k)
    if (gains[k] > 0.0 && gains[k] >= gains[k - 1] && gains[k] > gains[k + 1])
      tops.emplace_back(gains[k], frequencies[k]);
  std::sort(tops.rbegin(), tops.rend());
  if (tops.size() > most) tops.resize(most);
  std::vector<double> likeliest;
  for (const auto& [gain, frequency] : tops) likeliest.push_back(frequency);
  return likeliest;
}

}  // namespace invar::diagnosis

#include "tools/diagnose/control_law.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/physics/axis_controller.hpp"

namespace invar::diagnose {

namespace {

using physics::AxisController;
using physics::AxisControllerSettings;

/// What a controller could make of a motion: each column one of its parts, were it alone.
constexpr Eigen::Index parts = 5;

/// Cycles in a row whose command is not limited, with what the law leaves of the current and what could be its parts.
struct Stretch {
  Eigen::VectorXd left, current;
  Eigen::MatrixXd motion;
};

Stretch stretch_of(const AxisControllerSettings& settings, const std::vector<double>& reference,
                   const std::vector<double>& position, const std::vector<double>& current,
                   const std::vector<double>& forward, const std::vector<double>& simulated,
                   std::size_t begin, std::size_t end, std::size_t settles) {
  AxisController controller{settings};
  const auto n = static_cast<Eigen::Index>(end - begin - settles);
  Stretch stretch{Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::MatrixXd(n, parts)};
  // The law's own sum and filtered difference, each alone.
  AxisControllerSettings integral, derivative;
  integral.rate = derivative.rate = settings.rate;
  integral.ki = derivative.kd = 1.0;
  derivative.velocity_filter_hz = settings.velocity_filter_hz;
  AxisController sum{integral}, of_error{derivative}, of_motion{derivative};
  for (std::size_t i = begin; i < end; ++i) {
    const double command = controller.step(reference[i], position[i]) + (forward.empty() ? 0.0 : forward[i]);
    const double error = reference[i] - simulated[i], summed = sum.step(reference[i], simulated[i]),
                 error_slope = of_error.step(reference[i], simulated[i]),
                 motion_slope = of_motion.step(0.0, simulated[i]);
    if (i < begin + settles) continue;
    const auto row = static_cast<Eigen::Index>(i - begin - settles);
    stretch.left(row) = current[i] - command;
    stretch.current(row) = current[i];
    stretch.motion.row(row) << error, summed, error_slope, motion_slope, reference[i];
  }
  // The sum began somewhere.
  stretch.left.array() -= stretch.left.mean();
  stretch.current.array() -= stretch.current.mean();
  stretch.motion.rowwise() -= stretch.motion.colwise().mean().eval();
  return stretch;
}

bool is_one_cycle(double step, double rate) { return step * rate > 0.6 && std::lround(step * rate) == 1; }

}  // namespace

std::optional<LawOff> off_the_law(const Case& data) {
  const auto& model = data.model;
  if (model.plant != physics::Plant::axis || !model.controller) return std::nullopt;
  auto settings = *model.controller;
  const double limit = settings.limit;
  settings.limit = 0.0;
  // The filter has forgotten a stretch's beginning.
  const double tau = settings.velocity_filter_hz
                         ? settings.rate / (2.0 * std::numbers::pi * *settings.velocity_filter_hz)
                         : 1.0;
  const auto settles = static_cast<std::size_t>(std::ceil(10.0 * tau)) + 2;
  const auto simulated = simulate(data, model);
  const auto place = [&](const char* output) {
    return static_cast<std::size_t>(std::find(data.outputs.begin(), data.outputs.end(), output) -
                                    data.outputs.begin());
  };
  const std::size_t position_at = place("position"), current_at = place("current");
  if (std::max(position_at, current_at) >= data.outputs.size()) return std::nullopt;
  std::vector<Stretch> all;
  Eigen::Index rows = 0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto& recording = data.recordings[r];
    const auto& time = recording.inputs.time;
    const auto& reference = recording.inputs.signals.at("reference");
    const auto* fed = recording.inputs.find("feedforward");
    const auto forward = fed != nullptr ? *fed : std::vector<double>{};
    const auto &position = recording.measured[position_at], &current = recording.measured[current_at];
    const auto usable = [&](std::size_t i) {
      return std::isfinite(reference[i]) && std::isfinite(position[i]) && std::isfinite(current[i]) &&
             (forward.empty() || std::isfinite(forward[i])) &&
             (limit <= 0.0 || std::abs(current[i]) < 0.98 * limit);
    };
    for (std::size_t i = 0; i < time.size();) {
      std::size_t end = i;
      while (end < time.size() && usable(end) &&
             (end == i || is_one_cycle(time[end] - time[end - 1], settings.rate)))
        ++end;
      if (end > i + 2 * settles) {
        all.push_back(stretch_of(settings, reference, position, current, forward, simulated[r][position_at],
                                 i, end, settles));
        rows += all.back().left.size();
      }
      i = std::max(end, i + 1);
    }
  }
  constexpr Eigen::Index blocks = 20, least = 50;
  if (rows < blocks * least) return std::nullopt;
  Eigen::VectorXd left(rows), current(rows);
  Eigen::MatrixXd motion(rows, parts);
  Eigen::Index at = 0;
  for (const auto& s : all) {
    const auto n = s.left.size();
    left.segment(at, n) = s.left, current.segment(at, n) = s.current, motion.middleRows(at, n) = s.motion;
    at += n;
  }
  for (Eigen::Index k = 0; k < parts; ++k)
    if (const double size = motion.col(k).norm(); size > 0.0) motion.col(k) /= size;
  double goes_with = 0.0;
  for (const Eigen::Index half : {0, 1}) {
    Eigen::MatrixXd square = Eigen::MatrixXd::Zero(parts, parts);
    Eigen::VectorXd product = Eigen::VectorXd::Zero(parts);
    const auto of = [&](Eigen::Index block) {
      return std::pair{rows * block / blocks, rows * (block + 1) / blocks};
    };
    for (Eigen::Index b = half; b < blocks; b += 2) {
      const auto [from, to] = of(b);
      const auto part = motion.middleRows(from, to - from);
      square += part.transpose() * part, product += part.transpose() * left.segment(from, to - from);
    }
    square.diagonal().array() += 1e-9;
    const Eigen::VectorXd strength = square.ldlt().solve(product);
    for (Eigen::Index b = 1 - half; b < blocks; b += 2) {
      const auto [from, to] = of(b);
      const Eigen::VectorXd told = motion.middleRows(from, to - from) * strength;
      goes_with += told.dot(2.0 * left.segment(from, to - from) - told);
    }
  }
  if (!std::isfinite(goes_with)) return std::nullopt;  // a model that does not run
  const auto n = static_cast<double>(rows);
  return LawOff{std::sqrt(std::max(0.0, goes_with) / n), std::sqrt(current.squaredNorm() / n)};
}

}  // namespace invar::diagnose

#include "core/diagnosis/checks/control_law.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/diagnosis/thresholds.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/axis_controller.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

using physics::AxisController;
using physics::AxisControllerSettings;

/// What a controller could make of a motion: each column one of its parts, were it alone.
constexpr Eigen::Index parts = 5;

/// Rows from `begin` to before `end` are cycles without a gap, not at the limit.
struct Stretch {
  std::size_t recording = 0, begin = 0, end = 0;
};

/// Where the signals of a loop stand among the outputs; nothing where one is not recorded.
struct Places {
  std::size_t position = 0, current = 0;
};
std::optional<Places> places_of(const Case& data) {
  if (data.model.plant != physics::Plant::axis || !data.model.controller) return std::nullopt;
  const auto place = [&](const char* output) {
    return static_cast<std::size_t>(std::find(data.outputs.begin(), data.outputs.end(), output) -
                                    data.outputs.begin());
  };
  const Places at{place("position"), place("current")};
  return std::max(at.position, at.current) < data.outputs.size() ? std::optional{at} : std::nullopt;
}

bool has_sum(const AxisControllerSettings& settings) {
  return settings.kind == AxisControllerSettings::Kind::pid && settings.ki > 0.0;
}

/// Cycles after which the law's filter has forgotten how a stretch began.
std::size_t settling_of(const AxisControllerSettings& settings) {
  const double tau = settings.velocity_filter_hz
                         ? settings.rate / (2.0 * std::numbers::pi * *settings.velocity_filter_hz)
                         : 1.0;
  return static_cast<std::size_t>(std::ceil(10.0 * tau)) + 2;
}

bool is_one_cycle(double step, double rate) { return step * rate > 0.6 && std::lround(step * rate) == 1; }

/// Of all recordings, those longer than twice what the filter takes to settle.
std::vector<Stretch> stretches_of(const Case& data, const Places& at) {
  const auto& settings = *data.model.controller;
  const std::size_t settles = settling_of(settings);
  std::vector<Stretch> all;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto& recording = data.recordings[r];
    const auto& time = recording.inputs.time;
    const auto& reference = recording.inputs.signals.at("reference");
    const auto* forward = recording.inputs.find("feedforward");
    const auto &position = recording.measured[at.position], &current = recording.measured[at.current];
    const auto usable = [&](std::size_t i) {
      return std::isfinite(reference[i]) && std::isfinite(position[i]) && std::isfinite(current[i]) &&
             (forward == nullptr || std::isfinite((*forward)[i])) &&
             (settings.limit <= 0.0 || std::abs(current[i]) < 0.98 * settings.limit);
    };
    for (std::size_t i = 0; i < time.size();) {
      std::size_t end = i;
      while (end < time.size() && usable(end) &&
             (end == i || is_one_cycle(time[end] - time[end - 1], settings.rate)))
        ++end;
      if (end > i + 2 * settles) all.push_back({r, i, end});
      i = std::max(end, i + 1);
    }
  }
  return all;
}

/// What each part of the law makes of the motion that the model expects, from where the filter has settled.
Eigen::MatrixXd motion_of(const Case& data, const Stretch& stretch, const std::vector<double>& simulated) {
  const auto& settings = *data.model.controller;
  const auto& reference = data.recordings[stretch.recording].inputs.signals.at("reference");
  // The law's own sum and filtered difference, each alone.
  AxisControllerSettings integral, derivative;
  integral.rate = derivative.rate = settings.rate;
  integral.ki = derivative.kd = 1.0;
  derivative.velocity_filter_hz = settings.velocity_filter_hz;
  AxisController sum{integral}, of_error{derivative}, of_motion{derivative};
  const std::size_t settled = stretch.begin + settling_of(settings);
  Eigen::MatrixXd motion(static_cast<Eigen::Index>(stretch.end - settled), parts);
  for (std::size_t i = stretch.begin; i < stretch.end; ++i) {
    const double error = reference[i] - simulated[i], summed = sum.step(reference[i], simulated[i]),
                 error_slope = of_error.step(reference[i], simulated[i]),
                 motion_slope = of_motion.step(0.0, simulated[i]);
    if (i >= settled)
      motion.row(static_cast<Eigen::Index>(i - settled)) << error, summed, error_slope, motion_slope,
          reference[i];
  }
  motion.rowwise() -= motion.colwise().mean().eval();
  return motion;
}

/// The rows of a stretch from where the filter has settled, less their mean.
Eigen::VectorXd changes(const std::vector<double>& values, std::size_t settled, std::size_t end) {
  Eigen::VectorXd rows =
      Eigen::Map<const Eigen::VectorXd>(values.data() + settled, static_cast<Eigen::Index>(end - settled));
  rows.array() -= rows.mean();
  return rows;
}

/// The squares of `left` that go with the columns: found on every second block of rows, counted on the others.
double squares_with(const Eigen::MatrixXd& motion, const Eigen::VectorXd& left, Eigen::Index blocks) {
  double goes_with = 0.0;
  const auto block = [&](Eigen::Index b) {
    const Eigen::Index from = left.size() * b / blocks, to = left.size() * (b + 1) / blocks;
    return std::pair<Eigen::MatrixXd, Eigen::VectorXd>{motion.middleRows(from, to - from),
                                                       left.segment(from, to - from)};
  };
  for (const Eigen::Index half : {0, 1}) {
    Eigen::MatrixXd square = Eigen::MatrixXd::Zero(parts, parts);
    Eigen::VectorXd product = Eigen::VectorXd::Zero(parts);
    for (Eigen::Index b = half; b < blocks; b += 2) {
      const auto [columns, values] = block(b);
      square += columns.transpose() * columns, product += columns.transpose() * values;
    }
    square.diagonal().array() += 1e-9;
    const Eigen::VectorXd strength = numerics::solve_symmetric(square, product);
    for (Eigen::Index b = 1 - half; b < blocks; b += 2) {
      const auto [columns, values] = block(b);
      const Eigen::VectorXd told = columns * strength;
      goes_with += told.dot(2.0 * values - told);
    }
  }
  return goes_with;
}

}  // namespace

namespace {

/// Does the model itself hold the current back on its way, so that what was recorded follows from the past?
bool holds_back(const physics::Model& model) {
  return model.records_applied &&
         std::any_of(model.terms.begin(), model.terms.end(), [](const physics::Term& term) {
           const auto memory = physics::axis_kind(*term.info)->memory;
           return memory == physics::AxisMemory::transport_delay ||
                  memory == physics::AxisMemory::amplifier_lag;
         });
}

}  // namespace

std::vector<LawRows> rows_of_law(const Case& data) {
  const auto at = places_of(data);
  if (!at || holds_back(data.model)) return {};
  const double cycle = 1.0 / data.model.controller->rate;
  auto plant = physics::make_axis(data.model, cycle);  // for what the model's own terms add to the command
  auto settings = *data.model.controller;
  settings.limit = 0.0;
  std::vector<LawRows> all(data.recordings.size());
  for (std::size_t r = 0; r < all.size(); ++r)
    all[r].asked.assign(data.recordings[r].inputs.rows(), std::nan("")), all[r].beyond = all[r].asked;
  for (const auto& stretch : stretches_of(data, *at)) {
    const auto& recording = data.recordings[stretch.recording];
    const auto& reference = recording.inputs.signals.at("reference");
    const auto* forward = recording.inputs.find("feedforward");
    auto &asked = all[stretch.recording].asked, &beyond = all[stretch.recording].beyond;
    AxisController controller{settings};
    const std::size_t settled = stretch.begin + settling_of(settings);
    double sum = 0.0;
    for (std::size_t i = stretch.begin; i < stretch.end; ++i) {
      double command = controller.step(reference[i], recording.measured[at->position][i]) +
                       (forward != nullptr ? (*forward)[i] : 0.0);
      if (i < settled) continue;
      if (data.model.records_applied) {
        plant.rest_at(0.0, recording.inputs.time[i]);
        command = plant.applied(command, cycle);
      }
      asked[i] = command, beyond[i] = recording.measured[at->current][i] - command;
      sum += beyond[i];
    }
    const bool is_open =
        has_sum(settings) && (stretch.begin > 0 || recording.inputs.find("current") != nullptr);
    all[stretch.recording].has_open_level = all[stretch.recording].has_open_level || is_open;
    const double began = is_open ? sum / static_cast<double>(stretch.end - settled) : 0.0;
    for (std::size_t i = settled; i < stretch.end; ++i) asked[i] += began, beyond[i] -= began;
  }
  return all;
}

std::optional<LawOff> off_the_law(const Case& data) {
  const auto at = places_of(data);
  if (!at) return std::nullopt;
  const auto stretches = stretches_of(data, *at);
  const auto law = rows_of_law(data);
  if (law.empty()) return std::nullopt;
  const std::size_t settles = settling_of(*data.model.controller);
  Eigen::Index rows = 0;
  for (const auto& stretch : stretches)
    rows += static_cast<Eigen::Index>(stretch.end - stretch.begin - settles);
  constexpr Eigen::Index blocks = 20;
  if (rows < blocks * thresholds::rows_of_law_block) return std::nullopt;
  const auto simulated = simulate(data, data.model);
  Eigen::VectorXd left(rows), current(rows);
  Eigen::MatrixXd motion(rows, parts);
  Eigen::Index row = 0;
  for (const auto& stretch : stretches) {
    const auto& recording = data.recordings[stretch.recording];
    const std::size_t settled = stretch.begin + settles;
    const auto n = static_cast<Eigen::Index>(stretch.end - settled);
    left.segment(row, n) = changes(law[stretch.recording].beyond, settled, stretch.end);
    current.segment(row, n) = changes(recording.measured[at->current], settled, stretch.end);
    motion.middleRows(row, n) = motion_of(data, stretch, simulated[stretch.recording][at->position]);
    row += n;
  }
  for (Eigen::Index k = 0; k < parts; ++k)
    if (const double size = motion.col(k).norm(); size > 0.0) motion.col(k) /= size;
  const double goes_with = squares_with(motion, left, blocks);
  if (!std::isfinite(goes_with)) return std::nullopt;  // a model that does not run
  const auto n = static_cast<double>(rows);
  return LawOff{std::sqrt(std::max(0.0, goes_with) / n), std::sqrt(current.squaredNorm() / n)};
}

namespace {

/// What the law leaves as a loop without gaps would feel it. A sum holds whatever it began with, so that a stretch of a law
/// with one goes on from where the last ended, and the first from zero.
std::vector<double> joined(const std::vector<double>& beyond, bool is_summed) {
  constexpr std::size_t first = 50;  // rows whose noise does not set a level
  std::vector<double> all(beyond.size(), 0.0);
  double now = 0.0, shift = 0.0;
  for (std::size_t i = 0; i < beyond.size(); ++i) {
    if (std::isfinite(beyond[i])) {
      if (is_summed && (i == 0 || !std::isfinite(beyond[i - 1]))) {
        const auto from = beyond.begin() + static_cast<std::ptrdiff_t>(i);
        shift = now - median({from, from + static_cast<std::ptrdiff_t>(std::min(first, beyond.size() - i))});
      }
      now = beyond[i] + shift;
    }
    all[i] = now;
  }
  return all;
}

}  // namespace

Case told_what_law_leaves(const Case& data, const std::vector<LawRows>& rows) {
  Case told = data;
  told.remembered = std::make_shared<Remembered>();
  for (std::size_t r = 0; r < told.recordings.size(); ++r) {
    auto& recording = told.recordings[r];
    auto& forward = recording.inputs.signals["feedforward"];
    forward.resize(recording.inputs.rows(), 0.0);
    const auto beyond = joined(rows[r].beyond, has_sum(*data.model.controller));
    for (std::size_t i = 0; i < forward.size(); ++i) forward[i] += beyond[i];
    recording.simulation = physics::prepare(told.model, recording.inputs);
  }
  return told;
}

double share_of_law(const Case& data, const physics::Model& retuned) {
  const auto at = places_of(data);
  if (!at) return 0.0;
  const auto rows = rows_of_law(data);
  if (rows.empty()) return 0.0;
  const auto told = told_what_law_leaves(data, rows);
  const auto left_by = [&](const Case& loop, const physics::Model& model) {
    double squares = 0.0;
    const auto simulated = simulate(loop, model);
    for (std::size_t r = 0; r < data.recordings.size(); ++r)
      for (std::size_t i = 0; i < simulated[r][at->position].size(); ++i)
        if (const double e = data.recordings[r].measured[at->position][i] - simulated[r][at->position][i];
            std::isfinite(e))
          squares += e * e;
    return squares;
  };
  // Numbers that were retuned to another law may fit this one worse than those the user believes.
  const double untold = left_by(data, retuned),
               left = std::min(left_by(told, data.model), left_by(told, retuned));
  return untold > 0.0 ? std::clamp(1.0 - left / untold, 0.0, 1.0) : 0.0;
}

}  // namespace invar::diagnosis

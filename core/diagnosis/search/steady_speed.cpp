#include "core/diagnosis/search/steady_speed.hpp"

#include <Eigen/Core>
#include <cmath>
#include <numbers>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/numerics/decompositions.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

/// position = start + speed time, and how far the carriage strays from it [m] RMS.
struct Line {
  double start = 0.0, speed = 0.0, strays = 0.0;
};

Line line_of(const Case& data) {
  std::size_t longest = 0;
  for (std::size_t r = 1; r < data.recordings.size(); ++r)
    if (data.recordings[r].inputs.rows() > data.recordings[longest].inputs.rows()) longest = r;
  const auto position = variable_values(data, longest, "position");
  const auto& time = data.recordings[longest].inputs.time;
  const auto rows = static_cast<Eigen::Index>(position.size());
  Eigen::MatrixXd columns(rows, 2);
  columns.col(0).setOnes();
  columns.col(1) = Eigen::Map<const Eigen::VectorXd>(time.data(), rows);
  const auto x = Eigen::Map<const Eigen::VectorXd>(position.data(), rows);
  const Eigen::Vector2d parts = numerics::least_squares(columns, x);
  return {parts(0), parts(1), (x - columns * parts).norm() / std::sqrt(static_cast<double>(rows))};
}

}  // namespace

std::optional<physics::Term> twin_at_steady_speed(const Case& data, const physics::Term& term) {
  using physics::Plant;
  const auto& info = *term.info;
  if (info.plant != Plant::axis || !info.is_wave()) return std::nullopt;
  const bool is_along = info.has("pitch") && info.site == "force";
  if (!is_along && !(info.is_wave_in_time() && info.site == "disturbance")) return std::nullopt;
  const auto line = line_of(data);
  if (line.speed == 0.0) return std::nullopt;
  physics::Term twin;
  twin.info = is_along ? physics::find_term(Plant::axis, "periodic_disturbance")
                       : physics::find_term(Plant::axis, "force_ripple");
  for (std::size_t i = 0; i < twin.info->parameter_count(); ++i)
    twin.values[i] = twin.info->parameters[i].starts[0], twin.given[i] = true;
  const auto of = [](const physics::Term& one, const char* name) { return one.info->index_of(name); };
  const auto from = of(term, is_along ? "pitch" : "frequency"),
             to = of(twin, is_along ? "frequency" : "pitch");
  const double speed = std::abs(line.speed), pitch = is_along ? term.values[from] : speed / term.values[from];
  if (line.strays > pitch) return std::nullopt;
  twin.values[to] = is_along ? speed / pitch : pitch;
  if (!physics::bounds_of_parameter(data.model, twin, to).contains(twin.values[to])) return std::nullopt;
  twin.values[of(twin, "amplitude")] = term.values[of(term, "amplitude")];
  // sin(2 pi x / pitch + a) at x = start + speed t is sin(2 pi f t + b); backwards it is sin(pi - ...) of that.
  const double turn = 2.0 * std::numbers::pi * line.start / pitch, phase = term.values[of(term, "phase")];
  const bool is_back = line.speed < 0.0;
  const double other = is_along ? (is_back ? std::numbers::pi - (phase + turn) : phase + turn)
                                : (is_back ? std::numbers::pi - phase : phase) - turn;
  twin.values[of(twin, "phase")] = std::remainder(other, 2.0 * std::numbers::pi);
  return twin;
}

}  // namespace invar::diagnosis

// Measurements of the jobs of a calibration, as the cell file states them.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/range.hpp"
#include "core/component/parameters.hpp"
#include "core/config/yaml.hpp"
#include "core/job/job_spec.hpp"

namespace invar::calibration {

/// A displacement line to measure.
struct LineSpec {
  std::string name;
  std::vector<double> from;
  std::vector<double> to;
  void describe(auto& p) {
    p(name, "name", "name of the line in the files");
    p(from, "from", "m", "commanded start, one number an axis");
    p(to, "to", "m", "commanded end");
    if constexpr (requires { p.node(); }) {
      if (from.size() != to.size() || from.empty() || from.size() > 3)
        p.node().fault("`from` and `to` need one number an axis each", "write from: [0, 0] and to: [0.2, 0]");
      else if (from == to)
        p.node().fault("begins where it ends", "let `from` and `to` differ");
    }
  }
  [[nodiscard]] Eigen::Vector3d start() const { return point(from); }
  [[nodiscard]] Eigen::Vector3d end() const { return point(to); }

 private:
  [[nodiscard]] static Eigen::Vector3d point(const std::vector<double>& numbers) {
    Eigen::Vector3d result = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < numbers.size(); ++i) result[static_cast<Eigen::Index>(i)] = numbers[i];
    return result;
  }
};

struct GeometricJob;
/// Faults at `job` for its machine's file, and for lines that leave the travel that this names.
void check_travel(const GeometricJob& job, const config::Node& node);

/// One geometric calibration as a transaction: lines to fit, lines to verify before and after.
struct GeometricJob : job::JobSpec {
  std::filesystem::path machine;
  std::vector<LineSpec> lines;
  std::vector<LineSpec> verify;
  double interval = 0.01;
  double verify_interval = 0.005;
  std::int64_t cycles = 1;
  std::int64_t readings = 4;
  void describe(auto& p) {
    job::JobSpec::describe(p);
    p(machine, "machine", "machine.yaml: chain and travel");
    p(lines, "lines", "displacement lines to identify the error from");
    p(verify, "verify", "lines not fitted, measured before and after");
    p(interval, "interval", "m", Range{1e-4, 1.0}, "between the points of a line");
    p(verify_interval, "verify_interval", "m", Range{1e-4, 1.0}, "between the points of a verification line");
    p(cycles, "cycles", 1, 100, "each line forth and back so often");
    p(readings, "readings", 1, 10'000, "averaged at each point");
    if constexpr (requires { p.node(); }) {
      if (lines.empty())
        p.node()["lines"].fault("no lines to identify the error from",
                                "write - {name: x, from: [0, 0], to: [0.2, 0]}");
      check_travel(*this, p.node());
    }
  }
};

/// Setpoints over time, straight in between.
struct TraceSpec {
  std::vector<double> time;
  std::vector<double> temperature;
  void describe(auto& p) {
    p(time, "time", "s", "since the trace began, ascending");
    p(temperature, "temperature", "degC", "setpoint at each of the times");
    if constexpr (requires { p.node(); }) {
      bool sound = time.size() == temperature.size() && time.size() >= 2;
      for (std::size_t i = 1; i < time.size(); ++i) sound = sound && time[i] > time[i - 1];
      if (!sound)
        p.node().fault("needs as many ascending times as temperatures, two at least",
                       "write time: [0, 1200] and temperature: [27, 30]");
    }
  }
  [[nodiscard]] double length() const { return time.empty() ? 0.0 : time.back(); }
  [[nodiscard]] double at(double t) const {
    for (std::size_t i = 1; i < time.size(); ++i)
      if (t < time[i])
        return std::lerp(temperature[i - 1], temperature[i], (t - time[i - 1]) / (time[i] - time[i - 1]));
    return temperature.back();
  }
};

/// The error of one axis over position and temperature as a transaction. A line is read at room temperature, and repeatedly
/// while the heater follows a trace. The model is then compared with that of room temperature at points and
/// temperatures that were not fitted.
struct ThermalJob : job::JobSpec {
  LineSpec line;
  double interval = 0.005;
  std::int64_t readings = 4;
  double room = 26.8;
  std::int64_t room_passes = 3;
  TraceSpec trace;
  double pause = 0.0;
  double fixed = 28.5;
  TraceSpec verify;
  double tolerance = 0.1;
  double soak = 300.0;
  double steady_timeout = 7200.0;
  void describe(auto& p) {
    job::JobSpec::describe(p);
    p(line, "line", "along the axis to calibrate, from where the laser is zeroed");
    p(interval, "interval", "m", Range{1e-4, 1.0}, "between the points of the line");
    p(readings, "readings", 1, 10'000, "averaged at each point");
    p(room, "room", "degC", Range{-50.0, 150.0}, "temperature of the model that the other is compared with");
    p(room_passes, "room_passes", 1, 100, "forth and back at that temperature");
    p(trace, "trace", "setpoints while the line is read for the fit");
    p(pause, "pause", "s", Range{0.0, 36000.0}, "between two passes");
    p(fixed, "fixed", "degC", Range{-50.0, 150.0}, "temperature of the first comparison");
    p(verify, "verify", "setpoints of the second comparison");
    p(tolerance, "tolerance", "K", Range{1e-3, 10.0}, "around a setpoint that counts as reached");
    p(soak, "soak", "s", Range{0.0, 36000.0}, "at a setpoint before the line is read");
    p(steady_timeout, "steady_timeout", "s", Range{1.0, 1e6}, "the job fails when it takes longer");
    if constexpr (requires { p.node(); }) {
      int moving = 0;
      for (std::size_t i = 0; i < line.from.size() && i < line.to.size(); ++i)
        moving += line.from[i] != line.to[i] ? 1 : 0;
      if (moving > 1 || line.from.empty())
        p.node()["line"].fault("does not run along one axis", "change one coordinate alone");
      for (const auto* one : {&trace, &verify})
        if (one->time.empty())
          p.node().fault("needs the traces `trace` and `verify`",
                         "write {time: [0, 1200], temperature: [27, 30]}");
    }
  }
  [[nodiscard]] std::size_t axis() const {
    std::size_t i = 0;
    while (i + 1 < line.from.size() && line.from[i] == line.to[i]) ++i;
    return i;
  }
};

}  // namespace invar::calibration

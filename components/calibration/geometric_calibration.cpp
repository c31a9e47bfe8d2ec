#include "components/calibration/geometric_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "components/calibration/identify.hpp"
#include "core/base/fault.hpp"
#include "core/base/shown.hpp"
#include "core/machine/machine_file.hpp"

namespace invar::calibration {

namespace {

recording::Table lines_table() {
  recording::Table table;
  table.add_texts("line", {});
  for (const char* name : {"x", "y", "z"}) table.add(name, "m", {});
  table.add("displacement", "m", {});
  table.add("cycle", "", {});
  table.add("direction", "", {});
  return table;
}

void append(recording::Table& table, const std::string& line, const Eigen::Vector3d& point,
            double displacement, double cycle, double direction) {
  table.columns[0].texts.push_back(line);
  const double row[] = {std::numeric_limits<double>::quiet_NaN(),
                        point.x(),
                        point.y(),
                        point.z(),
                        displacement,
                        cycle,
                        direction};
  for (std::size_t i = 0; i < table.columns.size(); ++i) table.columns[i].values.push_back(row[i]);
}

}  // namespace

void check_travel(const GeometricJob& job, const config::Node& node) {
  std::error_code unseen;
  if (!std::filesystem::is_regular_file(job.machine, unseen)) return;
  metrology::Machine machine;
  try {
    machine = machine::load_machine(job.machine);
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults())
      node["machine"].fault(fault.where + ": " + fault.what, fault.mend);
    return;
  }
  const auto check = [&](const char* list, const std::vector<LineSpec>& lines) {
    const auto places = node[list].list();
    for (std::size_t i = 0; i < std::min(places.size(), lines.size()); ++i)
      for (const auto& [end, point] : {std::pair{"from", &lines[i].from}, std::pair{"to", &lines[i].to}})
        for (std::size_t axis = 0; axis < std::min<std::size_t>(point->size(), 3); ++axis) {
          const Range travel = machine.travel[axis];
          if (!travel.contains((*point)[axis]))
            places[i][end].fault(
                std::string{"leaves the travel of "} + "xyz"[axis] + " at " + shown((*point)[axis]) + " m",
                "stay between " + shown(travel.lower) + " and " + shown(travel.upper) + " m");
        }
  };
  check("lines", job.lines);
  check("verify", job.verify);
}

job::Task GeometricCalibration::measure(const LineSpec& line, const Way& how, recording::Table& table) {
  const Eigen::Vector3d from = line.start();
  const Eigen::Vector3d to = line.end();
  const double length = (to - from).norm();
  const auto intervals = std::max<std::int64_t>(1, std::llround(length / how.interval));
  co_await host_.move_to(from, {});
  co_await laser_.align(from, to);
  const double begin = progress_;
  for (std::int64_t cycle = 0; cycle < how.cycles; ++cycle) {
    for (std::int64_t k = 0; k <= 2 * intervals + 1; ++k) {
      const bool forth = k <= intervals;
      const auto index = forth ? k : 2 * intervals + 1 - k;
      const Eigen::Vector3d target =
          from + (to - from) * (static_cast<double>(index) / static_cast<double>(intervals));
      co_await host_.move_to(target, {});
      double mean = 0.0;
      co_await laser_.average(how.readings, mean);
      append(table, line.name, target, mean, static_cast<double>(cycle + 1), forth ? 1.0 : -1.0);
      progress_ = begin + how.share *
                              (static_cast<double>(cycle) +
                               static_cast<double>(k) / static_cast<double>(2 * intervals + 2)) /
                              static_cast<double>(how.cycles);
      host_.advance(progress_);
    }
  }
  progress_ = begin + how.share;
  host_.tell("measured line " + line.name, progress_);
}

job::Task GeometricCalibration::run(const GeometricJob& job) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  const double share = 1.0 / static_cast<double>(job.lines.size() + 2 * job.verify.size() + 1);
  const Way fitted{job.interval, job.cycles, job.readings, share};
  const Way verified{job.verify_interval, 1, job.readings, share};
  progress_ = 0.0;
  co_await host_.enable_axes();
  co_await models_.clear("");

  recording::Table before = lines_table();
  for (const LineSpec& line : job.verify) co_await measure(line, verified, before);
  if (before.rows() > 0) before.write(folder / "verify_before.csv");
  const double was = metrology::line_errors(readings_of(before)).rms;

  recording::Table lines = lines_table();
  for (const LineSpec& line : job.lines) co_await measure(line, fitted, lines);
  lines.write(folder / "lines.csv");

  host_.tell("identifying the error", progress_);
  const IdentifiedGeometry found = identify_geometric(job.machine, lines, folder);
  if (metrology::line_errors(readings_of(before), found.model).rms > was)
    throw std::runtime_error{
        "the model would make the error larger on lines that were not fitted; it was not activated"};
  co_await models_.use(found.file);
  progress_ += share;
  host_.tell("compensation active; verifying", progress_);

  recording::Table after = lines_table();
  for (const LineSpec& line : job.verify) co_await measure(line, verified, after);
  if (after.rows() > 0) {
    after.write(folder / "verify_after.csv");
    if (metrology::line_errors(readings_of(after)).rms > was)
      co_await models_.roll_back(
          "the compensation makes the error larger on lines that were not fitted; rolled back");
  }
  co_await models_.keep();
}

}  // namespace invar::calibration

#include "tools/cell/motion_summary.hpp"

#include <algorithm>
#include <cmath>

#include "core/recording/table.hpp"

namespace invar::tools {

namespace {

using report::number;
using report::si;

/// The following error of one motion, its mean taken out as the job does.
struct Motion {
  std::vector<double> time, error;
  double rms = 0.0, largest = 0.0;
};

Motion read_motion(const std::filesystem::path& file) {
  const auto table = recording::Table::read(file);
  Motion motion{table.in("t", "s"), table.in("following_error", "m")};
  const double begin = motion.time.front(), count = static_cast<double>(motion.error.size());
  double mean = 0.0;
  for (const double error : motion.error) mean += error / count;
  for (std::size_t i = 0; i < motion.error.size(); ++i) {
    motion.time[i] -= begin;
    motion.error[i] -= mean;
    motion.rms += motion.error[i] * motion.error[i] / count;
    motion.largest = std::max(motion.largest, std::abs(motion.error[i]));
  }
  motion.rms = std::sqrt(motion.rms);
  return motion;
}

report::Series series(const Motion& motion, const std::string& label) {
  report::Series line;
  line.label = label;
  line.style = report::Series::Style::line;
  line.x = motion.time;
  for (const double error : motion.error) line.y.push_back(1e6 * error);
  return line;
}

}  // namespace

void summarise_motion(const std::filesystem::path& folder, report::Page& page, std::ostream& out) {
  const auto before_file = folder / "motion_before.csv", after_file = folder / "motion_after.csv";
  if (!std::filesystem::exists(before_file)) return;
  const Motion before = read_motion(before_file);
  report::Plot plot;
  plot.title = "Following error of the same motion";
  plot.x_label = "t [s]";
  plot.y_label = "setpoint less position [um]";
  plot.series = {series(before, "before")};
  out << "follows within  rms " << si(before.rms, "m") << ", max " << si(before.largest, "m")
      << "   (the model as it was believed)\n";
  if (std::filesystem::exists(after_file)) {
    const Motion after = read_motion(after_file);
    plot.series.push_back(series(after, "after"));
    out << "... patched     rms " << si(after.rms, "m") << ", max " << si(after.largest, "m") << "   ("
        << number(before.rms / after.rms, 2) << " times less)\n";
    page.callout(
        "With the model that the diagnosis patched fed forward, the following error of the same motion fell "
        "from " +
            si(before.rms, "m") + " to " + si(after.rms, "m") + " RMS.",
        after.rms < before.rms ? "good" : "bad");
  }
  page.heading("Motion");
  page.plots({plot}, "The axis forth and back at several speeds, its setpoint less its position.");
}

}  // namespace invar::tools

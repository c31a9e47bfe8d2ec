#include "tools/cell/fusion_summary.hpp"

#include <algorithm>
#include <cmath>

#include "core/recording/table.hpp"

namespace invar::tools {

namespace {

using report::number;
using report::si;

/// Error of the fused position over the runs one after the other, its mean taken out as the job does.
struct Error {
  std::vector<double> time, error;  // s, m
  double rms = 0.0, largest = 0.0;
};

Error read_error(const std::filesystem::path& file) {
  const auto table = recording::Table::read(file);
  const auto time = table.in("t", "s"), fused = table.in("fused", "m"), laser = table.in("reference", "m");
  Error all;
  double mean = 0.0, begin = 0.0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (i > 0 && time[i] < time[i - 1]) begin += time[i - 1];  // the next run
    if (!std::isfinite(fused[i]) || !std::isfinite(laser[i])) continue;
    all.time.push_back(begin + time[i]);
    all.error.push_back(fused[i] - laser[i]);
    mean += all.error.back();
  }
  const double count = static_cast<double>(all.error.size());
  for (double& error : all.error) {
    error -= mean / count;
    all.rms += error * error / count;
    all.largest = std::max(all.largest, std::abs(error));
  }
  all.rms = std::sqrt(all.rms);
  return all;
}

report::Series series(const Error& all, const std::string& label) {
  report::Series line;
  line.label = label;
  line.style = report::Series::Style::line;
  line.x = all.time;
  for (const double error : all.error) line.y.push_back(1e6 * error);
  return line;
}

}  // namespace

void summarise_fusion(const std::filesystem::path& folder, report::Page& page, std::ostream& out) {
  const auto before_file = folder / "fusion_before.csv", after_file = folder / "fusion_after.csv";
  if (!std::filesystem::exists(before_file) || !std::filesystem::exists(after_file)) return;
  const Error before = read_error(before_file), after = read_error(after_file);
  out << "fused before    rms " << si(before.rms, "m") << ", max " << si(before.largest, "m")
      << "   (runs not fitted, by the laser)\n"
      << "fused after     rms " << si(after.rms, "m") << ", max " << si(after.largest, "m") << "   ("
      << number(before.rms / after.rms, 2) << " times less)\n";
  page.callout(
      "On runs that were not used to identify the sensors, the error of the fused position fell from " +
          si(before.rms, "m") + " to " + si(after.rms, "m") + " RMS by the laser (largest " +
          si(before.largest, "m") + " to " + si(after.largest, "m") + ").",
      after.rms < before.rms ? "good" : "bad");
  page.heading("Fused position beside the laser");
  report::Plot plot;
  plot.title = "Error of the fused position";
  plot.x_label = "t, run after run [s]";
  plot.y_label = "fused less laser [um]";
  plot.series = {series(before, "before"), series(after, "after")};
  page.plot(plot,
            "The same sinusoids before and after the model was given to the fusion; neither was fitted.");
}

}  // namespace invar::tools

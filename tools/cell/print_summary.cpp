#include "tools/cell/print_summary.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <map>

#include "core/base/angle.hpp"
#include "core/compensation/trajectory_file.hpp"
#include "core/metrology/droplet/droplet_trajectory.hpp"
#include "core/recording/table.hpp"

namespace invar::tools {

namespace {

using report::number;
using report::Plot;
using report::Series;
using report::si;

/// Droplets as printing.cpp writes them, in the order of printing.
struct Prints {
  std::vector<double> time, height, x, y, jetted_x, jetted_y, nozzle_x, nozzle_y, velocity_x, velocity_y,
      diameter;

  explicit Prints(const std::filesystem::path& file) {
    const auto table = recording::Table::read(file);
    time = table.in("t", "s");
    height = table.in("height", "m");
    diameter = table.in("diameter", "m");
    velocity_x = table.in("stage_velocity_x", "m/s");
    velocity_y = table.in("stage_velocity_y", "m/s");
    const auto less = [&](const char* from, const char* what) {
      auto difference = table.in(from, "m");
      const auto other = table.in(what, "m");
      for (std::size_t i = 0; i < difference.size(); ++i) difference[i] -= other[i];
      return difference;
    };
    x = less("landed_x", "target_x");
    y = less("landed_y", "target_y");
    jetted_x = less("landed_x", "jetted_x");
    jetted_y = less("landed_y", "jetted_y");
    nozzle_x = table.in("jetted_x", "m");
    nozzle_y = table.in("jetted_y", "m");
  }
  [[nodiscard]] std::vector<double> heights() const {
    std::vector<double> levels{height};
    std::sort(levels.begin(), levels.end());
    levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
    return levels;
  }
};

struct Errors {
  double rms = 0.0, largest = 0.0,
         relative_rms = 0.0;  // m; relative: to the first droplet, as table 5.3 of the thesis
  std::size_t count = 0;
};

Errors errors_at(const Prints& prints, double height) {
  Errors result;
  std::size_t first = prints.x.size();
  for (std::size_t i = 0; i < prints.x.size(); ++i) {
    if (prints.height[i] != height) continue;
    first = std::min(first, i);
    const double error = std::hypot(prints.x[i], prints.y[i]);
    result.rms += error * error;
    result.largest = std::max(result.largest, error);
    result.relative_rms +=
        std::pow(prints.x[i] - prints.x[first], 2) + std::pow(prints.y[i] - prints.y[first], 2);
    ++result.count;
  }
  const auto n = static_cast<double>(result.count);
  result.rms = std::sqrt(result.rms / n);
  result.relative_rms = n > 1.0 ? std::sqrt(result.relative_rms / (n - 1.0)) : 0.0;
  return result;
}

Plot scatter(const Prints& prints, const std::string& title) {
  Plot plot;
  plot.title = title;
  plot.x_label = "x from target [um]";
  plot.y_label = "y from target [um]";
  plot.height = 480;
  for (const double level : prints.heights()) {
    Series series;
    series.label = si(level, "m");
    series.style = Series::Style::points;
    for (std::size_t i = 0; i < prints.x.size(); ++i)
      if (prints.height[i] == level) {
        series.x.push_back(1e6 * prints.x[i]);
        series.y.push_back(1e6 * prints.y[i]);
      }
    plot.series.push_back(std::move(series));
  }
  report::centre(plot);
  return plot;
}

void add_trajectory(const metrology::DropletTrajectory& path, report::Page& page, std::ostream& out) {
  const double slope_sigma = std::sqrt(path.covariance(1, 1));
  const double placement_sigma = std::sqrt(path.covariance(0, 0));
  std::vector<std::vector<std::string>> rows{
      {"placement error x", "xe", si(path.placement.x(), "m"), si(placement_sigma, "m")},
      {"placement error y", "ye", si(path.placement.y(), "m"), si(placement_sigma, "m")},
      {"tilt from vertical", "90 deg - theta", number(path.tilt() / degree, 3) + " deg",
       number(slope_sigma / degree, 2) + " deg"},
      {"azimuth from x", "alpha", number(path.azimuth() / degree, 3) + " deg",
       number(slope_sigma / path.slope.norm() / degree, 2) + " deg"}};
  if (std::isfinite(path.slowness_sigma) && path.slowness > 0.0)
    rows.push_back({"ejection speed", "u", si(1.0 / path.slowness, "m/s"),
                    si(path.slowness_sigma / (path.slowness * path.slowness), "m/s")});
  if (std::isfinite(path.delay_sigma))
    rows.push_back({"delay from trigger to droplet", "t0", si(path.delay, "s"), si(path.delay_sigma, "s")});
  page.heading("Trajectory of the droplets (table 5.2)");
  page.table({"parameter", "symbol", "value", "1 sigma"}, rows);
  out << "head            tilt " << number(path.tilt() / degree) << " +- " << number(slope_sigma / degree, 2)
      << " deg, placement (" << si(path.placement.x(), "m") << ", " << si(path.placement.y(), "m") << ") +- "
      << si(placement_sigma, "m", 2);
  if (path.slowness > 0.0)
    out << ", " << number(1.0 / path.slowness) << " m/s, delay " << si(path.delay, "s");
  out << '\n';
}

void add_sizes(const std::vector<const Prints*>& all, report::Page& page, std::ostream& out) {
  std::vector<double> sizes;
  for (const Prints* prints : all)
    for (const double d : prints->diameter)
      if (std::isfinite(d)) sizes.push_back(d);
  if (sizes.size() < 8) return;
  const auto statistics = metrology::droplet_statistics(
      Eigen::Map<const Eigen::VectorXd>(sizes.data(), static_cast<Eigen::Index>(sizes.size())));
  page.heading("Diameter of the droplets (table 5.1)");
  page.table({"droplets", "mean", "standard error", "deviation", "within 1 sigma", "within 2 sigma",
              "Anderson-Darling"},
             {{std::to_string(statistics.count), si(statistics.mean, "m", 4),
               si(statistics.mean_error, "m", 2), si(statistics.deviation, "m", 2),
               number(100.0 * statistics.within_one) + " %", number(100.0 * statistics.within_two) + " %",
               number(statistics.anderson_darling) + ", p = " + number(statistics.probability, 2) +
                   (statistics.probability < 0.05 ? " (not normal)" : " (compatible with normal)")}});
  out << "droplets        " << statistics.count << ", diameter " << si(statistics.mean, "m", 4)
      << ", deviation " << si(statistics.deviation, "m", 2)
      << ", Anderson-Darling p = " << number(statistics.probability, 2) << '\n';
}

/// Error of each print after the calibration, and what the calibration's model alone would have left.
void add_drift(const std::filesystem::path& file, const metrology::DropletTrajectory& calibrated,
               report::Page& page, std::ostream& out) {
  if (!std::filesystem::exists(file)) return;
  const Prints prints{file};
  std::map<double, std::array<double, 3>> by_print;  // time -> squares tracked, squares fixed, count
  for (std::size_t i = 0; i < prints.x.size(); ++i) {
    auto& sums = by_print[prints.time[i]];
    const Eigen::Vector2d fixed =
        Eigen::Vector2d{prints.jetted_x[i], prints.jetted_y[i]} -
        calibrated.offset(prints.height[i], {prints.velocity_x[i], prints.velocity_y[i]}) -
        calibrated.over_field({prints.nozzle_x[i], prints.nozzle_y[i]});
    sums[0] += prints.x[i] * prints.x[i] + prints.y[i] * prints.y[i];
    sums[1] += fixed.squaredNorm();
    sums[2] += 1.0;
  }
  Series tracked, fixed;
  tracked.label = "model that follows";
  fixed.label = "model of the calibration";
  for (const auto& [time, sums] : by_print) {
    tracked.x.push_back(time);
    fixed.x.push_back(time);
    tracked.y.push_back(1e6 * std::sqrt(sums[0] / sums[2]));
    fixed.y.push_back(1e6 * std::sqrt(sums[1] / sums[2]));
  }
  Plot plot;
  plot.title = "Distance from the target while the head drifts";
  plot.x_label = "t [s]";
  plot.y_label = "RMS [um]";
  out << "drift           last of " << by_print.size() << " prints " << number(tracked.y.back())
      << " um rms, " << number(fixed.y.back()) << " um without following\n";
  plot.series = {std::move(tracked), std::move(fixed)};
  page.heading("Drift while printing");
  page.plot(plot, "Each print is measured, and the model is moved on before the next.");
}

void add_pictures(const std::filesystem::path& folder, report::Page& page) {
  std::vector<std::filesystem::path> pictures;
  for (const auto& entry : std::filesystem::directory_iterator{folder}) {
    const std::string stem = entry.path().stem().string();
    if (entry.path().extension() == ".png" && (stem.starts_with("before_") || stem.starts_with("after_")))
      pictures.push_back(entry.path());
  }
  if (pictures.empty()) return;
  std::sort(pictures.begin(), pictures.end());
  std::reverse(pictures.begin(), pictures.end());  // before, then after
  page.heading("Seen by the camera");
  for (const auto& picture : pictures) {
    std::ifstream stream{picture, std::ios::binary};
    const std::vector<unsigned char> bytes{std::istreambuf_iterator<char>{stream}, {}};
    page.image(bytes, "image/png",
               picture.stem().string() + ": outlines as measured; arrows from each target to its droplet");
  }
}

bool holds_print(const std::filesystem::path& folder) {
  return std::filesystem::exists(folder / "droplets_after.csv") &&
         std::filesystem::exists(folder / "dispenser_compensation.yaml");
}

}  // namespace

void add_print_verdict(const std::filesystem::path& folder, report::Page& page) {
  if (!holds_print(folder)) return;
  const Prints before{folder / "droplets.csv"}, after{folder / "droplets_after.csv"};
  std::string text;
  bool better = true;
  for (const double height : before.heights()) {
    const Errors was = errors_at(before, height), is = errors_at(after, height);
    if (is.count == 0) continue;
    text += (text.empty() ? "Droplets now land, from " : "; from ") + si(height, "m") + ", " +
            si(is.rms, "m") + " RMS from their targets instead of " + si(was.rms, "m");
    better = better && is.rms < was.rms;
  }
  if (!text.empty()) page.callout(text + ".", better ? "good" : "bad");
}

void summarise_print(const std::filesystem::path& folder, report::Page& page, std::ostream& out) {
  if (!holds_print(folder)) return;
  const Prints before{folder / "droplets.csv"};
  const Prints after{folder / "droplets_after.csv"};
  const auto path = compensation::load_trajectory(folder / "dispenser_compensation.yaml");
  add_trajectory(path, page, out);

  page.heading("Droplets before and after (table 5.3)");
  std::vector<std::vector<std::string>> rows;
  for (const double height : before.heights()) {
    const Errors was = errors_at(before, height);
    const Errors is = errors_at(after, height);
    if (is.count == 0) continue;
    rows.push_back({si(height, "m"), std::to_string(was.count) + " / " + std::to_string(is.count),
                    si(was.rms, "m"), si(is.rms, "m"), number(100.0 * (1.0 - is.rms / was.rms), 3) + " %",
                    si(was.largest, "m"), si(is.largest, "m"), si(was.relative_rms, "m"),
                    si(is.relative_rms, "m")});
    out << "from " << std::left << std::setw(11) << si(height, "m") << si(was.rms, "m") << " before, "
        << si(is.rms, "m") << " after (rms from the target, " << is.count << " new droplets)\n";
  }
  page.table({"height", "droplets", "RMS before", "RMS after", "improvement", "largest before",
              "largest after", "to the first droplet: RMS before", "RMS after"},
             rows);
  page.plots({scatter(before, "Before"), scatter(after, "After, new droplets")});
  add_sizes({&before, &after}, page, out);
  add_drift(folder / "drift.csv", path, page, out);
  add_pictures(folder, page);
}

}  // namespace invar::tools

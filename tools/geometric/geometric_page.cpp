// The HTML page of a geometric calibration: what was found, how sure it is, what it leaves, what is still open.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/angle.hpp"
#include "core/base/index.hpp"
#include "tools/geometric/geometric_plots.hpp"
#include "tools/geometric/lines_used.hpp"

namespace invar::tools {

namespace {

using metrology::GeometricModel;
using report::number;
using report::Plot;
using report::Series;

void write_machine(report::Page& page, const GeometricResult& result) {
  const auto& machine = result.machine;
  std::string chain;
  for (int i = 0; i < machine.chain.axes; ++i)
    chain += (i > 0 ? ", " : "") + letter(machine.chain.order[index(i)]);
  std::vector<std::vector<std::string>> rows{{"chain, from the workpiece", chain}};
  for (int k = 0; k < 3; ++k)
    if (machine.chain.has(k))
      rows.push_back(
          {"travel of " + letter(k) + " [mm]", number(1e3 * machine.travel[index(k)].lower, 4) + " to " +
                                                   number(1e3 * machine.travel[index(k)].upper, 4)});
  rows.push_back({"tool offset [mm]", place(machine.tool)});
  page.table({"", ""}, rows);
}

void write_lines(report::Page& page, const GeometricResult& result) {
  const bool full = result.method == "full" && result.found.lines.size() > 1;
  std::vector<std::vector<std::string>> readings;
  std::vector<std::vector<std::string>> errors;
  for (std::size_t l = 0; l < result.found.lines.size(); ++l) {
    const auto& line = result.found.lines[l];
    const auto& noise = line.noise;
    readings.push_back({line.name, number(1e3 * line.beam.length, 4), std::to_string(noise.readings),
                        std::to_string(noise.outliers), std::to_string(noise.breaks.size()),
                        micro(noise.noise), micro(noise.reversal), micro(noise.drift)});
    const auto& f = result.figures[l];
    errors.push_back(
        {line.name, micro(f.before_rms), micro(f.before_max), micro(f.after_rms), micro(f.after_max)});
    if (full) errors.back().insert(errors.back().end(), {micro(f.unseen_rms), micro(f.unseen_max)});
  }
  page.table({"line", "length [mm]", "readings", "outliers", "beam breaks", "noise [um]", "reversal [um]",
              "drift [um]"},
             readings);
  std::vector<std::string> header{"line", "before RMS", "before max", "after RMS", "after max"};
  if (full) header.insert(header.end(), {"unseen RMS", "unseen max"});
  page.table(header, errors);
  if (full)
    page.paragraph(
        "Errors of displacement in um. \"Unseen\" is the line predicted from the others alone, as it would "
        "have "
        "been without measuring it.");
  std::vector<std::vector<std::string>> paths;
  for (std::size_t l = 0; l < result.found.lines.size(); ++l) {
    const auto& line = result.found.lines[l];
    if ((line.beam.direction.array().abs() > 1e-6).count() < 2) continue;
    const auto& f = result.figures[l];
    const double after = full ? f.unseen_max : f.after_max;
    const Eigen::Vector3d end = line.beam.start + line.beam.length * line.beam.direction;
    paths.push_back({line.name, place(line.beam.start), place(end), number(1e3 * line.beam.length, 4),
                     micro(f.before_max), micro(after),
                     number(100.0 * (1.0 - after / std::max(f.before_max, 1e-12)))});
  }
  if (!paths.empty())
    page.table({"diagonal", "from [mm]", "to [mm]", "range [mm]", "max error before [um]",
                full ? "max error after, not fitted [um]" : "max error after [um]", "improvement [%]"},
               paths);
  std::vector<Plot> plots;
  for (std::size_t l = 0; l < result.found.lines.size(); ++l) plots.push_back(line_plot(result, l));
  page.plots(std::move(plots),
             "Displacement error along each line: measured before compensation (points), the model (blue), "
             "left after it (green), and "
             "left after a compensation that never saw this line (dashed).");
}

void write_components(report::Page& page, const GeometricResult& result) {
  const GeometricModel& model = result.found.model;
  std::vector<std::vector<std::string>> rows;
  for (int pair = 0; pair < metrology::squareness_count; ++pair) {
    if (model.squareness_sigma[index(pair)] <= 0.0) continue;
    const double angle = metrology::squareness_angle_from_cosine(pair, model.squareness[index(pair)]);
    rows.push_back({std::string{metrology::squareness_iso_name(pair)},
                    std::string{metrology::squareness_thesis_symbol(pair)}, micro(angle, 5),
                    number(angle / arcsec, 5), micro(2.0 * model.squareness_sigma[index(pair)])});
  }
  page.table({"squareness", "thesis's symbol", "ISO [urad]", "[arcsec]", "2 sigma [urad]"}, rows);
  rows.clear();
  std::vector<Plot> plots;
  for (int c = 0; c < metrology::error_motion_count; ++c) {
    if (model.coefficients[index(c)].size() == 0) continue;
    plots.push_back(component_plot(result, c));
    const Range range = model.travel[index(metrology::axis_of(c))];
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -lowest;
    double sigma = 0.0;
    for (int i = 0; i <= 100; ++i) {
      const double q = range.lower + range.width() * i / 100.0;
      lowest = std::min(lowest, model.error_motion(c, q));
      highest = std::max(highest, model.error_motion(c, q));
      sigma = std::max(sigma, model.error_motion_sigma(c, q));
    }
    rows.push_back({std::string{metrology::iso_name(c)}, metrology::thesis_symbol(c), micro(lowest),
                    micro(highest), micro(2.0 * sigma), metrology::is_rotation(c) ? "urad" : "um"});
  }
  page.table({"component", "thesis's symbol", "lowest", "highest", "2 sigma at most", "unit"}, rows);
  page.plots(std::move(plots),
             "Each error motion with its two-sigma band; points: the fit plus what is left of each reading, "
             "over the "
             "motion's share in it. Zero at the origin of its axis; straightness "
             "without end-point slope, which is squareness.");
}

void write_knowledge(report::Page& page, const GeometricResult& result) {
  const auto& knowledge = result.knowledge;
  page.paragraph(
      "Expected RMS length of the remaining error vector over the volume, rigid motion of the frame "
      "removed: " +
      report::si(knowledge.volumetric_rms, "m") +
      " (before measuring: " + report::si(knowledge.volumetric_rms_prior, "m") + ").");
  if (knowledge.unidentified.empty()) page.callout("The lines identify every component.", "good");
  for (const auto& one : knowledge.unidentified) page.callout(one.words(), "warn");
  if (!result.next.empty()) {
    std::vector<std::vector<std::string>> rows;
    for (const auto& next : result.next) {
      rows.push_back(
          {next.line.name, place(next.line.from), place(next.line.to), report::si(next.volumetric_rms, "m")});
    }
    page.paragraph(result.method == "full"
                       ? "The next lines that would help most:"
                       : "The next lines that would help most, all lines at once (--method full):");
    page.table({"line", "from [mm]", "to [mm]", "expected with it"}, rows);
  }
  draw_variance_left(page, knowledge, "known to");
}

/// Accuracy against data interval, from the same readings thinned.
void write_intervals(report::Page& page, const GeometricResult& result) {
  page.heading("Data interval");
  Series expected = series("expected over the volume", Series::Style::line, "#1f5fa8");
  Series on_points = series("on all points, those left out included", Series::Style::dashed, "#2e8b57");
  std::vector<std::vector<std::string>> rows;
  for (const auto& one : result.intervals) {
    rows.push_back({report::si(one.interval, "m"), std::to_string(one.points),
                    report::si(one.points_rms, "m"), number(1e7 * one.integral),
                    report::si(one.expected_rms, "m")});
    expected.x.push_back(1e3 * one.interval);
    expected.y.push_back(1e6 * one.expected_rms);
    on_points.x.push_back(1e3 * one.interval);
    on_points.y.push_back(1e6 * one.points_rms);
  }
  if (const auto* chosen = interval_to_choose(result))
    page.callout("Choose " + report::si(chosen->interval, "m") +
                     ": the coarsest interval that costs at most a tenth of the accuracy.",
                 "good");
  page.table({"interval", "points used", "RMS on all points", "integral on the longest line [1e-7 m2]",
              "expected over the volume"},
             rows);
  Plot plot;
  plot.title = "accuracy against data interval";
  plot.x_label = "interval [mm]";
  plot.y_label = "RMS [um]";
  plot.series = {expected, on_points};
  page.plot(std::move(plot));
}

}  // namespace

report::Page report_page(const GeometricResult& result) {
  const auto& found = result.found;
  report::Page page{"Geometric calibration", result.lines_file.filename().string() + " on " +
                                                 result.machine_file.filename().string() + ", method " +
                                                 result.method};
  const report::LeftOut left_out = lines_used(result.found, result.input);
  page.callout(
      "Error of displacement on the lines: " + report::si(result.before_rms, "m") + " before, " +
          report::si(result.after_rms, "m") + " after" +
          (result.unseen_rms > 0.0 ? ", " + report::si(result.unseen_rms, "m") + " on lines not fitted"
                                   : "") +
          " (RMS)",
      left_out.unexplained.empty() ? "good" : "warn");
  page.paragraph(std::to_string(found.lines.size()) + " lines, " + std::to_string(result.input.rows) +
                 " readings; noise of one reading " + report::si(found.noise, "m") +
                 ", what no smooth model explains " + report::si(found.misfit, "m") + ".");
  if (const std::string words = temperature_words(result); !words.empty())
    page.paragraph("Temperature" + words.substr(std::string{"temperature"}.size()) + ".");
  if (const std::string words = wave_words(found); !words.empty())
    page.paragraph("Periodic error, as of a screw: " + words +
                   ". Each is in the curve of its axis' positioning.");
  for (const auto& one : result.drifts)
    page.paragraph("Drift at one point, line " + one.line + ": range " + report::si(one.range, "m") +
                   ", end minus start " + report::si(one.end, "m") + ", in " + std::to_string(one.readings) +
                   " readings (ISO 230-3).");
  for (const auto& name : result.input.repeated)
    page.callout("Line " + name + " holds the very readings of another line: it was left out.", "warn");
  if (result.input.far_off > 0)
    page.callout(std::to_string(result.input.far_off) + " readings far off were left out.", "warn");
  report::show(page, left_out);
  page.heading("Machine");
  write_machine(page, result);
  page.heading("Identified and unidentified error motions");
  write_knowledge(page, result);
  page.heading("Lines");
  write_lines(page, result);
  page.heading("Components");
  write_components(page, result);
  std::vector<Plot> reversals;
  for (int k = 0; k < 3; ++k)
    if (!found.model.reversal[index(k)].empty()) reversals.push_back(reversal_plot(found.model, k));
  if (!reversals.empty())
    page.plots(std::move(reversals),
               "Where an axis stands after moving forward, less where after moving backward, with the "
               "two-sigma band. "
               "Half of it lies to either side of the curves above.");
  for (const auto& note : result.not_judged) page.callout(note + ".", "warn");
  write_motions(page, result.motions, result.tolerances);
  write_positioning(page, result.tests, result.tolerances);
  write_diagonals(page, result.diagonals);
  if (found.model.chain.axes > 1)
    page.plots(
        field_plots(found.model),
        "Error field at the middle of the axis that is not shown. The rigid motion of the plane, which "
        "displacements cannot see, is taken out.");
  page.heading("Residuals");
  page.plot(residual_histogram(result));
  if (!result.intervals.empty()) {
    write_intervals(page, result);
  }
  return page;
}

}  // namespace invar::tools

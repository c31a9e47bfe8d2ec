// The page of a measuring plan: what to set up at the machine, and what to expect of it.
#include <algorithm>
#include <cmath>

#include "tools/geometric/geometric_plots.hpp"
#include "tools/geometric/measuring_plan.hpp"

namespace invar::tools {

namespace {

using metrology::PlannedLine;
using report::number;
using report::Plot;
using report::Series;
using report::si;

std::string minutes(double value) {
  const long whole = std::lround(value);
  return std::to_string(whole / 60) + " h " + std::to_string(whole % 60) + " min";
}
double length_of(const PlannedLine& line) { return (line.to - line.from).norm(); }

/// The lines that lie in the plane of two axes, at whatever height; those that move all three are left to the table.
Plot plane_plot(const MeasuringPlan& plan, int a, int b) {
  const int rest = 3 - a - b;
  const bool space = plan.machine.chain.has(rest);
  Plot plot;
  plot.title = letter(a) + letter(b) + " plane";
  plot.x_label = letter(a) + " [mm]";
  plot.y_label = letter(b) + " [mm]";
  plot.equal_axes = true;
  plot.width = 480;
  plot.height = 460;
  for (std::size_t i = 0; i < plan.best->lines.size(); ++i) {
    const PlannedLine& line = plan.best->lines[i];
    const Eigen::Vector3d way = line.to - line.from;
    if (std::abs(way[rest]) > 1e-6) continue;
    Series drawn;
    drawn.label = std::to_string(i + 1);
    if (space) drawn.label += ", " + letter(rest) + " = " + number(1e3 * line.from[rest], 4);
    const bool below = plan.machine.travel[static_cast<std::size_t>(rest)].lower + 1e-6 >= line.from[rest];
    drawn.style = !space || below ? Series::Style::line : Series::Style::dashed;
    drawn.x = {1e3 * line.from[a], 1e3 * line.to[a]};
    drawn.y = {1e3 * line.from[b], 1e3 * line.to[b]};
    plot.series.push_back(std::move(drawn));
  }
  const auto widened = [&](int axis) {
    const Range r = plan.machine.travel[static_cast<std::size_t>(axis)];
    return Range{1e3 * (r.lower - 0.1 * r.width()), 1e3 * (r.upper + 0.1 * r.width())};
  };
  plot.x_range = widened(a);
  plot.y_range = widened(b);
  return plot;
}

void write_lines(report::Page& page, const MeasuringPlan& plan) {
  const PlanChoice& best = *plan.best;
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < best.lines.size(); ++i) {
    const PlannedLine& line = best.lines[i];
    const Eigen::Vector3d beam = (line.to - line.from).normalized();
    const int points = metrology::points_of(line, best.effort.interval);
    auto others = best.lines;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const auto without = metrology::expect(plan.machine, others, best.effort, plan.prior, plan.misfit);
    rows.push_back({std::to_string(i + 1), line.name, place(line.from), place(line.to),
                    number(1e3 * length_of(line), 6), std::to_string(points),
                    number(1e3 * length_of(line) / (points - 1), 5),
                    number(beam.x(), 5) + ", " + number(beam.y(), 5) + ", " + number(beam.z(), 5),
                    si(without.knowledge.volumetric_rms, "m")});
  }
  page.table({"", "line", "from [mm]", "to [mm]", "length [mm]", "points", "step [mm]", "beam",
              "expected without it"},
             rows);
  std::vector<Plot> plots;
  for (int a = 0; a < 3; ++a)
    for (int b = a + 1; b < 3; ++b)
      if (plan.machine.chain.has(a) && plan.machine.chain.has(b)) plots.push_back(plane_plot(plan, a, b));
  page.plots(std::move(plots),
             "The lines by their number, dashed where they lie off the third axis' origin; one that moves "
             "all axes stands only in the table. \"Expected "
             "without it\" is what would be left of the volume if that line could not be set up.");
}

void write_instructions(report::Page& page, const MeasuringPlan& plan) {
  const PlanChoice& best = *plan.best;
  const Eigen::Vector3d& tool = best.lines.front().tool;
  const auto longest = *std::max_element(
      best.lines.begin(), best.lines.end(),
      [](const PlannedLine& a, const PlannedLine& b) { return length_of(a) < length_of(b); });
  const auto shortest = *std::min_element(
      best.lines.begin(), best.lines.end(),
      [](const PlannedLine& a, const PlannedLine& b) { return length_of(a) < length_of(b); });
  // A beam that runs s sideways over the length L reads s^2 / (2 L) too little
  // (docs/explanation/geometric.md#reading-of-a-displacement-line).
  const double bearable = 0.1 * best.expected_rms();
  page.paragraph(
      "Positions are commanded ones in the machine's frame, without compensation. The reflector stands at " +
      place(tool) + " mm from the reference point of the tool.");
  page.paragraph(
      "Lay the beam along the way from the first to the last commanded point. Its sideways offset over "
      "the line shortens the reading: to stay below " +
      si(bearable, "m") + ", at most " + si(std::sqrt(2.0 * length_of(shortest) * bearable), "m") +
      " on the shortest line (" + shortest.name + ") and " +
      si(std::sqrt(2.0 * length_of(longest) * bearable), "m") + " on the longest (" + longest.name + ").");
  page.paragraph(
      "Zero the laser once, at the first point, and do not touch it until the line is done. Go to each "
      "point, "
      "wait until it stands, read; " +
      std::to_string(best.effort.passes) +
      " passes, forward and backward in turn. Reversal, drift, beam breaks, outliers and missing "
      "readings are found and need no care; note the temperature where it changes.");
  page.paragraph("Write one row a reading, in the order of measurement:");
  const PlannedLine& first = best.lines.front();
  const Eigen::Vector3d second =
      first.from + (first.to - first.from) / (metrology::points_of(first, best.effort.interval) - 1);
  const auto row = [&](const Eigen::Vector3d& p, const char* reading) {
    return "\n" + first.name + "," + number(p.x(), 6) + "," + number(p.y(), 6) + "," + number(p.z(), 6) +
           "," + reading + ",1,20.0";
  };
  page.preformatted(
      "line,x [m],y [m],z [m],displacement [m],direction,temperature [degC]" + row(first.from, "0") +
      row(second,
          number(length_of(first) / (metrology::points_of(first, best.effort.interval) - 1), 6).c_str()) +
      "\n...\n\ninvar calibrate geometric --machine " + plan.machine_file.filename().string() +
      " --lines lines.csv --out result");
}

void write_expectation(report::Page& page, const MeasuringPlan& plan) {
  const PlanChoice& best = *plan.best;
  const auto& knowledge = best.expectation.knowledge;
  if (knowledge.unidentified.empty())
    page.callout("The lines show every component that moves this machine's tool.", "good");
  for (const auto& open : knowledge.unidentified) page.callout("Left open: " + open.words(), "warn");
  draw_variance_left(page, knowledge, "to");
  const auto others = metrology::other_lines(plan.machine, best.lines);
  std::vector<std::pair<double, const PlannedLine*>> checks;
  for (const PlannedLine& line : others)
    checks.emplace_back(metrology::expected_left(best.expectation, line, best.effort.interval), &line);
  std::sort(checks.begin(), checks.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  if (checks.empty()) return;
  page.paragraph(
      "Check the result on a line that was not used. These of the usual ones are the least certain. "
      "From start to end they should read about this after compensation (RMS over the line, beside the "
      "noise):");
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < std::min<std::size_t>(3, checks.size()); ++i)
    rows.push_back({checks[i].second->name, place(checks[i].second->from), place(checks[i].second->to),
                    si(checks[i].first, "m")});
  page.table({"line", "from [mm]", "to [mm]", "expected after compensation"}, rows);
}

void write_choices(report::Page& page, const MeasuringPlan& plan) {
  std::vector<std::vector<std::string>> rows;
  Plot plot;
  plot.title = "accuracy against time";
  plot.x_label = "time at the machine [h]";
  plot.y_label = "expected RMS [um]";
  for (const PlanChoice& choice : plan.choices) {
    rows.push_back(
        {std::to_string(choice.lines.size()), choice.searched ? "searched" : "recipe",
         number(1e3 * choice.effort.interval, 4), std::to_string(choice.effort.passes),
         std::to_string(choice.expectation.readings), minutes(choice.minutes), si(choice.expected_rms(), "m"),
         &choice == plan.best ? "proposed" : (choice.expected_rms() <= plan.accuracy ? "enough" : "")});
    const std::string label =
        std::to_string(choice.lines.size()) + (choice.searched ? " searched lines" : " lines");
    if (plot.series.empty() || plot.series.back().label != label) {
      plot.series.emplace_back();
      plot.series.back().label = label;
      plot.series.back().style = Series::Style::points;
    }
    plot.series.back().x.push_back(choice.minutes / 60.0);
    plot.series.back().y.push_back(1e6 * choice.expected_rms());
  }
  page.plot(std::move(plot));
  page.table({"lines", "", "step [mm]", "passes", "readings", "time", "expected RMS", ""}, rows);
}

void write_assumptions(report::Page& page, const MeasuringPlan& plan) {
  std::vector<std::vector<std::string>> rows;
  std::string chain;
  for (int i = 0; i < plan.machine.chain.axes; ++i)
    chain += (i > 0 ? ", " : "") + letter(plan.machine.chain.order[static_cast<std::size_t>(i)]);
  rows.push_back({"chain, from the workpiece", chain});
  for (int k = 0; k < 3; ++k) {
    const Range r = plan.machine.travel[static_cast<std::size_t>(k)];
    if (plan.machine.chain.has(k))
      rows.push_back(
          {"travel of " + letter(k), number(1e3 * r.lower, 5) + " to " + number(1e3 * r.upper, 5) + " mm"});
  }
  rows.push_back({"noise of one reading", si(plan.noise, "m")});
  if (plan.pilot.empty()) {
    rows.push_back({"positioning and straightness, RMS about the best line", si(plan.motions, "m")});
    rows.push_back({"angles, RMS about the best line", si(plan.angles, "rad")});
  } else {
    rows.push_back({"noise and error motions", "as found in " + plan.pilot.filename().string()});
  }
  rows.push_back({"time to set up a line, to read a point",
                  number(plan.setup_minutes) + " min, " + number(plan.reading_seconds) + " s"});
  page.table({"", ""}, rows);
  page.paragraph("The expectation is as good as these figures" +
                 std::string{plan.pilot.empty()
                                 ? "; a few lines measured first (--pilot) replace the assumed ones"
                                 : ""} +
                 ".");
}

}  // namespace

report::Page plan_page(const MeasuringPlan& plan) {
  const PlanChoice& best = *plan.best;
  report::Page page{"Measuring plan", plan.machine_file.filename().string() + ", wanted " +
                                          si(plan.accuracy, "m") + " over the volume"};
  page.callout("Measure " + std::to_string(best.lines.size()) + " lines every " +
                   number(1e3 * best.effort.interval, 4) + " mm in " + std::to_string(best.effort.passes) +
                   " passes: expect " + si(best.expected_rms(), "m") +
                   " over the volume (RMS length of the error vector, rigid motion removed), in " +
                   minutes(best.minutes),
               "good");
  page.heading("Lines");
  write_lines(page, plan);
  page.heading("At the machine");
  write_instructions(page, plan);
  page.heading("Expected result, and error motions that stay open");
  write_expectation(page, plan);
  page.heading("Weighed against each other");
  write_choices(page, plan);
  page.heading("Assumed");
  write_assumptions(page, plan);
  return page;
}

}  // namespace invar::tools

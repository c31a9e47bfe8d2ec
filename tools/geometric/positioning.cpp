#include "tools/geometric/positioning.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <ostream>

#include "core/base/angle.hpp"

namespace invar::tools {

namespace {

using metrology::iso230_figures;
using metrology::iso230_names;
using metrology::Iso230Figure;
using metrology::TargetFigures;
using metrology::TargetReadings;
using report::number;

constexpr std::size_t most_targets = 500;  // a capture on the fly is no test of targets
constexpr double target_cell = 1e-7;       // m or rad, commanded positions nearer than this are one target

/// EXX, EYY, EZZ: what the standard is written for.
bool is_positioning(const PositioningTest& test) {
  return test.motion.size() == 3 && test.motion[1] == test.motion[2];
}

std::string title_of(const PositioningTest& test) {
  const std::string along = test.line.empty() ? "" : ", line " + test.line;
  if (!test.motion.empty())
    return test.motion + (is_positioning(test) ? " (ISO 230-2)" : " (formulas of ISO 230-2)");
  return test.axis.empty() ? "Diagonal " + test.line + " (ISO 230-6)"
                           : "Axis " + test.axis + along + " (ISO 230-2)";
}

const char* small_unit(const PositioningTest& test) { return test.unit == "rad" ? "arcsec" : "um"; }
const char* place_unit(const PositioningTest& test) { return test.place_unit == "rad" ? "deg" : "mm"; }
double small(const PositioningTest& test, double value) {
  return value / (test.unit == "rad" ? arcsec : 1e-6);
}
double place(const PositioningTest& test, double value) {
  return value * (test.place_unit == "rad" ? 1.0 / degree : 1e3);
}
std::string shown(const PositioningTest& test, double value, int digits = 4) {
  return micro_or_arcsec(value, test.unit, digits);
}

std::string words(const PositioningTest& test, const Tolerance& tolerance) {
  const auto figure = static_cast<std::size_t>(*tolerance.figure);
  return verdict_words(std::string{iso230_names[figure]}, test.figures.values[figure],
                       test.figures.uncertainty[figure], tolerance.limit, test.unit);
}

report::Plot plot_of(const PositioningTest& test) {
  report::Plot plot;
  plot.title = title_of(test);
  plot.x_label = std::string{"target ["} + place_unit(test) + "]";
  plot.y_label = std::string{"deviation ["} + small_unit(test) + "]";
  const auto curve = [&](const std::string& label, const std::string& colour, auto mean, auto s) {
    report::Series band{"", report::Series::Style::band, {}, {}, {}, {}, colour};
    report::Series line{label, report::Series::Style::line, {}, {}, {}, {}, colour};
    for (const TargetFigures& one : test.figures.targets) {
      if (std::isnan(mean(one))) continue;
      line.x.push_back(place(test, one.position));
      line.y.push_back(small(test, mean(one)));
      if (std::isnan(s(one))) continue;
      band.x.push_back(place(test, one.position));
      band.y.push_back(small(test, mean(one) - 2.0 * s(one)));
      band.u.push_back(small(test, mean(one) + 2.0 * s(one)));
    }
    if (!band.x.empty()) plot.series.push_back(std::move(band));
    if (!line.x.empty()) plot.series.push_back(std::move(line));
  };
  const auto none = [](const TargetFigures&) { return std::nan(""); };
  curve(
      "forward", "#1f5fa8", [](const TargetFigures& t) { return t.mean_forward; },
      [](const TargetFigures& t) { return t.s_forward; });
  curve(
      "backward", "#c0552d", [](const TargetFigures& t) { return t.mean_backward; },
      [](const TargetFigures& t) { return t.s_backward; });
  curve(
      "mean", "#2e8b57", [](const TargetFigures& t) { return t.mean; }, none);
  return plot;
}

void write_test(report::Page& page, const PositioningTest& test) {
  page.plot(plot_of(test), "Means of each direction with two standard deviations to either side.");
  std::vector<std::vector<std::string>> rows;
  for (const TargetFigures& one : test.figures.targets)
    rows.push_back({number(place(test, one.position), 7), shown(test, one.mean_forward),
                    shown(test, one.mean_backward), shown(test, one.mean), shown(test, one.reversal),
                    shown(test, one.s_forward), shown(test, one.s_backward),
                    shown(test, one.repeatability_forward), shown(test, one.repeatability_backward),
                    shown(test, one.repeatability)});
  page.table({std::string{"target ["} + place_unit(test) + "]", "mean forward", "mean backward", "mean both",
              "reversal B", "s forward", "s backward", "R forward", "R backward", "R both"},
             rows);
  rows.clear();
  for (std::size_t f = 0; f < iso230_figures; ++f)
    if (!std::isnan(test.figures.values[f]))
      rows.push_back({std::string{iso230_names[f]}, shown(test, test.figures.values[f]),
                      shown(test, test.figures.uncertainty[f], 2)});
  page.table({"figure", std::string{"value ["} + small_unit(test) + "]", "expanded uncertainty, k = 2"},
             rows);
}

/// The axis [0..2] that a beam runs along, or -1.
int axis_along(const Eigen::Vector3d& direction) {
  for (int k = 0; k < 3; ++k)
    if (std::abs(direction[k]) > 0.999999) return k;
  return -1;
}

}  // namespace

std::optional<PositioningTest> test_of(const std::string& axis, std::vector<TargetReadings> targets,
                                       const metrology::Iso230Conditions& conditions) {
  if (targets.size() < 2 || targets.size() > most_targets) return std::nullopt;
  std::size_t least = SIZE_MAX;
  for (const TargetReadings& one : targets)
    least = std::min(least, std::max(one.forward.size(), one.backward.size()));
  if (least < 2) return std::nullopt;
  PositioningTest test;
  test.axis = axis;
  test.cycles = static_cast<int>(least);
  test.figures = metrology::iso230(targets, conditions);
  return test;
}

std::optional<PositioningTest> test_of(const metrology::DisplacementLine& line,
                                       const metrology::Iso230Conditions& conditions) {
  const auto beam = metrology::beam_of(line);
  if (beam.length == 0.0) return std::nullopt;
  const int axis = axis_along(beam.direction);
  // A beam that points backward along its axis turns position, deviation and sense of motion.
  const double sign = axis >= 0 && beam.direction[axis] < 0.0 ? -1.0 : 1.0;
  std::map<long, TargetReadings> targets;
  for (const metrology::Reading& reading : line.readings) {
    const double way = beam.direction.dot(reading.position + reading.tool - beam.start - beam.start_tool);
    const double at = axis >= 0 ? reading.position[axis] : way;
    TargetReadings& one = targets[std::lround(at / target_cell)];
    one.position = at;
    (sign * reading.direction > 0.0 ? one.forward : one.backward)
        .push_back(sign * (reading.displacement - way));
  }
  std::vector<TargetReadings> all;
  for (auto& [key, one] : targets) all.push_back(std::move(one));
  auto test = test_of(axis >= 0 ? std::string(1, "XYZ"[axis]) : "", std::move(all), conditions);
  if (test) test->line = line.name;
  if (test) test->span = beam.length * beam.direction;
  return test;
}

std::vector<TargetReadings> targets_of(const metrology::ErrorMotionReadings& readings) {
  std::map<long, TargetReadings> targets;
  for (Eigen::Index i = 0; i < readings.position.size(); ++i) {
    TargetReadings& one = targets[std::lround(readings.position[i] / target_cell)];
    one.position = readings.position[i];
    const bool forward = readings.direction.empty() || readings.direction[static_cast<std::size_t>(i)] > 0;
    (forward ? one.forward : one.backward).push_back(readings.value[i]);
  }
  std::vector<TargetReadings> result;
  for (auto& [key, one] : targets) result.push_back(std::move(one));
  return result;
}

std::vector<Tolerance> tolerances_of(const PositioningTest& test, const std::vector<Tolerance>& all) {
  const std::string motion =
      test.motion.empty() && !test.axis.empty() ? "E" + test.axis + test.axis : test.motion;
  std::vector<Tolerance> result;
  for (const Tolerance& one : all)
    if (one.figure && one.unit == test.unit && (one.motion.empty() || one.motion == motion))
      result.push_back(one);
  return result;
}

Verdict verdict_of(const PositioningTest& test, const Tolerance& tolerance) {
  const auto figure = static_cast<std::size_t>(*tolerance.figure);
  return verdict_of(test.figures.values[figure], test.figures.uncertainty[figure], tolerance.limit);
}

nlohmann::json positioning_json(const std::vector<PositioningTest>& tests,
                                const std::vector<Tolerance>& tolerances) {
  nlohmann::json list = nlohmann::json::array();
  const auto value = [](double v) { return std::isnan(v) ? nlohmann::json{} : nlohmann::json(v); };
  for (const PositioningTest& test : tests) {
    const bool diagonal = test.axis.empty() && test.motion.empty();
    nlohmann::json one{{"standard", diagonal ? "ISO 230-6" : "ISO 230-2"},
                       {"line", test.line},
                       {"axis", test.axis},
                       {"cycles", test.cycles},
                       {"unit", test.unit}};
    if (!test.motion.empty()) one["motion"] = test.motion;
    for (std::size_t f = 0; f < iso230_figures; ++f) {
      one[std::string{iso230_names[f]}] = value(test.figures.values[f]);
      one["expanded_uncertainty"][std::string{iso230_names[f]}] = value(test.figures.uncertainty[f]);
    }
    for (const TargetFigures& t : test.figures.targets)
      one["targets"].push_back({{"position", t.position},
                                {"mean_forward", value(t.mean_forward)},
                                {"mean_backward", value(t.mean_backward)},
                                {"mean", value(t.mean)},
                                {"B", value(t.reversal)},
                                {"s_forward", value(t.s_forward)},
                                {"s_backward", value(t.s_backward)},
                                {"R_forward", value(t.repeatability_forward)},
                                {"R_backward", value(t.repeatability_backward)},
                                {"R", value(t.repeatability)}});
    for (const Tolerance& tolerance : tolerances_of(test, tolerances)) {
      const Verdict verdict = verdict_of(test, tolerance);
      one["tolerances"].push_back({{"figure", iso230_names[static_cast<std::size_t>(*tolerance.figure)]},
                                   {"limit", tolerance.limit},
                                   {"verdict", verdict_name(verdict)}});
    }
    list.push_back(std::move(one));
  }
  return list;
}

void write_positioning(report::Page& page, const std::vector<PositioningTest>& tests,
                       const std::vector<Tolerance>& tolerances) {
  if (tests.empty()) return;
  page.heading("Accuracy and repeatability of positioning");
  page.paragraph(
      "By ISO 230-2 and, along diagonals, ISO 230-6. All readings count, outliers too; positions and "
      "deviations as "
      "read, before any compensation. The expanded uncertainty (k = 2) holds the chance of these readings, "
      "the "
      "instrument's scale and the surroundings as given. Pass and fail by ISO 14253-1.");
  for (const PositioningTest& test : tests) {
    for (const Tolerance& tolerance : tolerances_of(test, tolerances)) {
      const Verdict verdict = verdict_of(test, tolerance);
      page.callout(title_of(test) + ": " + words(test, tolerance), callout_of(verdict));
    }
    write_test(page, test);
  }
}

void print_positioning(const std::vector<PositioningTest>& tests, const std::vector<Tolerance>& tolerances,
                       std::ostream& out) {
  for (const PositioningTest& test : tests) {
    const auto own = tolerances_of(test, tolerances);
    if (test.axis.empty() && test.motion.empty() && own.empty()) continue;
    out << title_of(test) << ":";
    const auto show = [&](std::initializer_list<Iso230Figure> figures) {
      bool any = false;
      for (const Iso230Figure figure : figures) {
        const auto f = static_cast<std::size_t>(figure);
        if (std::isnan(test.figures.values[f])) continue;
        out << ' ' << iso230_names[f] << ' ' << shown(test, test.figures.values[f]);
        any = true;
      }
      return any;
    };
    using enum Iso230Figure;
    if (!show({A, R, E, M, B}))  // read in one direction
      (void)show({A_forward, A_backward, R_forward, R_backward, E_forward, E_backward});
    out << ' ' << small_unit(test) << '\n';
    for (const Tolerance& tolerance : own) out << "  " << words(test, tolerance) << '\n';
  }
}

}  // namespace invar::tools

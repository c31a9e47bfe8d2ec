#include "tools/geometric/rotary.hpp"
#include "core/base/angle.hpp"
#include "tools/calibration/predict.hpp"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <optional>
#include <set>

#include "core/compensation/rotary_file.hpp"
#include "core/recording/table.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/geometric/positioning.hpp"
#include "tools/geometric/rotary_readings.hpp"
#include "tools/report/left_out.hpp"

namespace invar::tools {

namespace {

using metrology::ErrorMotionReadings;
using metrology::RotaryFit;
using report::number;

constexpr std::size_t least_places = 4;

std::string arcsec_text(double value, int digits = 3) { return number(value / arcsec, digits) + " arcsec"; }

/// What the readings of one axis gave; figures, model or both.
struct RotaryResult {
  RotaryReadings input;
  std::optional<PositioningTest> test;
  std::optional<RotaryFit> fit;
  std::vector<std::string> notes;
  std::string motion;  // "ECC"
};

std::optional<RotaryFit> fit_of(const RotaryOptions& options, const RotaryReadings& input,
                                const std::optional<Range>& travel) {
  ErrorMotionReadings readings = input.readings;
  std::set<long> places;
  for (const double position : readings.position) places.insert(std::lround(position * 1e6));
  if (readings.position.size() < metrology::least_error_motion_readings || places.size() < least_places)
    return std::nullopt;
  const Range read{readings.position.minCoeff(), readings.position.maxCoeff()};
  if (travel && (read.lower < travel->lower - 0.1 * travel->width() ||
                 read.upper > travel->upper + 0.1 * travel->width()))
    throw InputError{options.lines.string() + ": column `" + options.axis + "`",
                     "reaches from " + number(read.lower / degree, 6) + " to " +
                         number(read.upper / degree, 6) + " degrees, outside the travel of the axis",
                     "check the unit, or the travel in " + options.machine.string()};
  const auto& ways = readings.direction;
  if (std::adjacent_find(ways.begin(), ways.end(), std::not_equal_to<>{}) == ways.end())
    readings.direction.clear();  // one direction alone: no reversal
  return metrology::identify_rotary(options.axis[0], readings, travel.value_or(read));
}

report::LeftOut rows_of(const RotaryResult& result) {
  report::LeftOut rows;
  const ErrorMotionReadings& readings = result.input.readings;
  const auto used = static_cast<std::size_t>(readings.position.size());
  rows.given = result.input.given;
  rows.used = used;
  rows.unit = "rad";
  rows.header = {"angle", "reading", "from the model"};
  rows.reasons = {{result.input.given - used, "with an empty cell"}};
  if (!result.fit) return rows;
  const auto& fit = result.fit->fit;
  rows.used -= fit.rejected;
  rows.reasons.push_back({fit.rejected, "more than five robust deviations off (they count in the figures)"});
  std::vector<double> kept;
  for (std::size_t i = 0; i < fit.rest.size(); ++i) {
    if (fit.kept[i]) {
      kept.push_back(fit.rest[i]);
      continue;
    }
    const auto row = static_cast<Eigen::Index>(i);
    rows.rows.push_back({number(readings.position[row] / degree, 6) + " deg",
                         arcsec_text(readings.value[row]), arcsec_text(fit.rest[i])});
  }
  rows.rms_used = report::rms_of(kept);
  rows.rms_all = report::rms_of(fit.rest);
  return rows;
}

report::Plot plot_of(const RotaryResult& result) {
  const ErrorMotionReadings& readings = result.input.readings;
  const auto& axis = result.fit->axis;
  report::Plot plot;
  plot.title = result.motion + ": readings and model";
  plot.x_label = "angle [deg]";
  plot.y_label = "deviation [arcsec]";
  const auto cloud = [&](const std::string& label, const std::string& colour, int way) {
    report::Series points{label, report::Series::Style::points, {}, {}, {}, {}, colour};
    for (Eigen::Index i = 0; i < readings.position.size(); ++i) {
      if (readings.direction[static_cast<std::size_t>(i)] != way) continue;
      points.x.push_back(readings.position[i] / degree);
      points.y.push_back(readings.value[i] / arcsec);
    }
    if (!points.x.empty()) plot.series.push_back(std::move(points));
  };
  cloud("read forward", "#1f5fa8", 1);
  cloud("read backward", "#c0552d", -1);
  const Range shown{axis.travel.lower / degree, axis.travel.upper / degree};
  const auto curve = [&](const std::string& label, const std::string& colour, double way) {
    report::add_curve(plot, shown, label, colour, [&](double at) {
      return report::CurvePoint{axis.value(at * degree, way) / arcsec, axis.sigma(at * degree, way) / arcsec};
    });
  };
  if (axis.reversal.empty()) {
    curve("model", "#2e8b57", 0.0);
  } else {
    curve("model forward", "#1f5fa8", 1.0);
    curve("model backward", "#c0552d", -1.0);
  }
  return plot;
}

/// The model in words: on the page and on the console.
std::string model_words(const RotaryResult& result) {
  const auto& [axis, fit] = *result.fit;
  std::string words = result.motion + " from " + number(axis.travel.lower / degree, 6) + " to " +
                      number(axis.travel.upper / degree, 6) + " deg" +
                      (axis.comes_round ? ", whole turns are one place" : "") + ": known to " +
                      arcsec_text(axis.error.sigma, 2) + " (1 sigma), readings left out met to " +
                      arcsec_text(fit.left_out, 2);
  if (axis.reversal.empty()) return words + "; read in one direction, so no reversal is known";
  return words + "; reversal " + arcsec_text(axis.reversal.mean()) + " in the mean";
}

void write_model(report::Page& page, const RotaryResult& result) {
  if (!result.fit) return;
  page.heading("Error over the angle");
  page.paragraph(model_words(result) + ".");
  page.plot(plot_of(result), "Bands are two standard deviations of the model.");
}

nlohmann::json json_of(const RotaryResult& result, const std::vector<PositioningTest>& tests,
                       const std::vector<Tolerance>& tolerances) {
  nlohmann::json json{{"kind", "rotary"}, {"axis", result.motion}, {"notes", result.notes}};
  json["unidentified"] = nlohmann::json::array();
  json["positioning"] = positioning_json(tests, tolerances);
  json["rows"] = report::json_of(rows_of(result));
  if (!result.fit) {
    json["unidentified"].push_back(result.motion);
    return json;
  }
  const auto& [axis, fit] = *result.fit;
  json["model"] = {{"unit", "rad"},
                   {"travel", {axis.travel.lower, axis.travel.upper}},
                   {"comes_round", axis.comes_round},
                   {"sigma", axis.error.sigma},
                   {"noise", fit.noise},
                   {"left_out_rms", fit.left_out}};
  if (!axis.reversal.empty()) json["model"]["reversal_mean"] = axis.reversal.mean();
  return json;
}

/// Means by target and direction, for whoever has a table of his own to fill.
recording::Table deviations(const RotaryOptions& options, const RotaryResult& result) {
  const auto figures =
      result.test ? result.test->figures : metrology::iso230(targets_of(result.input.readings));
  std::vector<double> position, forward, backward, mean;
  for (const auto& one : figures.targets) {
    position.push_back(one.position);
    forward.push_back(one.mean_forward);
    backward.push_back(one.mean_backward);
    mean.push_back(one.mean);
  }
  recording::Table table;
  table.add(options.axis, "rad", position);
  table.add("deviation_forward", "rad", forward);
  table.add("deviation_backward", "rad", backward);
  table.add("deviation", "rad", mean);
  return table;
}

}  // namespace

void calibrate_rotary(const RotaryOptions& options) {
  const auto travel = rotary_travel(options.machine, options.axis);
  const auto tolerances = read_tolerances(options.tolerances, true);
  const std::string letter(1, static_cast<char>(options.axis[0] - 'a' + 'A'));
  RotaryResult result;
  result.motion = "E" + letter + letter;
  result.input = read_rotary_readings(options.lines, options.axis);
  result.test = test_of(letter, targets_of(result.input.readings), {options.device, options.environment});
  result.fit = fit_of(options, result.input, travel);
  if (!result.test && !result.fit)
    throw InputError{options.lines.string(),
                     "has no target that was read twice in one direction, or only one target",
                     "read each target in two cycles at least, or eight angles for a model"};
  if (!result.test)
    result.notes.push_back("No figures of ISO 230-2: no target was read twice in one direction.");
  if (!result.fit)
    result.notes.push_back("No compensation.yaml: a model takes eight readings at four angles or more.");
  if (result.test) result.test->place_unit = result.test->unit = "rad";
  const std::vector<PositioningTest> tests =
      result.test ? std::vector{*result.test} : std::vector<PositioningTest>{};

  report::Page page{"Rotary axis " + letter, options.lines.filename().string()};
  for (const auto& note : result.notes) page.callout(note, "warn");
  report::show(page, rows_of(result));
  write_model(page, result);
  write_positioning(page, tests, tolerances);
  const auto json = json_of(result, tests, tolerances);
  if (result.fit) {
    compensation::ModelText text{"rotary", {options.machine, options.lines}};
    compensation::write_rotary(text, result.fit->axis);
    write_calibration(options.out, text, json, page);
  } else {
    write_reports(options.out, json, page);
  }
  deviations(options, result).write(options.out / "deviations.csv");
  print_positioning(tests, tolerances, std::cout);
  std::cout << line_of(rows_of(result)) << '\n';
  if (result.fit) std::cout << model_words(result) << '\n';
  for (const auto& note : result.notes) std::cout << "note: " << note << '\n';
  std::cout << (result.fit ? written(options.out, "compensation.yaml") + ", " : "wrote ")
            << (options.out / "deviations.csv").string()
            << (result.fit ? ""
                           : ", " + (options.out / "report.json").string() + ", " +
                                 (options.out / "report.html").string())
            << '\n';
}

recording::Table predict_rotary(const config::Yaml& file, const recording::Table& inputs) {
  compensation::check_seal(file);
  (void)file.root().integer("invar_compensation", 1, 1);
  (void)file.root().text("kind");
  const auto axis = compensation::read_rotary(file.root());
  file.finish();
  const std::string letter(1, axis.letter);
  const auto angle = inputs.in(letter, "rad");
  const std::string column = inputs.has("direction_" + letter) ? "direction_" + letter : "direction";
  const auto moving = inputs.optionally_in(column, "1");
  std::vector<double> error, sigma;
  std::size_t outside = 0;
  for (std::size_t i = 0; i < angle.size(); ++i) {
    const double way = moving && !std::isnan((*moving)[i]) ? (*moving)[i] : 0.0;
    if (way != 1.0 && way != 0.0 && way != -1.0)
      throw InputError{inputs.file.string() + ": column `" + column + "`, row " + std::to_string(i + 1),
                       "is no direction", "write 1, -1, or 0 for the mean of both"};
    const bool known = std::isfinite(angle[i]);
    outside += known && !axis.comes_round && !axis.travel.contains(angle[i]) ? 1U : 0U;
    error.push_back(known ? axis.value(angle[i], way) : std::nan(""));
    sigma.push_back(known ? axis.sigma(angle[i], way) : std::numeric_limits<double>::infinity());
  }
  if (outside > 0)
    std::cerr << "warning: " << outside << " of " << angle.size()
              << " angles lie outside what was calibrated; the value at the end of the range is held there\n";
  recording::Table output;
  output.add("error_" + letter, "rad", std::move(error));
  output.add("sigma_" + letter, "rad", std::move(sigma));
  return output;
}

}  // namespace invar::tools

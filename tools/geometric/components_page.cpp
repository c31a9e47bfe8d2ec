#include "tools/geometric/components_page.hpp"

#include <cmath>
#include <utility>

#include "core/base/index.hpp"
#include "tools/geometric/components_file.hpp"

namespace invar::tools {

namespace {

using metrology::error_motion_count;
using metrology::is_rotation;
using report::number;
using report::si;

const char* unit_of(int component) { return is_rotation(component) ? "rad" : "m"; }

/// Readings beside the network; at three values of the first state that it depends on.
report::Plot component_plot(const ComponentsResult& result, int component) {
  const auto& readings = *result.readings[index(component)];
  const auto& fit = *result.fits[index(component)];
  const auto& network = fit.motion;
  report::Plot plot;
  plot.title = std::string{metrology::iso_name(component)} + ", " + metrology::thesis_symbol(component);
  plot.x_label = std::string(1, metrology::axis_letters[index(metrology::axis_of(component))]) + " [mm]";
  plot.y_label = is_rotation(component) ? "rotation [urad]" : "translation [um]";
  report::Series points;
  points.style = report::Series::Style::points;
  points.colour = "#9aa7b1";
  points.label = "readings";
  for (Eigen::Index i = 0; i < readings.position.size(); ++i) {
    if (!fit.kept[static_cast<std::size_t>(i)]) continue;
    points.x.push_back(1e3 * readings.position[i]);
    points.y.push_back(1e6 * readings.value[i]);
  }
  plot.series.push_back(std::move(points));
  std::vector<double> state;
  for (const auto& each : result.model.states) state.push_back(each.usual());
  const char* colours[] = {"#1f6fb4", "#2a9d5c", "#d1495b"};
  const Range known = network.network.range[0];
  for (int level = 0; level < (network.states.empty() ? 1 : 3); ++level) {
    std::string label;
    if (!network.states.empty()) {
      const auto& first = result.model.states[network.states[0]];
      state[network.states[0]] = first.range.lower + 0.5 * level * first.range.width();
      label = number(state[network.states[0]], 4) + " " + unit_of_state(first.name);
    }
    report::add_curve(plot, {1e3 * known.lower, 1e3 * known.upper}, label, colours[level], [&](double mm) {
      return report::CurvePoint{1e6 * network.value(1e-3 * mm, state),
                                1e6 * network.sigma_at(1e-3 * mm, state)};
    });
  }
  return plot;
}

report::Plot residual_plot(const ComponentsResult& result) {
  report::Plot plot;
  plot.title = "Residuals";
  plot.x_label = "residual over the noise of its component";
  plot.y_label = "readings";
  std::vector<double> scaled;
  for (const auto& fit : result.fits)
    if (fit && fit->noise > 0.0)
      for (const double rest : fit->rest) scaled.push_back(rest / fit->noise);
  plot.series = {report::histogram(scaled, 0.4, 1.0)};
  return plot;
}

}  // namespace

double rms_of_readings(const metrology::ErrorMotionFit& fit, bool all) {
  std::vector<double> rest;
  for (std::size_t i = 0; i < fit.rest.size(); ++i)
    if (all || fit.kept[i]) rest.push_back(fit.rest[i]);
  return report::rms_of(rest);
}

report::LeftOut rows_of(const ComponentsResult& result) {
  report::LeftOut left_out;
  left_out.given = result.rows;
  left_out.header = {"component", "position", "reading", "from the model"};
  std::size_t rejected = 0;
  for (int c = 0; c < error_motion_count; ++c) {
    if (!result.fits[index(c)]) continue;
    const auto& fit = *result.fits[index(c)];
    const auto& readings = *result.readings[index(c)];
    rejected += fit.rejected;
    for (std::size_t i = 0; i < fit.rest.size(); ++i)
      if (!fit.kept[i])
        left_out.rows.push_back(
            {std::string{metrology::iso_name(c)}, si(readings.position[static_cast<Eigen::Index>(i)], "m", 4),
             si(readings.value[static_cast<Eigen::Index>(i)], unit_of(c)), si(fit.rest[i], unit_of(c))});
  }
  left_out.used = left_out.given - rejected;
  left_out.reasons = {{rejected, "more than five robust deviations off"}};
  left_out.unexplained.emplace_back(
      "The errors over those used and over all stand with each component below.");
  return left_out;
}

std::string ComponentsResult::depends_on(int component) const {
  std::string text;
  for (const std::size_t state : fits[index(component)]->motion.states)
    text += (text.empty() ? "" : ", ") + model.states[state].name;
  return text.empty() ? "position alone" : text;
}

report::Page components_page(const ComponentsResult& result) {
  report::Page page{"Error motions measured one by one", result.readings_file.filename().string() + ", " +
                                                             std::to_string(result.rows) + " readings, " +
                                                             result.machine_file.filename().string()};
  page.callout("Error over the travels " + si(result.field_rms, "m") +
                   " RMS; what was measured of it is good to " + si(result.field_sigma, "m") + " (1 sigma)",
               result.unidentified.empty() ? "good" : "plain");
  std::string missing;
  for (const auto& what : result.unidentified) missing += (missing.empty() ? "" : ", ") + what;
  if (!missing.empty()) page.callout("Not measured, taken as zero: " + missing, "warn");
  for (const auto& what : result.not_judged) page.callout(what + ".", "warn");
  for (const auto& note : result.notes) page.paragraph(note);
  report::show(page, rows_of(result));
  page.heading("Components");
  std::vector<std::vector<std::string>> rows;
  std::vector<report::Plot> plots;
  for (int c = 0; c < error_motion_count; ++c) {
    if (!result.fits[index(c)]) continue;
    const auto& fit = *result.fits[index(c)];
    rows.push_back({std::string{metrology::iso_name(c)}, metrology::thesis_symbol(c), result.depends_on(c),
                    std::to_string(fit.kept.size()) +
                        (fit.rejected > 0 ? ", " + std::to_string(fit.rejected) + " rejected" : ""),
                    si(fit.over_position, unit_of(c)), si(fit.left_out, unit_of(c)),
                    si(fit.motion.sigma, unit_of(c)), si(rms_of_readings(fit, false), unit_of(c)),
                    si(rms_of_readings(fit, true), unit_of(c))});
    plots.push_back(component_plot(result, c));
  }
  page.table({"ISO 230-1", "thesis", "depends on", "readings", "left out, position alone", "left out",
              "sigma", "error over those used (RMS)", "over all (RMS)"},
             rows);
  for (int pair = 0; pair < metrology::squareness_count; ++pair)
    if (result.model.squareness_sigma[index(pair)] > 0.0)
      page.paragraph(std::string{metrology::squareness_iso_name(pair)} + ": " +
                     report::with_sigma(
                         metrology::squareness_angle_from_cosine(pair, result.model.squareness[index(pair)]),
                         result.model.squareness_sigma[index(pair)], "rad"));
  page.plots(std::move(plots), "Bands are two standard deviations of the curve.");
  write_motions(page, result.motions, result.tolerances);
  write_positioning(page, result.tests, result.tolerances);
  page.heading("Residual");
  page.plot(residual_plot(result));
  return page;
}

}  // namespace invar::tools

#include "tools/thermal/thermal_page.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace invar::tools {

namespace {

using metrology::ThermalFit;
using metrology::ThermalReadings;
using report::number;
using report::si;

/// Indices of the readings within so many kelvin of a temperature.
std::vector<Eigen::Index> near(const ThermalReadings& readings, double temperature, double within) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < readings.x.size(); ++i)
    if (std::abs(readings.temperature(i) - temperature) <= within) rows.push_back(i);
  return rows;
}

report::Plot surface_plot(const ThermalFit& fit) {
  report::Plot plot;
  plot.title = "Error over position and temperature";
  plot.x_label = "x [mm]";
  plot.y_label = "temperature [degC]";
  report::Series heat;
  heat.style = report::Series::Style::heat;
  heat.label = "error [um]";
  for (int i = 0; i <= 60; ++i)
    for (int j = 0; j <= 30; ++j) {
      const double x = fit.model.x.lower + fit.model.x.width() * i / 60.0;
      const double t = fit.model.temperature.lower + fit.model.temperature.width() * j / 30.0;
      heat.x.push_back(1e3 * x);
      heat.y.push_back(t);
      heat.u.push_back(1e6 * fit.model.value(fit.model.typical(x, t)));
    }
  plot.series.push_back(std::move(heat));
  return plot;
}

report::Plot levels_plot(const ThermalReadings& readings, const ThermalFit& fit) {
  report::Plot plot;
  plot.title = "Readings and model at four temperatures";
  plot.x_label = "x [mm]";
  plot.y_label = "error [um]";
  const char* colours[] = {"#1f6fb4", "#2a9d5c", "#e09f1f", "#d1495b"};
  const Range& range = fit.model.temperature;
  for (int level = 0; level < (range.width() > 0.0 ? 4 : 1); ++level) {
    const double t = range.lower + range.width() * (level + 0.5 * (range.width() <= 0.0)) / 3.0;
    report::Series points;
    points.style = report::Series::Style::points;
    points.colour = colours[level];
    for (const Eigen::Index i : near(readings, t, std::max(0.12 * range.width(), 1e-9)))
      if (fit.kept(i) > 0.0) {
        points.x.push_back(1e3 * readings.x(i));
        points.y.push_back(1e6 * readings.error(i));
      }
    plot.series.push_back(std::move(points));
    const Range along{1e3 * fit.model.x.lower, 1e3 * fit.model.x.upper};
    report::add_curve(plot, along, number(t, 4) + " degC", colours[level], [&](double mm) {
      const auto state = fit.model.typical(1e-3 * mm, t);
      return report::CurvePoint{1e6 * fit.model.value(state), 1e6 * fit.model.sigma(state)};
    });
  }
  return plot;
}

/// Figures 3.9 and 3.10 of the thesis: what is left with the model of the coldest readings (room temperature),
/// and with the whole one; along x at mid temperature, and in the order of measurement.
std::vector<report::Plot> residual_plots(const ThermalReadings& readings, const ThermalFit& fit) {
  report::Plot fixed;
  report::Plot varying;
  const Range& range = fit.model.temperature;
  fixed.title = "Residual near " + number(range.lower + 0.5 * range.width(), 4) + " degC";
  fixed.x_label = "x [mm]";
  varying.title = "Residual over the whole recording";
  varying.x_label = readings.time ? "t [s]" : "reading";
  report::Series cold;
  cold.label = "with the room-temperature model";
  cold.style = report::Series::Style::points;
  report::Series whole = cold;
  whole.label = "with the position-temperature model";
  report::Series cold_all = cold;
  report::Series whole_all = whole;
  const double middle = range.lower + 0.5 * range.width();
  report::Series apart = whole;
  apart.label = "left out of the fit";
  apart.colour = "#d1495b";
  for (Eigen::Index i = 0; i < readings.x.size(); ++i) {
    if (fit.kept(i) <= 0.0) {
      apart.x.push_back(readings.time ? (*readings.time)(i) : static_cast<double>(i));
      apart.y.push_back(1e6 * (readings.error(i) - fit.predicted(i)));
      continue;
    }
    const double at_cold = 1e6 * (readings.error(i) - fit.model.value({readings.x(i), range.lower, 0.0}));
    const double left = 1e6 * (readings.error(i) - fit.predicted(i));
    const double t = readings.time ? (*readings.time)(i) : static_cast<double>(i);
    cold_all.x.push_back(t);
    cold_all.y.push_back(at_cold);
    whole_all.x.push_back(t);
    whole_all.y.push_back(left);
    if (std::abs(readings.temperature(i) - middle) > 0.2 * range.width() + 1e-9) continue;
    cold.x.push_back(1e3 * readings.x(i));
    cold.y.push_back(at_cold);
    whole.x.push_back(1e3 * readings.x(i));
    whole.y.push_back(left);
  }
  fixed.y_label = varying.y_label = "residual [um]";
  fixed.series = {std::move(cold), std::move(whole)};
  varying.series = {std::move(cold_all), std::move(whole_all), std::move(apart)};
  return {std::move(fixed), std::move(varying)};
}

}  // namespace

ThermalFigures thermal_figures(const ThermalReadings& readings, const ThermalFit& fit) {
  ThermalFigures figures;
  std::vector<double> before, used, all;
  report::LeftOut& left_out = figures.left_out;
  left_out.header = {"reading", "x", "temperature", "error", "model", "apart"};
  for (Eigen::Index i = 0; i < readings.x.size(); ++i) {
    const double apart = readings.error(i) - fit.predicted(i);
    all.push_back(apart);
    if (fit.kept(i) <= 0.0) {
      left_out.rows.push_back({std::to_string(i + 1), si(readings.x(i), "m", 4),
                               number(readings.temperature(i), 4) + " degC", si(readings.error(i), "m"),
                               si(fit.predicted(i), "m"), si(apart, "m")});
      continue;
    }
    before.push_back(readings.error(i) - fit.model.value({readings.x(i), fit.model.temperature.lower, 0.0}));
    used.push_back(apart);
    figures.sigma += fit.model.sigma(fit.model.typical(readings.x(i), readings.temperature(i)));
  }
  figures.sigma /= static_cast<double>(std::max<std::size_t>(used.size(), 1));
  figures.before = report::rms_of(before);
  for (const auto& candidate : fit.candidates)
    if (candidate.chosen) figures.after = candidate.left_out_rms;
  left_out.given = all.size() + readings.incomplete;
  left_out.used = used.size();
  left_out.reasons = {{readings.incomplete, "with an empty cell"},
                      {left_out.rows.size(), "that stand alone more than 4.5 standard deviations off"}};
  left_out.rms_used = report::rms_of(used);
  left_out.rms_all = report::rms_of(all);
  left_out.unexplained = fit.unexplained;
  return figures;
}

report::Page thermal_page(const std::filesystem::path& file, const ThermalReadings& readings,
                          const ThermalFit& fit, const ThermalFigures& figures) {
  report::Page page{"Thermal calibration",
                    file.filename().string() + ", " + std::to_string(readings.x.size()) + " readings"};
  page.callout("RMS " + si(figures.before, "m") + " with the room-temperature model, " +
                   si(figures.after, "m") +
                   " on readings left out of the fit; the systematic error is known to " +
                   si(figures.sigma, "m") + " (1 sigma)",
               fit.unexplained.empty() ? "good" : "warn");
  for (const auto& what : fit.unidentified) page.callout("Not identified: " + what, "warn");
  for (const auto& what : fit.unexplained) page.callout(what, "warn");
  for (const auto& note : fit.notes) page.paragraph(note);
  report::show(page, figures.left_out);
  page.heading("Models tried");
  std::vector<std::vector<std::string>> rows;
  for (const auto& candidate : fit.candidates)
    rows.push_back({candidate.name + (candidate.lag > 0.0 ? " (" + number(candidate.lag, 3) + " s)" : ""),
                    number(candidate.log_evidence, 6), si(candidate.left_out_rms, "m"),
                    si(candidate.held_out_rms, "m"), candidate.verdict});
  page.table({"model", "log evidence", "RMS of left-out readings", "of left-out passes", "verdict"}, rows);
  page.heading("Error");
  page.plots({levels_plot(readings, fit), surface_plot(fit)},
             "Bands are two standard deviations of the curve.");
  page.heading("Residual");
  page.plots(residual_plots(readings, fit), "In the form of figures 3.9 and 3.10 of the thesis.");
  report::Plot growth;
  growth.title = "Standard deviation over temperature";
  growth.x_label = "temperature [degC]";
  growth.y_label = "sigma at mid travel [um]";
  report::Series line;
  const Range& range = fit.model.temperature;
  const double margin = std::max(1.0, 0.5 * range.width());
  for (int k = 0; k <= 200; ++k) {
    const double t = range.lower - margin + (range.width() + 2.0 * margin) * k / 200.0;
    line.x.push_back(t);
    line.y.push_back(1e6 *
                     fit.model.sigma(fit.model.typical(fit.model.x.lower + 0.5 * fit.model.x.width(), t)));
  }
  growth.series = {std::move(line)};
  report::Plot histogram;
  histogram.title = "Residuals";
  histogram.x_label = "residual [um]";
  histogram.y_label = "readings";
  std::vector<double> rest;
  for (Eigen::Index i = 0; i < readings.x.size(); ++i) rest.push_back(readings.error(i) - fit.predicted(i));
  histogram.series = {report::histogram(rest, fit.model.noise * 0.4, 1e6)};
  page.plots({std::move(growth), std::move(histogram)},
             "Outside the calibrated temperatures the value is held and its sigma grows with the slope.");
  return page;
}

}  // namespace invar::tools

// `invar calibrate thermistor`: the equation of a thermistor from its resistance at known temperatures.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>

#include "core/metrology/thermal/thermistor.hpp"
#include "core/numerics/significance.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/calibration/predict.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/positive.hpp"
#include "tools/report/left_out.hpp"

namespace invar::tools {

namespace {

using metrology::Thermistor;
using metrology::ThermistorFit;
using report::number;
using report::si;

struct CalibrateThermistorOptions {
  std::filesystem::path readings;
  std::filesystem::path out;
  double base_temperature = 25.0;
};

ThermistorFit fit_of(const CalibrateThermistorOptions& options, const std::vector<double>& temperature,
                     const std::vector<double>& resistance) {
  const std::string file = options.readings.string();
  expect_finite(options.readings, "temperature", temperature, 1e3);
  expect_finite(options.readings, "resistance", resistance, 1e9);
  for (std::size_t i = 0; i < resistance.size(); ++i)
    if (resistance[i] <= 0.0 || temperature[i] <= -273.0)
      throw InputError{file + ": row " + std::to_string(i + 1), "is no reading of a thermistor",
                       "resistances are above 0 ohm, temperatures above -273 degC"};
  const auto [low, high] = std::minmax_element(temperature.begin(), temperature.end());
  if (*high - *low < 1.0)
    throw InputError{file + ": column `temperature`", "varies by less than 1 K",
                     "read the thermistor at temperatures some kelvins apart"};
  const ThermistorFit fit =
      metrology::fit_thermistor(vector_of(temperature), vector_of(resistance), options.base_temperature);
  if (!(fit.thermistor.coefficient_percent > 0.0))
    throw InputError{file + ": column `resistance`", "does not fall as the temperature rises",
                     "the equation is that of an NTC thermistor; check that the columns are not exchanged"};
  return fit;
}

std::string law_of(const ThermistorFit& fit) {
  return fit.thermistor.third_order == 0.0
             ? "B law"
             : "Steinhart-Hart with C = " + number(fit.thermistor.third_order, 6) + " 1/K";
}

/// Each reading by the equation from all others: how far one between them may be off.
std::string held_out_text(const ThermistorFit& fit) {
  if (!std::isfinite(fit.held_out_b)) return "two readings leave nothing to check the equation with";
  std::string text = "a reading left out is predicted to " + si(fit.held_out_b, "K") + " RMS by the B law";
  if (std::isfinite(fit.held_out_steinhart_hart))
    text += ", to " + si(fit.held_out_steinhart_hart, "K") + " by Steinhart-Hart";
  return text;
}

/// Of a temperature by the equation [K].
double sigma_of(const ThermistorFit& fit) {
  const double held_out = fit.thermistor.third_order == 0.0 ? fit.held_out_b : fit.held_out_steinhart_hart;
  return std::isfinite(held_out) ? held_out : fit.rms;
}

/// How fast sigma grows outside the readings [K/K]: what the B law is off by at their ends, over half of their range. Two
/// readings show no bend of the curve: there a data-sheet NTC bends by 0.8 K over 45 K.
double growth_of(const ThermistorFit& fit, const std::vector<double>& temperature) {
  constexpr double of_data_sheets = 0.8 / 45.0;
  const auto [low, high] = std::minmax_element(temperature.begin(), temperature.end());
  return std::isfinite(fit.held_out_b) ? 2.0 * fit.held_out_b / (*high - *low) : of_data_sheets;
}

/// Every reading is used: what is told is whether the equation's residuals are noise.
report::LeftOut rows_of(const std::vector<double>& temperature, const std::vector<double>& resistance,
                        const ThermistorFit& fit) {
  std::vector<std::pair<double, double>> by_temperature;
  for (std::size_t i = 0; i < resistance.size(); ++i)
    by_temperature.emplace_back(temperature[i], fit.thermistor.temperature(resistance[i]) - temperature[i]);
  std::sort(by_temperature.begin(), by_temperature.end());
  std::vector<double> residual;
  for (const auto& [at, apart] : by_temperature) residual.push_back(apart);
  report::LeftOut rows;
  rows.given = rows.used = resistance.size();
  rows.unit = "K";
  rows.rms_used = rows.rms_all = fit.rms;
  const double chance = numerics::chance_of_alike_neighbours(residual);
  if (residual.size() < 10)
    rows.unexplained.emplace_back("Fewer than ten readings: whether the residual is noise was not tested.");
  else if (chance < 0.01)
    rows.unexplained.push_back(
        "The residual goes on from one temperature to the next (p = " + number(chance, 2) +
        "): neither equation here follows this thermistor to the noise of its readings.");
  return rows;
}

report::Page page_of(const CalibrateThermistorOptions& options, const std::vector<double>& temperature,
                     const std::vector<double>& resistance, const ThermistorFit& fit) {
  report::Page page{"Thermistor", options.readings.filename().string()};
  page.callout(number(fit.thermistor.resistance_at_base, 6) + " ohm at " +
                   number(options.base_temperature, 4) + " degC, " +
                   number(fit.thermistor.coefficient_percent, 4) + " %/K, " + law_of(fit) +
                   "; the readings are met to " + si(fit.rms, "K") + " RMS, the worst to " +
                   si(fit.largest, "K") + "; " + held_out_text(fit) + ".",
               "plain");
  const report::LeftOut rows = rows_of(temperature, resistance, fit);
  for (const auto& what : rows.unexplained) page.callout(what, "warn");
  report::show(page, rows);
  report::Plot curve;
  curve.title = "Resistance";
  curve.x_label = "temperature [degC]";
  curve.y_label = "resistance [ohm]";
  report::Series points;
  points.style = report::Series::Style::points;
  points.label = "readings";
  points.x = temperature;
  points.y = resistance;
  report::Series line;
  line.label = "equation";
  const auto [low, high] = std::minmax_element(temperature.begin(), temperature.end());
  report::Plot left = curve;
  left.title = "Residual";
  left.y_label = "equation minus reading [K]";
  report::Series residual = points;
  residual.label = "";
  for (int i = 0; i <= 200; ++i) {
    line.x.push_back(*low + (*high - *low) * i / 200.0);
    line.y.push_back(fit.thermistor.resistance(line.x.back()));
  }
  for (std::size_t i = 0; i < resistance.size(); ++i)
    residual.y[i] = fit.thermistor.temperature(resistance[i]) - temperature[i];
  curve.series = {std::move(line), std::move(points)};
  left.series = {std::move(residual)};
  page.plots({std::move(curve), std::move(left)});
  std::vector<std::vector<std::string>> table;
  for (std::size_t i = 0; i < resistance.size(); ++i) {
    const double by_equation = fit.thermistor.temperature(resistance[i]);
    table.push_back({number(temperature[i], 5) + " degC", si(resistance[i], "ohm", 5),
                     number(by_equation, 6) + " degC", si(by_equation - temperature[i], "K")});
  }
  page.table({"temperature", "resistance", "by the equation", "residual"}, table);
  return page;
}

void calibrate(const CalibrateThermistorOptions& options) {
  const auto table = recording::Table::read(options.readings);
  const auto temperature = table.in("temperature", "degC");
  const auto resistance = table.in("resistance", "ohm");
  if (table.rows() < 2)
    throw InputError{options.readings.string(), "has one row",
                     "two readings are needed at least, better five"};
  const ThermistorFit fit = fit_of(options, temperature, resistance);
  const Thermistor& found = fit.thermistor;
  const auto [low, high] = std::minmax_element(temperature.begin(), temperature.end());
  compensation::ModelText text{"thermistor", {options.readings}};
  text.comment(
          "1/T = 1/T_B + (x - x_B) / B + C (x^3 - x_B^3 - 3 x_B^2 (x - x_B)), T in kelvin, x = ln(R / 1 "
          "ohm), "
          "B = (coefficient / 100) T_B^2, C = third_order")
      .number("resistance", found.resistance_at_base)
      .number("base_temperature", found.base_temperature)
      .number("coefficient", found.coefficient_percent)
      .number("third_order", found.third_order)
      .number("sigma", sigma_of(fit))
      .comment("the readings' temperatures, and how fast sigma grows outside them [K/K]")
      .range("range", Range{*low, *high})
      .number("growth", growth_of(fit, temperature));
  const bool known = std::isfinite(fit.sigma_coefficient);
  nlohmann::json report{{"kind", "thermistor"},
                        {"readings", table.rows()},
                        {"resistance_ohm", found.resistance_at_base},
                        {"base_temperature_degC", found.base_temperature},
                        {"coefficient_percent_per_K", found.coefficient_percent},
                        {"third_order_per_K", found.third_order},
                        {"rms_K", fit.rms},
                        {"largest_K", fit.largest},
                        {"rows", report::json_of(rows_of(temperature, resistance, fit))},
                        {"unidentified", nlohmann::json::array()}};
  if (known) report["sigma_coefficient_percent_per_K"] = fit.sigma_coefficient;
  if (std::isfinite(fit.held_out_b)) report["held_out_b_law_K"] = fit.held_out_b;
  if (std::isfinite(fit.held_out_steinhart_hart))
    report["held_out_steinhart_hart_K"] = fit.held_out_steinhart_hart;
  write_calibration(options.out, text, report, page_of(options, temperature, resistance, fit));
  std::cout << "thermistor from " << table.rows() << " readings, " << law_of(fit) << ", met to "
            << si(fit.rms, "K") << " RMS, the worst to " << si(fit.largest, "K") << '\n'
            << held_out_text(fit) << '\n'
            << line_of(rows_of(temperature, resistance, fit)) << '\n'
            << "in the cell file: thermistor: {resistance: " << number(found.resistance_at_base, 7)
            << ", base_temperature: " << number(found.base_temperature, 5)
            << ", coefficient: " << number(found.coefficient_percent, 6)
            << (found.third_order == 0.0 ? "" : ", third_order: " + number(found.third_order, 7)) << "}\n";
  std::cout << written(options.out, "compensation.yaml") << '\n';
}

}  // namespace

void add_calibrate_thermistor(CLI::App& group) {
  auto* command = group.add_subcommand("thermistor", "Equation of a thermistor from readings");
  command->footer("Example: invar calibrate thermistor --readings thermistor.csv --out result");
  auto options = std::make_shared<CalibrateThermistorOptions>();
  command->add_option("--readings", options->readings, "temperature [degC], resistance [ohm]")->required();
  command->add_option("--base", options->base_temperature, "where the resistance is stated [degC]")
      ->check(CLI::Range(-50.0, 150.0));
  command->add_option("--out", options->out, "folder for compensation.yaml, report.json, report.html")
      ->required();
  command->callback([options] { calibrate(*options); });
}

recording::Table predict_thermistor(const config::Yaml& file, const recording::Table& inputs) {
  (void)compensation::check_seal(file);
  file.root()["identified_from"].accept_all();
  const Thermistor found{file.root().number("resistance", "ohm", Range::positive()),
                         file.root().number("base_temperature", "degC", Range{-200.0, 500.0}),
                         file.root().number("coefficient", "1", Range::positive()),
                         file.root().has("third_order") ? file.root().number("third_order", "1/K") : 0.0};
  const double rms = file.root().number("sigma", "K", Range::not_negative());
  const bool ranged = file.root().has("range");
  const auto ends =
      ranged ? compensation::exactly(file.root()["range"], 2, "1") : std::vector<double>{-1e9, 1e9};
  const double growth = ranged ? file.root().number("growth", "1", Range::not_negative()) : 0.0;
  file.finish();
  const Range range{ends[0], ends[1]};
  std::vector<double> temperature = inputs.in("resistance", "ohm");
  expect_finite(inputs.file, "resistance", temperature, 1e9);
  std::vector<double> sigma;
  std::size_t outside = 0;
  for (double& value : temperature) {
    if (value <= 0.0)
      throw InputError{inputs.file.string(), "a resistance is not above 0", "check the readings"};
    value = found.temperature(value);
    sigma.push_back(std::hypot(rms, growth * (value - range.clamp(value))));
    outside += std::abs(value - range.clamp(value)) > 3.0 * rms ? 1U : 0U;
  }
  if (outside > 0)
    std::cerr << "warning: " << outside << " of " << temperature.size()
              << " readings lie outside the calibrated temperatures; sigma grows there\n";
  recording::Table output;
  output.add("sigma", "K", std::move(sigma));
  output.add("temperature", "degC", std::move(temperature));
  return output;
}

}  // namespace invar::tools

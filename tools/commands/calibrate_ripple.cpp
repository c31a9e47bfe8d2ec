// `invar calibrate ripple`: the force ripple of a motor from current and position, as terms of its model.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/model/recording_file.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/ripple_identification.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/report/left_out.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

using report::number;
using report::si;

struct CalibrateRippleOptions {
  std::filesystem::path model;
  std::filesystem::path recording;
  std::filesystem::path out;
};

/// `given` gets the number of rows of the recording.
physics::RippleSamples read_runs(const CalibrateRippleOptions& options, const physics::Model& model,
                                 std::size_t& given) {
  if (model.plant != physics::Plant::axis)
    throw InputError{options.model.string(), "is no model of an axis", "write plant: axis"};
  for (const auto& term : model.terms)
    if (term.info->name == "force_ripple")
      throw InputError{options.model.string(), "has a force_ripple already",
                       "remove its terms: the ripple is identified as a whole"};
  const auto table = recording::Table::read_columns(options.recording, model::columns_of(model));
  const auto record = model::to_record(table, model, true).record;
  given = record.rows();
  for (const char* signal : {"reference", "position", "current"})
    if (record.find(signal) == nullptr)
      throw InputError{options.recording.string(), "has no signal `" + std::string{signal} + "`",
                       "name its column under `columns` of the model"};
  const auto samples = physics::constant_velocity_runs(record);
  if (samples.size() < 50 || samples.run.back() < 1)
    throw InputError{options.recording.string(), "has not two runs at constant velocity of half a second",
                     "record slow runs along the travel, forth and back"};
  return samples;
}

/// The units that the model counts in, and how a page shows a position.
struct Units {
  explicit Units(const physics::Model& model)
      : rotary{physics::is_rotary(model)},
        length{rotary ? "rad" : "m"},
        force{rotary ? "N m" : "N"},
        shown{rotary ? "deg" : "mm"},
        factor{rotary ? 180.0 / std::numbers::pi : 1e3} {}
  bool rotary;
  std::string length, force, shown;
  double factor;  // from `length` to `shown`

  [[nodiscard]] std::string period(double value) const {
    if (!rotary) return si(value, length, 5);
    return number(factor * value, 5) + " deg (" + number(2.0 * std::numbers::pi / value, 5) + " a turn)";
  }
};

double ripple_at(const physics::RippleFit& fit, double position) {
  double force = 0.0;
  for (const auto& family : fit.families)
    for (const auto& h : family.harmonics)
      force += h.amplitude * std::sin(2.0 * std::numbers::pi * h.order * position / family.pitch + h.phase);
  return force;
}

/// Rows at constant velocity are used; the error of the others cannot be told, since mass and reference play into it.
report::LeftOut rows_of(const physics::RippleSamples& samples, const physics::RippleFit& fit,
                        const Units& units, std::size_t given) {
  report::LeftOut rows;
  rows.row = "row";
  rows.unit = units.force;
  rows.given = given;
  rows.used = samples.rows;
  rows.reasons = {{given - samples.rows,
                   "not at a constant velocity of half a second or more, or the quarter of a "
                   "second in which it settles"}};
  rows.rms_used = fit.families.empty() ? fit.before : fit.after;
  if (fit.not_noise < 0.01)
    rows.unexplained.push_back(
        "The residual force goes on from one place to the next (p = " + number(fit.not_noise, 2) +
        "): no family of ripple here explains it. The sigmas allow for it.");
  return rows;
}

report::Plot force_plot(const physics::Model& model, const physics::RippleSamples& samples,
                        const physics::RippleFit& fit, const Units& units) {
  const double motor = model.value("motor_constant", 1.0), damping = model.value("viscous_damping");
  report::Plot plot;
  plot.title = std::string{units.rotary ? "Torque on the rotor" : "Force on the carriage"} +
               ", friction and damping taken out";
  plot.x_label = "position [" + units.shown + "]";
  plot.y_label = (units.rotary ? "torque [" : "force [") + units.force + "]";
  report::Series measured;
  measured.label = "measured";
  measured.style = report::Series::Style::points;
  report::Series ripple;
  ripple.label = "ripple";
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double direction = samples.velocity[i] < 0.0 ? -1.0 : 1.0;
    measured.x.push_back(units.factor * samples.position[i]);
    measured.y.push_back(damping * samples.velocity[i] + fit.friction * direction - fit.constant -
                         motor * samples.current[i]);
  }
  const auto [low, high] = std::minmax_element(samples.position.begin(), samples.position.end());
  for (int k = 0; k <= 2000; ++k) {
    const double x = *low + (*high - *low) * k / 2000.0;
    ripple.x.push_back(units.factor * x);
    ripple.y.push_back(ripple_at(fit, x));
  }
  plot.series = {measured, ripple};
  return plot;
}

report::Page page_of(const CalibrateRippleOptions& options, const physics::Model& model,
                     const physics::RippleSamples& samples, const physics::RippleFit& fit,
                     const report::LeftOut& left_out) {
  const Units units{model};
  report::Page page{"Force ripple", options.recording.string() + ", " +
                                        std::to_string(samples.run.back() + 1) +
                                        " runs at constant velocity"};
  std::string pitches;
  for (const auto& family : fit.families)
    pitches += (pitches.empty() ? "Pitch " : ", ") + units.period(family.pitch) + " +- " +
               si(family.pitch_sigma, units.length, 2);
  page.callout(fit.families.empty()
                   ? std::string{"No ripple stands out."}
                   : pitches + "; force left over on runs held out " + si(fit.before, units.force) +
                         " RMS without it, " + si(fit.after, units.force) + " with it",
               fit.families.empty() || !left_out.unexplained.empty() ? "plain" : "good");
  report::show(page, left_out);
  page.plot(force_plot(model, samples, fit, units));
  std::vector<std::vector<std::string>> rows;
  for (std::size_t k = 0; k < fit.families.size(); ++k)
    for (const auto& h : fit.families[k].harmonics)
      rows.push_back({std::to_string(k + 1), number(h.order, 2),
                      units.period(fit.families[k].pitch / h.order), si(h.amplitude, units.force, 4),
                      si(h.sigma, units.force, 2), number(h.phase, 4)});
  if (!rows.empty())
    page.table({"family", "harmonic", "period", "amplitude", "sigma", "phase at 0 [rad]"}, rows);
  page.paragraph("Left of friction at these speeds: " + si(fit.friction, units.force) + ", a constant of " +
                 si(fit.constant, units.force) + "; neither is written into the model.");
  return page;
}

nlohmann::json harmonics_of(const physics::RippleFamily& family, const Units& units) {
  nlohmann::json all = nlohmann::json::array();
  const std::string unit = units.rotary ? "Nm" : "N";
  for (const auto& h : family.harmonics)
    all.push_back({{"order", h.order},
                   {"amplitude_" + unit, h.amplitude},
                   {"sigma_" + unit, h.sigma},
                   {"phase_rad", h.phase}});
  return all;
}

nlohmann::json report_of(const physics::RippleSamples& samples, const physics::RippleFit& fit,
                         const Units& units, const report::LeftOut& left_out) {
  const std::string unit = units.rotary ? "Nm" : "N";
  nlohmann::json report;
  report["kind"] = "ripple";
  report["runs"] = samples.run.back() + 1;
  report["families"] = nlohmann::json::array();
  for (const auto& family : fit.families)
    report["families"].push_back(
        {{"pitch", {{"value", family.pitch}, {"unit", units.length}, {"sigma", family.pitch_sigma}}},
         {"harmonics", harmonics_of(family, units)}});
  report["harmonics"] = nlohmann::json::array();
  if (!fit.families.empty()) {  // of the first family
    report["pitch"] = report["families"][0]["pitch"];
    report["harmonics"] = report["families"][0]["harmonics"];
  }
  report["friction_" + unit] = fit.friction;
  report["constant_" + unit] = fit.constant;
  report["held_out_rms_" + unit] = {{"before", fit.before}, {"after", fit.after}};
  report["rows"] = report::json_of(left_out);
  report["unidentified"] = nlohmann::json::array();
  if (fit.families.empty()) report["unidentified"].push_back("force ripple: none stands out of the noise");
  return report;
}

void print_ripple(const physics::RippleSamples& samples, const physics::RippleFit& fit, const Units& units,
                  const report::LeftOut& left_out) {
  std::cout << "force ripple from " << samples.run.back() + 1 << " runs at constant velocity\n"
            << line_of(left_out) << '\n';
  if (fit.families.empty()) std::cout << "not identified: no ripple stands out of the noise\n";
  for (const auto& family : fit.families) {
    std::cout << "pitch " << units.period(family.pitch) << " +- " << si(family.pitch_sigma, units.length, 2)
              << "; amplitudes";
    for (const auto& h : family.harmonics)
      std::cout << ' ' << si(h.amplitude, units.force) << " (" << h.order << ")";
    std::cout << '\n';
  }
  if (!fit.families.empty())
    std::cout << "force left over on runs held out: " << si(fit.before, units.force) << " RMS without it, "
              << si(fit.after, units.force) << " with it\n";
  for (const auto& what : left_out.unexplained) std::cout << "not explained: " << what << '\n';
}

void calibrate(const CalibrateRippleOptions& options) {
  const auto yaml = config::Yaml::load(options.model);
  auto model = model::read(yaml);
  yaml.finish();
  std::size_t given = 0;
  const auto samples = read_runs(options, model, given);
  const auto fit = [&] {
    const Progress progress{"scanning pitches"};
    return physics::identify_ripple(model, samples);
  }();
  const Units units{model};
  const auto left_out = rows_of(samples, fit, units, given);
  const auto page = page_of(options, model, samples, fit, left_out);
  for (const auto& term : physics::ripple_terms(fit)) model.terms.push_back(term);
  write_calibration(options.out, "patched.yaml", model::patched(yaml, model),
                    report_of(samples, fit, units, left_out), page);
  print_ripple(samples, fit, units, left_out);
  std::cout << written(options.out, "patched.yaml") << '\n';
}

}  // namespace

void add_calibrate_ripple(CLI::App& group) {
  auto* command = group.add_subcommand("ripple", "The force ripple of a motor, as terms of its model");
  command->footer(
      "Example: invar calibrate ripple --model model.yaml --recording runs.csv --out result\n"
      "The stage feeds the ripple forward with `model: result/patched.yaml`.");
  auto options = std::make_shared<CalibrateRippleOptions>();
  command->add_option("--model", options->model, "model.yaml of plant axis, without ripple")->required();
  command
      ->add_option("--recording", options->recording,
                   "reference, position and current of slow runs at constant velocity, both ways")
      ->required();
  command->add_option("--out", options->out, "folder for patched.yaml, report.json, report.html")->required();
  command->callback([options] { calibrate(*options); });
}

}  // namespace invar::tools

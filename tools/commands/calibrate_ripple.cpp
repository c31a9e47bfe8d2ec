// `invar calibrate ripple`: the force ripple of a motor from current and position, as terms of its model.
#include <cmath>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/model/recording_file.hpp"
#include "core/physics/ripple_identification.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/commands/calibration_result.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

using report::number;
using report::si;

struct Options {
  std::filesystem::path model;
  std::filesystem::path recording;
  std::filesystem::path out;
};

physics::RippleSamples read_runs(const Options& options, const physics::Model& model) {
  if (model.plant != physics::Plant::axis)
    throw InputError{options.model.string(), "is no model of an axis", "write plant: axis"};
  for (const auto& term : model.terms)
    if (term.info->name == "force_ripple")
      throw InputError{options.model.string(), "has a force_ripple already",
                       "remove its terms: the ripple is identified as a whole"};
  const auto table = recording::Table::read_columns(options.recording, model::columns_of(model));
  const auto record = model::to_record(table, model, true).record;
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

report::Page page_of(const Options& options, const physics::Model& model,
                     const physics::RippleSamples& samples, const physics::RippleFit& fit) {
  report::Page page{"Force ripple", options.recording.string() + ", " +
                                        std::to_string(samples.run.back() + 1) +
                                        " runs at constant velocity"};
  page.callout(fit.harmonics.empty()
                   ? std::string{"No ripple stands out."}
                   : "Pitch " + si(fit.pitch, "m", 5) + " +- " + si(fit.pitch_sigma, "m", 2) +
                         "; force left over on runs held out " + si(fit.before, "N") + " RMS without it, " +
                         si(fit.after, "N") + " with it",
               fit.harmonics.empty() ? "plain" : "good");
  const double motor = model.value("motor_constant", 1.0), damping = model.value("viscous_damping");
  report::Plot plot;
  plot.title = "Force on the carriage, friction and damping taken out";
  plot.x_label = "position [mm]";
  plot.y_label = "force [N]";
  report::Series measured;
  measured.label = "measured";
  measured.style = report::Series::Style::points;
  report::Series ripple;
  ripple.label = "ripple";
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double direction = samples.velocity[i] < 0.0 ? -1.0 : 1.0;
    measured.x.push_back(1e3 * samples.position[i]);
    measured.y.push_back(damping * samples.velocity[i] + fit.friction * direction - fit.constant -
                         motor * samples.current[i]);
  }
  const auto [low, high] = std::minmax_element(samples.position.begin(), samples.position.end());
  for (int k = 0; k <= 1000; ++k) {
    const double x = *low + (*high - *low) * k / 1000.0;
    double force = 0.0;
    for (const auto& h : fit.harmonics)
      force += h.amplitude * std::sin(2.0 * std::numbers::pi * h.order * x / fit.pitch + h.phase);
    ripple.x.push_back(1e3 * x);
    ripple.y.push_back(force);
  }
  plot.series = {measured, ripple};
  page.plot(std::move(plot));
  std::vector<std::vector<std::string>> rows;
  for (const auto& h : fit.harmonics)
    rows.push_back({number(h.order, 2), si(fit.pitch / h.order, "m", 5), si(h.amplitude, "N", 4),
                    si(h.sigma, "N", 2), number(h.phase, 4)});
  if (!rows.empty()) page.table({"harmonic", "period", "amplitude", "sigma", "phase at 0 [rad]"}, rows);
  page.paragraph("Left of friction at these speeds: " + si(fit.friction, "N") + ", a constant force of " +
                 si(fit.constant, "N") + "; neither is written into the model.");
  return page;
}

nlohmann::json report_of(const physics::RippleSamples& samples, const physics::RippleFit& fit) {
  nlohmann::json report;
  report["kind"] = "ripple";
  report["runs"] = samples.run.back() + 1;
  report["pitch"] = {{"value", fit.pitch}, {"unit", "m"}, {"sigma", fit.pitch_sigma}};
  report["harmonics"] = nlohmann::json::array();
  for (const auto& h : fit.harmonics)
    report["harmonics"].push_back(
        {{"order", h.order}, {"amplitude_N", h.amplitude}, {"sigma_N", h.sigma}, {"phase_rad", h.phase}});
  report["friction_N"] = fit.friction;
  report["constant_N"] = fit.constant;
  report["held_out_rms_N"] = {{"before", fit.before}, {"after", fit.after}};
  report["unidentified"] = nlohmann::json::array();
  if (fit.harmonics.empty()) report["unidentified"].push_back("force ripple: none stands out of the noise");
  return report;
}

void calibrate(const Options& options) {
  const auto yaml = config::Yaml::load(options.model);
  auto model = model::read(yaml);
  yaml.finish();
  const auto samples = read_runs(options, model);
  const auto fit = [&] {
    const Progress progress{"scanning pitches"};
    return physics::identify_ripple(model, samples);
  }();
  const auto page = page_of(options, model, samples, fit);
  for (const auto& term : physics::ripple_terms(fit)) model.terms.push_back(term);
  write_calibration(options.out, "patched.yaml", model::patched(yaml, model), report_of(samples, fit), page);

  std::cout << "force ripple from " << samples.run.back() + 1 << " runs at constant velocity\n";
  if (fit.harmonics.empty()) std::cout << "not identified: no ripple stands out of the noise\n";
  if (!fit.harmonics.empty()) {
    std::cout << "pitch " << si(fit.pitch, "m", 5) << " +- " << si(fit.pitch_sigma, "m", 2) << "; amplitudes";
    for (const auto& h : fit.harmonics) std::cout << ' ' << si(h.amplitude, "N") << " (" << h.order << ")";
    std::cout << "\nforce left over on runs held out: " << si(fit.before, "N") << " RMS without it, "
              << si(fit.after, "N") << " with it\n";
  }
  std::cout << written(options.out, "patched.yaml") << '\n';
}

}  // namespace

void add_calibrate_ripple(CLI::App& group) {
  auto* command = group.add_subcommand("ripple", "The force ripple of a motor, as terms of its model");
  command->footer(
      "Example: invar calibrate ripple --model model.yaml --recording runs.csv --out result\n"
      "The stage feeds the ripple forward with `model: result/patched.yaml`.");
  auto options = std::make_shared<Options>();
  command->add_option("--model", options->model, "model.yaml of plant axis, without ripple")->required();
  command
      ->add_option("--recording", options->recording,
                   "reference, position and current of slow runs at constant velocity, both ways")
      ->required();
  command->add_option("--out", options->out, "folder for patched.yaml, report.json, report.html")->required();
  command->callback([options] { calibrate(*options); });
}

}  // namespace invar::tools

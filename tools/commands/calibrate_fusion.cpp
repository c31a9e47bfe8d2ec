// `invar calibrate fusion`: how far each of several sensors is to be trusted, and the position they give.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <memory>

#include "core/compensation/fusion_file.hpp"
#include "core/metrology/fusion/fusion_identification.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/calibration/predict.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/report/left_out.hpp"

namespace invar::tools {

namespace {

using metrology::FusionFit;
using metrology::FusionRun;
using report::number;
using report::si;

struct CalibrateFusionOptions {
  std::vector<std::filesystem::path> recordings;
  std::filesystem::path out;
  std::string model = "linear";
  std::string noise = "given";
};

/// Names behind `position_` or `velocity_` among the columns, in order.
std::vector<std::string> sensor_names(const recording::Table& table, const std::string& prefix) {
  std::vector<std::string> names;
  for (const auto& column : table.columns)
    if (column.name.starts_with(prefix) && column.name.size() > prefix.size())
      names.push_back(column.name.substr(prefix.size()));
  return names;
}

/// The rows of a file as runs: a new one where the column `run` changes. `selector` names a further attribute that the weights
/// may depend on; empty: none.
std::vector<FusionRun> runs_of(const recording::Table& table, const std::vector<std::string>& positions,
                               const std::vector<std::string>& velocities, const std::string& selector,
                               bool with_reference, bool with_noise) {
  const auto time = table.in("t", "s");
  expect_finite(table.file, "t", time, 1e12);
  const std::size_t rows = time.size();
  std::vector<double> reference;
  if (with_reference) {
    reference = table.in("reference", "m");
    expect_finite(table.file, "reference", reference, 1e4);
  }
  std::vector<std::vector<double>> readings;
  for (const auto& name : positions) readings.push_back(table.in("position_" + name, "m"));
  for (const auto& name : velocities) readings.push_back(table.in("velocity_" + name, "m/s"));
  for (std::size_t k = 0; k < readings.size(); ++k) {
    for (double& value : readings[k])
      if (std::isinf(value)) value = std::numeric_limits<double>::quiet_NaN();
    const auto worst = std::find_if(readings[k].begin(), readings[k].end(),
                                    [](double value) { return std::abs(value) > 1e6; });
    if (worst != readings[k].end())
      throw InputError{table.file.string(), "a reading of " + number(*worst) + " is out of range",
                       "check the values and their unit"};
  }
  std::vector<double> noise;
  if (with_noise) {
    noise = table.in("noise_level", "1");
    expect_finite(table.file, "noise_level", noise, 1e6);
  }
  std::vector<double> attribute;
  if (!selector.empty()) {
    const auto* column = table.find("selector_" + selector);
    if (column == nullptr)
      throw InputError{table.file.string(), "has no column `selector_" + selector + "`",
                       "the weights of this model depend on it: add it"};
    attribute = column->values;
    expect_finite(table.file, column->name, attribute, 1e9);
  }
  const auto* run_column = table.find("run");
  const auto same_run = [&](std::size_t i) {
    if (run_column == nullptr || i == 0) return i > 0;
    if (!run_column->texts.empty()) return run_column->texts[i] == run_column->texts[i - 1];
    return run_column->values[i] == run_column->values[i - 1];
  };
  std::vector<FusionRun> runs;
  for (std::size_t from = 0; from < rows;) {
    std::size_t to = from + 1;
    while (to < rows && same_run(to)) ++to;
    for (std::size_t i = from + 1; i < to; ++i)
      if (time[i] <= time[i - 1])
        throw InputError{table.file.string() + ": column `t`, row " + std::to_string(i + 1),
                         "time does not increase within a run",
                         "give the rows in the order of measurement, or a column `run`"};
    const auto n = static_cast<Eigen::Index>(to - from);
    const auto part = [&](const std::vector<double>& column) -> Eigen::VectorXd {
      return Eigen::Map<const Eigen::VectorXd>(column.data() + from, n);
    };
    FusionRun run;
    run.time = part(time);
    if (with_reference) run.reference = part(reference);
    if (with_noise) run.noise_level = part(noise);
    if (!selector.empty()) run.selector = part(attribute);
    run.positions.resize(n, static_cast<Eigen::Index>(positions.size()));
    run.velocities.resize(n, static_cast<Eigen::Index>(velocities.size()));
    for (std::size_t k = 0; k < readings.size(); ++k) {
      if (k < positions.size())
        run.positions.col(static_cast<Eigen::Index>(k)) = part(readings[k]);
      else
        run.velocities.col(static_cast<Eigen::Index>(k - positions.size())) = part(readings[k]);
    }
    runs.push_back(std::move(run));
    from = to;
  }
  return runs;
}

struct Recordings {
  std::vector<std::string> positions;
  std::vector<std::string> velocities;
  std::string selector;  // empty: none
  std::vector<FusionRun> runs;
};

Recordings read_recordings(const CalibrateFusionOptions& options) {
  Recordings all;
  for (const auto& file : options.recordings) {
    const auto table = recording::Table::read(file, {"run"});
    auto positions = sensor_names(table, "position_");
    auto velocities = sensor_names(table, "velocity_");
    if (positions.empty())
      throw InputError{file.string(), "has no position sensor", "add a column `position_<name> [m]`"};
    if (positions.size() + velocities.size() > metrology::most_sensors)
      throw InputError{file.string(), "has more than 8 sensors", "leave some out"};
    const auto selectors = sensor_names(table, "selector_");
    if (selectors.size() > 1)
      throw InputError{file.string(), "has " + std::to_string(selectors.size()) + " columns `selector_...`",
                       "keep the one that the weights depend on most"};
    const std::string selector = selectors.empty() ? "" : selectors.front();
    if (&file == &options.recordings.front()) {
      all.positions = positions;
      all.velocities = velocities;
      all.selector = selector;
    } else if (positions != all.positions || velocities != all.velocities || selector != all.selector) {
      throw InputError{file.string(), "has other sensors than " + options.recordings.front().string(),
                       "give all recordings the same columns"};
    }
    const bool with_noise = options.noise == "given" && table.has("noise_level");
    for (FusionRun& run : runs_of(table, positions, velocities, selector, true, with_noise)) {
      if (run.time.size() < 10)
        throw InputError{file.string(), "has a run of " + std::to_string(run.time.size()) + " rows only",
                         "record ten rows a run at least"};
      all.runs.push_back(std::move(run));
    }
  }
  double reach = 0.0;
  for (const FusionRun& run : all.runs)
    reach = std::max(reach, run.reference.maxCoeff() - run.reference.minCoeff());
  if (reach <= 0.0)
    throw InputError{options.recordings.front().string(), "the reference never moves",
                     "record runs along the travel"};
  return all;
}

/// Which runs the errors are of.
std::string where_of(const FusionFit& fit) {
  return fit.nothing_held_out ? "on the one run, to which it was fitted" : "on runs held out";
}

/// Every row is fused; weights are learnt from rows in which all sensors read.
report::LeftOut rows_of(const Recordings& all, const FusionFit& fit, metrology::FusionEstimator& estimator) {
  report::LeftOut rows;
  rows.row = "row";
  std::vector<double> used, every;
  for (const FusionRun& run : all.runs) {
    const auto fused = metrology::fuse(estimator, run);
    std::vector<bool> complete(fused.size(), false);
    for (const Eigen::Index i : metrology::complete_rows(metrology::integrated(run)))
      complete[static_cast<std::size_t>(i)] = true;
    for (std::size_t i = 0; i < fused.size(); ++i) {
      every.push_back(fused[i].position - run.reference(static_cast<Eigen::Index>(i)));
      if (complete[i]) used.push_back(every.back());
    }
  }
  rows.given = every.size();
  rows.used = used.size();
  rows.reasons = {{rows.given - rows.used,
                   "left out of the weights, since a sensor is missing there; they are fused all the same"}};
  if (!used.empty()) rows.rms_used = report::rms_of(used);
  rows.rms_all = report::rms_of(every);
  rows.unexplained.push_back(
      fit.nothing_held_out ? "These errors are of the run that was fitted: nothing was held out."
                           : "These errors are of the runs that were fitted; those held out stand above.");
  return rows;
}

report::Page page_of(const CalibrateFusionOptions& options, const Recordings& all, const FusionFit& fit,
                     const report::LeftOut& left_out) {
  const bool observer = fit.method == metrology::FusionMethod::observer;
  report::Page page{"Sensor fusion", std::to_string(all.runs.size()) + " runs from " +
                                         std::to_string(options.recordings.size()) + " recordings"};
  page.callout(std::string{"Chosen: the "} +
                   (observer ? "structured observer" : "weights over speed and noise") + "; RMS error " +
                   where_of(fit) + " " + si(fit.observer_rms, "m") + " (observer), " +
                   si(fit.weights_rms, "m") + " (weights)" +
                   (fit.polynomial_rms > 0.0 ? ", " + si(fit.polynomial_rms, "m") + " (polynomial)" : ""),
               fit.nothing_held_out ? "warn" : "good");
  for (const auto& what : fit.unidentified) page.callout("Not identified: " + what, "warn");
  for (const auto& note : fit.notes) page.paragraph(note);
  report::show(page, left_out);
  page.heading("Sensors");
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < fit.sensors.positions.size(); ++i) {
    const auto& sensor = fit.sensors.positions[i];
    rows.push_back({fit.sensors.position_names[i], "position", si(sensor.step, "m"), si(sensor.offset, "m"),
                    si(sensor.delay, "s"), si(sensor.hysteresis, "m"), si(sensor.noise, "m")});
  }
  page.table({"sensor", "kind", "step", "offset", "delay", "hysteresis", "noise of an edge"}, rows);
  rows.clear();
  for (std::size_t i = 0; i < fit.sensors.velocities.size(); ++i) {
    const auto& sensor = fit.sensors.velocities[i];
    rows.push_back({fit.sensors.velocity_names[i], "velocity", number(sensor.sensitivity(0.0), 5),
                    number(sensor.response(sensor.fastest) / sensor.fastest, 5), si(sensor.lag, "s"),
                    si(sensor.offset, "m/s"), number(sensor.correlation)});
  }
  if (!rows.empty())
    page.table(
        {"sensor", "kind", "gain at rest", "gain at full speed", "lag", "offset", "noise integrated / white"},
        rows);
  page.heading("Where each method wins");
  rows.clear();
  report::Plot plot;
  plot.title = fit.nothing_held_out ? "Error of the run that was fitted" : "Error of runs held out";
  plot.x_label = "noise level";
  plot.y_label = "RMS error [mm]";
  plot.log_x = plot.log_y = true;
  report::Series series[3];
  const char* labels[] = {"observer", "weights", "best single sensor"};
  for (int k = 0; k < 3; ++k) {
    series[k].label = labels[k];
    series[k].style = report::Series::Style::points;
  }
  std::map<double, int> wins;
  for (const auto& held : fit.held_out) {
    const bool wins_observer = held.observer <= held.weights;
    rows.push_back({number(held.noise_level), number(held.speed), si(held.observer, "m"),
                    si(held.weights, "m"), si(held.best_single, "m"),
                    wins_observer ? "observer" : "weights"});
    const double values[] = {held.observer, held.weights, held.best_single};
    for (int k = 0; k < 3; ++k) {
      series[k].x.push_back(std::max(held.noise_level, 1e-3));
      series[k].y.push_back(1e3 * values[k]);
    }
  }
  plot.series.assign(std::begin(series), std::end(series));
  page.plot(std::move(plot));
  page.table({"noise level", "speed [m/s]", "observer", "weights", "best single (hindsight)", "better"},
             rows);
  page.heading("Weights by least squares, run by run");
  rows.clear();
  std::vector<std::string> header{"noise level", "speed [m/s]"};
  for (const auto& name : fit.sensors.position_names) header.push_back("k " + name);
  for (const auto& name : fit.sensors.velocity_names) header.push_back("k " + name);
  for (const auto& held : fit.held_out) {
    std::vector<std::string> row{number(held.noise_level), number(held.speed)};
    for (const double weight : held.fitted) row.push_back(number(weight));
    row.resize(header.size());
    rows.push_back(std::move(row));
  }
  page.paragraph(
      "In the form of tables 4.1 and 4.2. A weight found at constant speed does not carry over to other "
      "motion, because an integral remembers its errors.");
  page.table(header, rows);
  return page;
}

nlohmann::json report_of(const Recordings& all, const FusionFit& fit, const report::LeftOut& left_out) {
  nlohmann::json report;
  report["kind"] = "fusion";
  report["runs"] = all.runs.size();
  report["method"] = fit.method == metrology::FusionMethod::observer ? "observer" : "weights";
  const std::string errors = fit.nothing_held_out ? "fitted_rms_m" : "held_out_rms_m";
  report[errors] = {{"observer", fit.observer_rms}, {"weights", fit.weights_rms}};
  if (fit.polynomial_rms > 0.0) report[errors]["polynomial"] = fit.polynomial_rms;
  report["polynomial_degree"] = fit.degree;
  if (fit.noise_by_speed_rms > 0.0) report[errors]["noise_by_speed"] = fit.noise_by_speed_rms;
  report["rows"] = report::json_of(left_out);
  report["unidentified"] = fit.unidentified;
  report["notes"] = fit.notes;
  for (std::size_t i = 0; i < fit.sensors.positions.size(); ++i) {
    const auto& sensor = fit.sensors.positions[i];
    report["positions"].push_back({{"name", fit.sensors.position_names[i]},
                                   {"step_m", sensor.step},
                                   {"offset_m", sensor.offset},
                                   {"delay_s", sensor.delay},
                                   {"hysteresis_m", sensor.hysteresis},
                                   {"noise_m", sensor.noise}});
  }
  for (std::size_t i = 0; i < fit.sensors.velocities.size(); ++i) {
    const auto& sensor = fit.sensors.velocities[i];
    report["velocities"].push_back({{"name", fit.sensors.velocity_names[i]},
                                    {"gain", sensor.sensitivity(0.0)},
                                    {"gain_at_full_speed", sensor.response(sensor.fastest) / sensor.fastest},
                                    {"lag_s", sensor.lag},
                                    {"offset_m_s", sensor.offset}});
  }
  for (const auto& held : fit.held_out)
    report[fit.nothing_held_out ? "runs_fitted" : "runs_held_out"].push_back(
        {{"noise_level", held.noise_level},
         {"speed_m_s", held.speed},
         {"observer_m", held.observer},
         {"weights_m", held.weights},
         {"best_single_m", held.best_single},
         {"weights", held.fitted}});
  return report;
}

void calibrate(const CalibrateFusionOptions& options) {
  const Recordings all = read_recordings(options);
  metrology::FusionOptions how;
  how.polynomial = options.model == "polynomial";
  how.noise_estimated = options.noise == "estimated";
  const FusionFit fit = [&] {
    const Progress progress{"identifying the sensors and holding out runs"};
    return metrology::identify_fusion(all.runs, all.positions, all.velocities, how);
  }();
  const bool observer = fit.method == metrology::FusionMethod::observer;
  compensation::ModelText text{"fusion", options.recordings};
  const bool noise_given = !how.noise_estimated && all.runs.front().noise_level.size() > 0;
  const compensation::FusionFile model{observer ? "observer" : "weights", noise_given, fit.sensors,
                                       fit.weights, all.selector};
  compensation::write_fusion(text, model);
  const report::LeftOut left_out = rows_of(all, fit, *compensation::make_estimator(model));
  write_calibration(options.out, text, report_of(all, fit, left_out), page_of(options, all, fit, left_out));

  std::cout << "fusion of " << all.positions.size() << " position and " << all.velocities.size()
            << " velocity sensors from " << all.runs.size() << " runs\n";
  double single = 0.0;
  std::size_t wins = 0;
  for (const auto& held : fit.held_out) {
    single += held.best_single * held.best_single / static_cast<double>(fit.held_out.size());
    wins += held.observer <= held.weights ? 1U : 0U;
  }
  std::cout << "RMS " << where_of(fit) << ": best single sensor (hindsight) " << si(std::sqrt(single), "m")
            << ", weights " << si(fit.weights_rms, "m") << ", observer " << si(fit.observer_rms, "m");
  if (fit.noise_by_speed_rms > 0.0)
    std::cout << ", weights with the noise from the speed " << si(fit.noise_by_speed_rms, "m");
  if (fit.polynomial_rms > 0.0)
    std::cout << ", polynomial " << si(fit.polynomial_rms, "m") << " (order taken: " << fit.degree << ")";
  std::cout << "\nchosen: " << (observer ? "observer" : "weights") << "; the observer is better on " << wins
            << " of " << fit.held_out.size() << " runs\n";
  std::cout << line_of(left_out) << '\n';
  for (const auto& note : fit.notes) std::cout << "note: " << note << '\n';
  for (const auto& what : fit.unidentified) std::cout << "not identified: " << what << '\n';
  std::cout << written(options.out, "compensation.yaml") << '\n';
}

}  // namespace

void add_calibrate_fusion(CLI::App& group) {
  auto* command = group.add_subcommand("fusion", "One position from several position and velocity sensors");
  command->footer("Example: invar calibrate fusion --recording quiet.csv --recording noisy.csv --out result");
  auto options = std::make_shared<CalibrateFusionOptions>();
  command
      ->add_option("--recording", options->recordings,
                   "t [s], reference [m], position_<name> [m], velocity_<name> [m/s]; optional run, "
                   "noise_level, selector_<name>")
      ->required();
  command->add_option("--out", options->out, "folder for compensation.yaml, report.json, report.html")
      ->required();
  command->add_option("--model", options->model, "linear, or also try all monomials (polynomial)")
      ->check(CLI::IsMember({"linear", "polynomial"}))
      ->capture_default_str();
  command->add_option("--noise", options->noise, "noise level: the column's (given), or estimated")
      ->check(CLI::IsMember({"given", "estimated"}))
      ->capture_default_str();
  command->callback([options] { calibrate(*options); });
}

recording::Table predict_fusion(const config::Yaml& file, const recording::Table& inputs) {
  compensation::check_seal(file);
  file.root()["identified_from"].accept_all();
  const auto model = compensation::read_fusion(file.root());
  file.finish();
  const auto estimator = compensation::make_estimator(model);
  const bool with_noise = model.noise_given && inputs.has("noise_level");
  const auto& names = model.sensors;
  std::vector<double> position;
  std::vector<double> sigma;
  std::vector<std::vector<double>> weights(names.positions.size() + names.velocities.size());
  for (const FusionRun& run :
       runs_of(inputs, names.position_names, names.velocity_names, model.selector, false, with_noise))
    for (const auto& fused : metrology::fuse(*estimator, run)) {
      position.push_back(fused.position);
      sigma.push_back(fused.sigma);
      for (std::size_t k = 0; k < weights.size(); ++k) weights[k].push_back(fused.weights[k]);
    }
  recording::Table output;
  output.add("position", "m", std::move(position));
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const bool is_position = k < names.positions.size();
    const std::string& name =
        is_position ? names.position_names[k] : names.velocity_names[k - names.positions.size()];
    output.add("k_" + name, "", std::move(weights[k]));
  }
  if (model.method == "observer") output.add("sigma", "m", std::move(sigma));
  return output;
}

}  // namespace invar::tools

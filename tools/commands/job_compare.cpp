// `invar job compare`: a recorded run beside the simulated one - same reference, same servo, the machine's parameters.
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>

#include "core/base/unit.hpp"
#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/model/recording_file.hpp"
#include "tools/commands/job.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

struct JobCompareOptions {
  std::filesystem::path recording;
  std::filesystem::path machine;
  std::filesystem::path out = "out/compare";
  bool json = false;
};

struct Difference {
  std::string signal;
  std::string unit;
  double rms = 0.0;
  double maximum = 0.0;
  double spread = 0.0;  // standard deviation of the recorded signal
};

Difference difference(const physics::Signal& signal, const std::vector<double>& recorded,
                      const std::vector<double>& simulated) {
  Difference result{signal.column, signal.unit, 0.0, 0.0, 0.0};
  double squares = 0.0;
  double sum = 0.0;
  double sum_squares = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    if (!std::isfinite(recorded[i]) || !std::isfinite(simulated[i])) continue;
    const double error = recorded[i] - simulated[i];
    squares += error * error;
    sum += recorded[i];
    sum_squares += recorded[i] * recorded[i];
    result.maximum = std::max(result.maximum, std::abs(error));
    count += 1.0;
  }
  if (count > 0.0) {
    result.rms = std::sqrt(squares / count);
    result.spread = std::sqrt(std::max(0.0, sum_squares / count - sum * sum / (count * count)));
  }
  return result;
}

void compare(const JobCompareOptions& options) {
  const auto model = model::load(options.machine);
  const auto table = model::read_recording(options.recording, model).front();
  const auto recorded = model::to_record(table, model, true);
  physics::Outputs simulated;
  physics::prepare(model, recorded.record)->run(model, simulated);

  report::Page page{"Recorded against simulated",
                    options.recording.filename().string() + " on " + options.machine.filename().string()};
  page.paragraph(
      "The recorded inputs were run through the model of the machine with its own controller; nothing was "
      "fitted. Where the curves part, the model leaves something out: `invar diagnose` finds what.");
  std::vector<std::vector<std::string>> rows;
  std::vector<report::Plot> plots;
  auto json = nlohmann::ordered_json::array();
  if (!options.json) std::cout << "signal            rms difference   largest          share of the signal\n";
  const auto outputs = model.outputs();
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    const physics::Signal& signal = *model.signal(outputs[k]);
    const auto* measured = recorded.record.find(signal.name);
    if (measured == nullptr) continue;
    const Difference d = difference(signal, *measured, simulated[k]);
    const std::string share = d.spread > 0.0 ? report::number(100.0 * d.rms / d.spread, 2) + " %" : "-";
    rows.push_back({d.signal, report::si(d.rms, d.unit), report::si(d.maximum, d.unit), share});
    json.push_back({{"signal", d.signal},
                    {"unit", d.unit},
                    {"rms_difference", d.rms},
                    {"largest_difference", d.maximum},
                    {"spread", d.spread}});
    if (!options.json)
      std::printf("%-17s %-16s %-16s %s\n", d.signal.c_str(), rows.back()[1].c_str(), rows.back()[2].c_str(),
                  share.c_str());
    report::Series was{.label = "recorded",
                       .style = report::Series::Style::line,
                       .x = recorded.record.time,
                       .y = *measured,
                       .u = {},
                       .v = {},
                       .colour = ""};
    report::Series is = was;
    is.label = "simulated";
    is.y = simulated[k];
    report::Series rest = was;
    rest.label = "";
    for (std::size_t i = 0; i < rest.y.size(); ++i) rest.y[i] -= simulated[k][i];
    report::Plot both;
    both.title = signal.column;
    both.x_label = "t [s]";
    both.y_label = signal.column + " [" + d.unit + "]";
    both.series = {was, is};
    report::Plot apart = both;
    apart.title = signal.column + ": recorded minus simulated";
    apart.series = {rest};
    plots.push_back(both);
    plots.push_back(apart);
  }
  if (rows.empty())
    throw InputError{options.recording.string(), "holds none of the model's outputs",
                     "record at least one of them"};
  page.table({"signal", "rms difference", "largest difference", "share of the signal's spread"}, rows);
  page.plots(plots);
  std::filesystem::create_directories(options.out);
  page.write(options.out / "report.html");
  const std::string report = (options.out / "report.html").string();
  if (options.json)
    std::cout << nlohmann::ordered_json{{"recording", options.recording.string()},
                                        {"machine", options.machine.string()},
                                        {"signals", json},
                                        {"report", report}}
                     .dump(2)
              << '\n';
  else
    std::cout << "report: " << report << '\n';
}

}  // namespace

void add_job_compare(CLI::App& job) {
  auto* command =
      job.add_subcommand("compare", "Run a recorded reference through servo and plant, beside the recording");
  command->footer(
      "Example: invar job compare --recording recording.csv.gz --machine model.yaml --out out/compare");
  auto options = std::make_shared<JobCompareOptions>();
  command->add_option("--recording", options->recording, "recording of the machine, .csv, .csv.gz or .mcap")
      ->required();
  command->add_option("--machine", options->machine, "model.yaml: parameters and controller of the machine")
      ->required();
  command->add_option("--out", options->out, "folder for report.html")->capture_default_str();
  command->add_flag("--json", options->json, "print the differences as JSON, in SI");
  command->callback([options] { compare(*options); });
}

}  // namespace invar::tools

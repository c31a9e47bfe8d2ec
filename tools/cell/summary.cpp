#include "tools/cell/summary.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/base/shown.hpp"
#include "core/metrology/geometric/line_errors.hpp"
#include "core/recording/export.hpp"
#include "core/recording/recording_reader.hpp"
#include "core/recording/table.hpp"
#include "tools/cell/fusion_summary.hpp"
#include "tools/cell/heat_summary.hpp"
#include "tools/cell/motion_summary.hpp"
#include "tools/cell/print_summary.hpp"
#include "tools/live/text_table.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

using report::number;
using report::Plot;
using report::Series;
using report::si;

metrology::LineErrors read_verification(const std::filesystem::path& file) {
  const auto table = recording::Table::read(file, {"line"});
  return metrology::line_errors({table.find("line")->texts, table.in("x", "m"), table.in("y", "m"),
                                 table.in("z", "m"), table.in("displacement", "m")});
}

Series line_of(const std::vector<double>& x, const std::vector<double>& y, double x_factor, double y_factor,
               const std::string& label, Series::Style style = Series::Style::line) {
  Series series;
  series.label = label;
  series.style = style;
  for (std::size_t i = 0; i < x.size(); ++i) {
    series.x.push_back(x[i] * x_factor);
    series.y.push_back(y[i] * y_factor);
  }
  return series;
}

void add_verification(report::Page& page, const metrology::LineErrors& before,
                      const metrology::LineErrors& after) {
  page.heading("Lines that were not used to identify the error");
  std::vector<Plot> plots;
  for (std::size_t k = 0; k < before.lines.size() && k < after.lines.size(); ++k) {
    Plot plot;
    plot.title = before.lines[k].name;
    plot.x_label = "way along the line [mm]";
    plot.y_label = "error of displacement [um]";
    plot.series = {line_of(before.lines[k].way, before.lines[k].error, 1e3, 1e6, "before"),
                   line_of(after.lines[k].way, after.lines[k].error, 1e3, 1e6, "after")};
    plots.push_back(plot);
  }
  page.plots(plots,
             "Read by the laser, each line forth and back, before and after the compensation was activated.");
}

/// The heater's trace out of the recording; nothing where none was made.
void add_heater(report::Page& page, const std::filesystem::path& folder, std::ostream& out) {
  const auto file = folder / "recording.mcap";
  if (!std::filesystem::exists(file)) return;
  const auto recording = recording::Recording::open(file);
  recording::ExportOptions how;
  for (const auto& [number_, channel] : recording.channels())
    if (channel.topic.ends_with("/thermal/state")) how.selection.topics.insert(channel.topic);
  if (how.selection.topics.empty()) return;
  const auto tables = folder / "tables";
  const auto exported = recording::export_recording(recording, tables, how);
  for (const auto& topic : exported.topics) {
    if (topic.file.empty()) continue;
    const auto table = recording::Table::read(topic.file);
    std::vector<double> time(table.rows());
    const auto stamps = table.in("at.time_ns", "");
    for (std::size_t i = 0; i < time.size(); ++i) time[i] = (stamps[i] - stamps.front()) * 1e-9;
    const auto temperature = table.in("temperature", "degC");
    const auto setpoint = table.in("setpoint", "degC");
    const auto power = table.in("heater_power", "W");
    Plot trace;
    trace.title = "Slide temperature";
    trace.x_label = "t [s]";
    trace.y_label = "T [degC]";
    trace.series = {line_of(time, temperature, 1, 1, "slide"),
                    line_of(time, setpoint, 1, 1, "setpoint", Series::Style::dashed)};
    Plot drive = trace;
    drive.title = "Heater power";
    drive.y_label = "P [W]";
    drive.series = {line_of(time, power, 1, 1, "")};
    page.heading("Heater, over Modbus TCP");
    page.plots({trace, drive});
    double worst = 0.0;
    for (std::size_t i = 0; i < time.size(); ++i)
      if (time[i] > 0.5 * time.back()) worst = std::max(worst, std::abs(temperature[i] - setpoint[i]));
    out << "heater          " << number(temperature.back(), 4) << " degC at the end, within "
        << number(worst, 2) << " K of " << number(setpoint.back(), 4) << " degC over the second half\n";
  }
}

bool is_done(const nlohmann::json& job) { return job.is_object() && job.value("done", false); }

void summarise_job(const nlohmann::json& job, report::Page& page, std::ostream& out) {
  const std::filesystem::path folder = job.value("result", "");
  out << "job             " << job.value("name", "") << ": " << job.value("text", "") << '\n';
  if (!is_done(job)) return;  // the files there are of an earlier one, or not whole
  page.paragraph("Job " + job.value("name", "") + ": " + job.value("text", "") + ".");
  add_print_verdict(folder, page);
  const auto before_file = folder / "verify_before.csv";
  const auto after_file = folder / "verify_after.csv";
  if (std::filesystem::exists(before_file) && std::filesystem::exists(after_file)) {
    const auto before = read_verification(before_file);
    const auto after = read_verification(after_file);
    out << "error before    rms " << si(before.rms, "m") << ", max " << si(before.maximum, "m")
        << "   (lines not fitted)\n"
        << "error after     rms " << si(after.rms, "m") << ", max " << si(after.maximum, "m") << "   ("
        << number(before.rms / after.rms, 2) << " times less)\n";
    page.callout("On lines that were not used to identify it, the error of the machine fell from " +
                     si(before.rms, "m") + " to " + si(after.rms, "m") + " RMS (largest " +
                     si(before.maximum, "m") + " to " + si(after.maximum, "m") + ").",
                 after.rms < before.rms ? "good" : "bad");
    add_verification(page, before, after);
  }
  summarise_print(folder, page, out);
  summarise_fusion(folder, page, out);
  summarise_heat(folder, page, out);
  summarise_motion(folder, page, out);
  add_heater(page, folder, out);
}

/// The lines of a summary by the word that they begin with, as wide as a column.
nlohmann::ordered_json by_name(const std::string& lines) {
  constexpr std::size_t column = 16;
  auto json = nlohmann::ordered_json::object();
  std::istringstream stream{lines};
  for (std::string line; std::getline(stream, line);) {
    if (line.size() <= column) continue;
    std::string name = line.substr(0, column);
    name.erase(name.find_last_not_of(' ') + 1);
    if (!name.empty()) json[name] = line.substr(column);
  }
  return json;
}

/// What the processes left, as a table and for programs.
struct Processes {
  inline static const std::vector<std::string> header{
      "process", "rate", "cycles", "overruns", "late", "compute p50 / p99 [us]", "wake-up p50 / p99 [us]"};

  explicit Processes(const LaunchOutcome& outcome) {
    for (const ProcessOutcome& process : outcome.processes) add(process, outcome.simulated);
  }

  void print(std::ostream& out) const {
    TextTable table{header};
    for (const auto& cells : rows) table.add(cells);
    table.print(out);
    out << '\n';
    for (const std::string& line : notes) print_wrapped(line, 16, out);
    if (!notes.empty()) out << '\n';
  }

  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> notes;  // what was not as declared
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  nlohmann::json job;
  std::vector<std::string> recordings;
  std::vector<std::string> faults;  // what was wrong when the cell was asked to stop

 private:
  void add(const ProcessOutcome& process, bool simulated) {
    auto report = nlohmann::json::parse(process.report, nullptr, false);
    if (report.is_discarded()) {
      rows.push_back(
          {process.process, "-", "-", "-", "-", "-", "ended with status " + std::to_string(process.status)});
      json.push_back({{"name", process.process}, {"status", process.status}});
      return;
    }
    const auto half_and_tail = [&](const char* what) {
      const auto us = [&](const char* key) {
        return number(
            report.value(nlohmann::json::json_pointer{std::string{"/"} + what + "/" + key}, 0.0) * 1e-3, 3);
      };
      return simulated ? "-" : us("p50_ns") + " / " + us("p99_ns");
    };
    rows.push_back({process.process, number(report.value("rate_hz", 0.0), 4) + " Hz",
                    std::to_string(report.value("cycles", 0ULL)),
                    std::to_string(report.value("overruns", 0ULL)),
                    report.value("latency_limit_ns", std::int64_t{0}) > 0 && !simulated
                        ? std::to_string(report.value("late", 0ULL))
                        : "-",
                    half_and_tail("compute"), half_and_tail("wake_up")});
    for (const auto& line : report.value("faults", std::vector<std::string>{})) {
      faults.push_back(line);
      notes.push_back("at the end      " + line);
    }
    for (const auto& line : report.value("not_granted", std::vector<std::string>{}))
      notes.push_back("not granted     " + process.process + ": " + line);
    for (const auto& input : report.value("late_inputs", nlohmann::json::array()))
      if (const auto late = input.value("late", 0ULL); late > 0 && !simulated)
        notes.push_back("late input      " + input.value("input", "") + ": " + std::to_string(late) + " of " +
                        std::to_string(input.value("steps", 0ULL)) + " steps read a sample older than " +
                        milliseconds({input.value("limit_ns", std::int64_t{0})}, 4) + "; the oldest of " +
                        milliseconds({input.value("max_ns", std::int64_t{0})}, 4));
    if (report.contains("job")) job = report["job"];
    if (report.contains("recording")) recordings.push_back(report["recording"]);
    report["status"] = process.status;
    json.push_back(nlohmann::ordered_json(report));
  }
};

}  // namespace

nlohmann::ordered_json summarise(const LaunchOutcome& outcome, std::ostream& out) {
  report::Page page{"Invar: a cell and its job",
                    outcome.simulated ? "in simulated time" : "by the wall clock"};
  Processes processes{outcome};
  processes.print(out);
  nlohmann::ordered_json json{{"healthy", outcome.failure.empty() && processes.faults.empty()},
                              {"failure", outcome.failure},
                              {"faults", processes.faults},
                              {"simulated", outcome.simulated},
                              {"wall_seconds", outcome.wall_seconds},
                              {"processes", processes.json},
                              {"job", processes.job},
                              {"summary", nlohmann::ordered_json::object()},
                              {"report", nullptr},
                              {"recordings", processes.recordings}};
  if (!processes.job.is_null()) {
    std::ostringstream lines;
    summarise_job(processes.job, page, lines);
    out << lines.str();
    json["summary"] = by_name(lines.str());
  }
  out << "time            " << number(outcome.wall_seconds, 3) << " s of the wall clock";
  if (!processes.job.is_null())
    out << " for a job of " << number(processes.job.value("seconds", 0.0), 4) << " s of the cell";
  out << '\n';
  page.heading("Processes");
  page.table(Processes::header, processes.rows);
  // Only what is there is named: a job that failed may have left nothing, and what lies there may be another's.
  const std::filesystem::path folder = processes.job.is_null() ? "" : processes.job.value("result", "");
  if (is_done(processes.job) && std::filesystem::is_directory(folder)) {
    page.write(folder / "report.html");
    json["report"] = (folder / "report.html").string();
    out << "report          " << (folder / "report.html").string() << '\n';
  }
  for (const std::string& file : processes.recordings) out << "recording       " << file << '\n';
  return json;
}

}  // namespace invar::tools

// `invar calibrate history`: the calibrations of a machine over time, what moved, and when the next is due.
#include <algorithm>
#include <iostream>
#include <map>
#include <memory>

#include "core/base/new_file.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/history/history_page.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

struct CalibrateHistoryOptions {
  std::filesystem::path folder;
  std::filesystem::path out;
  double accuracy = 0.0;  // 0: none is wanted
  bool json = false;
};

/// One kind's history; a calibration that cannot be compared takes the kind to those left out.
void add_kind(const std::string& kind, std::vector<Calibration> calibrations,
              const CalibrateHistoryOptions& options, std::vector<KindHistory>& kinds,
              report::LeftOut& left_out) {
  KindHistory history{kind, std::move(calibrations), {}, std::nullopt, {}};
  if (options.accuracy > 0.0) history.accuracy = options.accuracy;
  try {
    std::vector<double> times;
    for (const auto& one : history.calibrations) times.push_back(one.time);
    history.names = histories_of(comparable_numbers(history.calibrations), times);
  } catch (const InputError& fault) {
    for (const auto& one : history.calibrations) left_out.rows.push_back({one.file.string(), fault.what()});
    return;
  }
  if (history.accuracy && history.calibrations.size() > 1)
    history.due = due_for(history.names, *history.accuracy);
  left_out.used += history.calibrations.size();
  kinds.push_back(std::move(history));
}

void print_history(const std::vector<KindHistory>& kinds, const report::LeftOut& left_out) {
  for (const auto& kind : kinds) {
    std::cout << kind.kind << ": " << kind.calibrations.size() << " calibrations, "
              << time_text(kind.calibrations.front().time) << " to "
              << time_text(kind.calibrations.back().time) << '\n';
    if (kind.calibrations.size() < 2) {
      std::cout << "  one calibration only: what moves cannot be told\n";
      continue;
    }
    std::size_t still = 0;
    for (const auto& name : kind.names) {
      const NumberHistory& one = name.numbers[name.farthest];
      const std::string unit = name.unit.empty() ? "1" : name.unit;
      if (name.verdict == NameHistory::Verdict::still) {
        ++still;
        continue;
      }
      std::cout << "  " << name.name << (one.last.place.empty() ? "" : " at " + one.last.place) << ": "
                << report::si(one.moved, unit);
      if (one.sigma > 0.0) std::cout << ", " << report::number(times_sigma(name), 3) << " times its sigma";
      std::cout << "; " << verdict_words(name.verdict) << '\n';
    }
    if (still > 0) std::cout << "  " << still << " others are within their sigma\n";
    if (kind.accuracy) std::cout << "  " << due_words(kind) << '\n';
  }
  for (const auto& row : left_out.rows) std::cout << "left out: " << row[0] << ": " << row[1] << '\n';
}

void history(const CalibrateHistoryOptions& options) {
  const FoundCalibrations found = find_calibrations(options.folder);
  report::LeftOut left_out;
  left_out.row = "calibration";
  left_out.given = found.all.size() + found.left_out.size();
  left_out.header = {"file", "why"};
  for (const auto& [file, why] : found.left_out) left_out.rows.push_back({file.string(), why});
  std::map<std::string, std::vector<Calibration>> by_kind;
  for (const auto& one : found.all) by_kind[one.kind].push_back(one);
  std::vector<KindHistory> kinds;
  for (auto& [kind, calibrations] : by_kind)
    add_kind(kind, std::move(calibrations), options, kinds, left_out);
  if (kinds.empty())
    throw InputError{options.folder.string(),
                     left_out.rows.empty()
                         ? "holds no calibration"
                         : "holds no calibration that can be read: " + left_out.rows.front()[1],
                     "keep the folder that each `calibrate --out` wrote below it, named by its date"};
  left_out.reasons = {{left_out.given - left_out.used, "that could not be read or compared"}};
  const auto json = history_json(kinds, left_out);
  if (!options.out.empty()) {
    std::error_code failed;
    std::filesystem::create_directories(options.out, failed);
    if (failed || !std::filesystem::is_directory(options.out))
      throw InputError{options.out.string(), "cannot be made", "name a folder that may be written to"};
    history_page(options.folder.string(), kinds, left_out).write(options.out / "report.html");
    write_file(options.out / "report.json", json.dump(1) + "\n");
  }
  if (options.json) {
    std::cout << json.dump(1) << '\n';
    return;
  }
  print_history(kinds, left_out);
  if (!options.out.empty())
    std::cout << "wrote " << (options.out / "report.json").string() << ", "
              << (options.out / "report.html").string() << '\n';
}

}  // namespace

void add_calibrate_history(CLI::App& group) {
  auto* command =
      group.add_subcommand("history", "A machine's calibrations over time: what moved, when the next is due");
  command->footer(
      "Example: invar calibrate history calibrations --accuracy 2e-6 --out history\n"
      "FOLDER holds the folders that `calibrate --out` wrote, at any depth. When each was made says its "
      "folder's name if "
      "it begins with a\n"
      "date (2026-11-27 or 2026-11-27T0930, UTC), else `calibrated_at` of report.json, else the file's "
      "date.\n"
      "The next is due when what the last one left open, the drift since then and what wanders beyond it "
      "reach the "
      "accuracy\n"
      "(two sigma, RMS over the places). Exit status: 0; 2 there is nothing to compare.");
  auto options = std::make_shared<CalibrateHistoryOptions>();
  command->add_option("folder", options->folder, "folder of calibrations")->required();
  command
      ->add_option("--accuracy", options->accuracy,
                   "wanted of the machine's error [m]; of a rotary axis [rad], a thermistor [K]")
      ->check(positive());
  command->add_option("--out", options->out, "folder for report.html and report.json");
  command->add_flag("--json", options->json, "print report.json instead of the summary");
  command->callback([options] { history(*options); });
}

}  // namespace invar::tools

// `invar diagnose`: which physics does the model leave out? Writes report.json, report.html and patched.yaml.
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <limits>
#include <memory>
#include <sstream>
#include <stop_token>
#include <thread>

#include "core/diagnosis/checks/clock.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/report/model_files.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/assumed.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/diagnosis/search/other_run.hpp"
#include "core/model/model_file.hpp"
#include "core/physics/library.hpp"
#include "tools/command.hpp"
#include "tools/diagnose/example.hpp"
#include "tools/diagnose/report_folder.hpp"
#include "tools/diagnose/report_page.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/patience.hpp"
#include "tools/live/terminal.hpp"
#include "tools/other_file.hpp"

namespace invar::tools {

namespace {

using Clock = std::chrono::steady_clock;

struct DiagnoseOptions {
  std::filesystem::path model;
  std::vector<std::filesystem::path> recordings;
  std::filesystem::path out = "diagnosis";
  std::vector<std::filesystem::path> checks, check_outputs;
  std::vector<std::string> assumed;
  bool fits_check_start = false;
  bool json = false;
  unsigned seed = 1;
  double budget = 60.0;  // s
};

/// What of the budget the search itself may take: what is known must still be held out, compared and drawn.
constexpr double for_search = 0.75;

/// `[######--------------]  31 %  fitting the short list`, on a terminal alone; gone when it goes, also by a fault.
class ProgressLine {
 public:
  ~ProgressLine() { clear(); }
  void show(double share, const std::string& what) const {
    if (!is_seen_) return;
    constexpr int width = 24;
    std::string bar(width, '-');
    std::fill_n(bar.begin(), static_cast<std::ptrdiff_t>(share * width), '#');
    steer(std::cerr, clear_line);
    std::cerr << "[" << bar << "] " << std::setw(3) << static_cast<int>(100.0 * share) << " %  " << what
              << std::flush;
  }
  void clear() const {
    if (is_seen_) steer(std::cerr, clear_line);
  }

 private:
  bool is_seen_ = isatty(STDERR_FILENO) == 1;
};

/// Requests a stop of the search at the first Ctrl-C, so that what is known is reported, or when its time is over. A second
/// Ctrl-C ends the program.
class Ending {
 public:
  explicit Ending(Clock::time_point deadline)
      : watch_{[this, deadline](const std::stop_token& gone) {
          constexpr std::chrono::milliseconds pause{20};
          while (!gone.stop_requested() && !interrupted() && Clock::now() < deadline)
            std::this_thread::sleep_for(pause);
          source_.request_stop();
        }} {}
  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }

 private:
  std::stop_source source_;
  std::jthread watch_;
};

/// What a fit has seen proves nothing of it.
void check_are_others(const DiagnoseOptions& options) {
  for (const auto& check : options.checks)
    for (const auto& recording : options.recordings) {
      std::error_code unknown;  // a file that is not there is said when it is read
      if (std::filesystem::equivalent(check, recording, unknown))
        throw InputError{
            "--check", check.string() + " is a --recording too, and a fit proves nothing on what it has seen",
            "name a recording that is in no --recording"};
    }
}

/// Columns as long as a recording come and go by the hundred. Given back each time, their pages would have to be cleared
/// for the next: a tenth of all the time.
void keep_memory() {
  (void)mallopt(M_MMAP_THRESHOLD, 1 << 30);
  (void)mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  (void)mallopt(M_ARENA_MAX, 1);  // what one thread leaves another may use
}

/// The summary; on a terminal the lines that warn are red.
void print_summary(const std::string& summary) {
  const bool is_seen = isatty(STDOUT_FILENO) == 1;
  std::istringstream lines{summary};
  for (std::string line; std::getline(lines, line);) {
    const bool is_red = is_seen && line.starts_with("Worse on ");
    if (is_red) steer(std::cout, red);
    std::cout << line;
    if (is_red) steer(std::cout, plain);
    std::cout << '\n';
  }
}

int run(const DiagnoseOptions& options) {
  const auto began = Clock::now();
  keep_memory();
  if (!(options.budget > 0.0) || !std::isfinite(options.budget))
    throw InputError{"--budget", "is no time above 0 s", "give seconds, for example --budget 60"};
  if (!options.check_outputs.empty() && options.check_outputs.size() != options.checks.size())
    throw InputError{"--check-outputs",
                     "are " + std::to_string(options.check_outputs.size()) + ", but --check are " +
                         std::to_string(options.checks.size()),
                     "give one file of outputs for each --check, in the same order"};
  check_are_others(options);
  for (const auto* name : {"patched.yaml", "retuned.yaml"})
    expect_other_file("--out", options.out / name, {options.model});
  const auto yaml = config::Yaml::load(options.model);
  const auto model = model::read(yaml);
  yaml.finish();
  const ProgressLine line;
  const auto progress = [&](double share, const std::string& what) { line.show(share, what); };
  progress(0.0, "reading");
  auto data = diagnosis::load_case(model, options.recordings);
  diagnosis::check_runs(data, model, 0.5, options.model);  // the fit may mend a model that runs away late
  diagnosis::check_clock(data);
  std::vector<diagnosis::OtherRun> checks;  // read before the search: what is unusable is said at once
  for (std::size_t i = 0; i < options.checks.size(); ++i)
    checks.push_back(diagnosis::read_other_run(
        model, {options.checks[i], options.check_outputs.empty() ? "" : options.check_outputs[i],
                options.fits_check_start}));
  std::vector<diagnosis::Wanted> wanted;
  for (const auto& text : options.assumed) wanted.push_back(diagnosis::wanted_of(text));
  if (!wanted.empty()) diagnosis::check_wanted(data, wanted, "--assume");
  (void)interrupted();
  const Ending ending{began + std::chrono::duration_cast<Clock::duration>(
                                  std::chrono::duration<double>{for_search * options.budget})};
  diagnosis::Options how;
  how.stop = ending.token();
  diagnosis::ReportFolder{options.out};
  auto patience =
      std::make_unique<Patience>("invar: stopped before there was anything to say; no report was written");
  auto diagnosis = diagnosis::diagnose(data, progress, how);
  line.clear();
  if (diagnosis.is_partial && !interrupted()) diagnosis.budget = options.budget;
  diagnosis::check_runs(data, diagnosis.best.model, 0.0, options.model);
  if (!diagnosis.is_partial) diagnosis.assumed = diagnosis::fit_assumed(data, diagnosis, wanted);
  for (auto& run : checks) diagnosis::check_on(data, diagnosis, std::move(run));
  const auto json = diagnosis::report_json(data, diagnosis);
  const auto page = diagnosis::page_text(data, diagnosis, options.model.string());
  patience.reset();
  diagnosis::ReportFolder folder{options.out};
  const auto files = diagnosis::model_files(yaml, model, options.model.filename().string(), data, diagnosis);
  folder.put("retuned.yaml", files.retuned);
  folder.put("patched.yaml", files.patched);
  folder.put("report.html", page);
  folder.put("report.json", json + "\n");
  folder.finish();
  if (options.json)
    std::cout << json << '\n';
  else
    print_summary(diagnosis::summary(data, diagnosis) + "  " + (options.out / "report.html").string() + "\n");
  return diagnosis.is_partial && diagnosis.budget == 0.0 ? 130 : 0;
}

}  // namespace

void add_diagnose(CLI::App& program) {
  auto* command =
      program.add_subcommand("diagnose", "Find the physics that a model leaves out, and prove it");
  command->footer(
      "Example: invar diagnose --example thermal > model.yaml\n"
      "         invar diagnose --model model.yaml --recording run1.csv.gz --out diagnosis\n"
      "A CSV may be parted by commas, semicolons, tabs or blanks; `columns: {rate: 100, ...}` stands for a "
      "time column, `time: 1` for\n"
      "the first column of a file without header.\n"
      "In an .mcap a column of the model is component.port.field, that of the time component.port.at:\n"
      "  columns: {time: stage_x.state.at, reference: stage_x.state.setpoint_position + correction,\n"
      "            position: stage_x.state.position, current: stage_x.state.current, feedforward: "
      "remainder}\n"
      "where `remainder` is the part of the current that the law of the controller does not explain.\n"
      "Exit status: 0 a report was written, 2 unusable input, 130 stopped by Ctrl-C. The report then holds "
      "what "
      "was known by then and says so (none where nothing can be said ten seconds later)");
  auto options = std::make_shared<DiagnoseOptions>();
  command
      ->add_option_function<std::string>(
          "--example",
          [](const std::string& name) {
            physics::Plant plant{};
            if (!physics::plant_by_name(name, plant))
              throw InputError{"--example", "`" + name + "` is no plant",
                               "name axis, thermal, error_map, droplet, sensor or equations"};
            std::cout << diagnosis::example_model(plant);
            throw CLI::Success{};
          },
          "print a model.yaml to begin with, and no more: axis, thermal, error_map, droplet, sensor or "
          "equations (any "
          "machine, in your own equations)")
      ->trigger_on_parse();
  command->add_option("--model", options->model, "model.yaml: what you believe (--example shows one)")
      ->required();
  command
      ->add_option("--recording", options->recordings,
                   "recording of the machine, .csv, .csv.gz or .mcap; may be repeated")
      ->required();
  command
      ->add_option("--out", options->out,
                   "folder for report.json, report.html, patched.yaml and retuned.yaml (no physics added)")
      ->capture_default_str();
  command->add_option(
      "--check", options->checks,
      "another recording, which no fit sees. The given, the retuned and the patched model run over it; a "
      "model "
      "that integrates, over windows. Where patched is worse, summary, page, worse_on of report.json and the "
      "head of patched.yaml say so; may be repeated");
  command->add_option("--check-outputs", options->check_outputs,
                      "the outputs of each --check, where they lie in a file of their own");
  command->add_flag("--check-fits-start", options->fits_check_start,
                    "the first row of --check is a guess: each model starts where it comes nearest");
  command
      ->add_option(
          "--assume", options->assumed,
          "TERM or TERM:PLACE of the library, fitted beside the model's own numbers whatever is found; its "
          "figures stand beside the finding's; may be repeated")
      ->take_all();
  command->add_flag("--json", options->json, "print report.json instead of the summary");
  command
      ->add_option(
          "--budget", options->budget,
          "seconds that the diagnosis may take: where they end before all was tried, the report holds "
          "what was known by then and says what was not tried")
      ->capture_default_str();
  command->add_option("--seed", options->seed, "accepted for scripts; the search draws no random numbers")
      ->capture_default_str();
  command->callback([options] {
    if (const int status = run(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools

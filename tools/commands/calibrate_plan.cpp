// `invar calibrate plan`: the lines, interval and passes to measure for a wanted accuracy, and what to expect of them.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "core/base/fault.hpp"
#include "core/base/new_file.hpp"
#include "core/config/quotes.hpp"
#include "core/machine/machine_file.hpp"
#include "core/metrology/geometric/line_search.hpp"
#include "core/recording/table.hpp"
#include "tools/command.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/geometric/lines_file.hpp"
#include "tools/geometric/measuring_plan.hpp"
#include "tools/live/terminal.hpp"
#include "tools/positive.hpp"

namespace invar::tools {

namespace {

using metrology::PlannedLine;

struct CalibratePlanOptions {
  std::filesystem::path machine;
  std::filesystem::path pilot;
  std::filesystem::path output;
  std::filesystem::path report;
  double accuracy = 0.0;
  double noise = 1e-6;
  double motions = 2e-6;
  double angles = 8e-6;
  double setup_minutes = 15.0;
  double reading_seconds = 3.0;
  bool search = false;
};

std::string um(double value) { return report::number(1e6 * value, 3) + " um"; }

/// To the nanometre, so that 0.1 + 0.2 is written as 0.3.
double rounded(double value) { return std::round(1e9 * value) / 1e9; }

void write_table(const PlanChoice& choice, const std::filesystem::path& file) {
  recording::Table table;
  std::vector<std::string> names;
  std::array<std::vector<double>, 9> columns;
  std::vector<double> interval;
  std::vector<double> passes;
  for (const PlannedLine& line : choice.lines) {
    names.push_back(line.name);
    for (int k = 0; k < 3; ++k) {
      columns[static_cast<std::size_t>(k)].push_back(rounded(line.from[k]));
      columns[static_cast<std::size_t>(k) + 3].push_back(rounded(line.to[k]));
      columns[static_cast<std::size_t>(k) + 6].push_back(rounded(line.tool[k]));
    }
    const int points = metrology::points_of(line, choice.effort.interval);
    interval.push_back((line.to - line.from).norm() / (points - 1));
    passes.push_back(choice.effort.passes);
  }
  table.add_texts("line", names);
  const std::array<const char*, 9> titles{"from_x", "from_y", "from_z", "to_x",  "to_y",
                                          "to_z",   "tool_x", "tool_y", "tool_z"};
  for (std::size_t c = 0; c < 9; ++c) table.add(titles[c], "m", columns[c]);
  table.add("interval", "m", interval);
  table.add("passes", "", passes);
  table.write(file);
}

/// What the component `calibration` of a cell takes as one of its `jobs`; a cycle is a pass forth and back.
void write_job(const PlanChoice& choice, const metrology::Machine& machine,
               const CalibratePlanOptions& options) {
  const auto place = [&](const Eigen::Vector3d& at) {
    std::string text;
    for (int k = 0; k < 3; ++k)
      if (machine.chain.has(k)) text += (text.empty() ? "[" : ", ") + report::number(rounded(at[k]), 9);
    return text + "]";
  };
  std::string text =
      "# One of the `jobs` of the component `calibration`; add `verify`: lines that are not fitted.\n";
  text += "- name: calibrate-geometry\n  machine: " + config::in_quotes(options.machine.string()) +
          "\n  interval: " + report::number(choice.effort.interval, 6) +
          "\n  cycles: " + std::to_string(choice.effort.passes / 2) + "\n  lines:\n";
  for (const PlannedLine& line : choice.lines)
    text += "    - {name: " + config::in_quotes(line.name) + ", from: " + place(line.from) +
            ", to: " + place(line.to) + "}\n";
  std::ofstream file = new_stream(options.output);
  file << text;
  if (!file.flush())
    throw InputError{options.output.string(), "cannot be written",
                     "check the folder, its permissions and the space left"};
}

/// Machine, and what is known or assumed of it.
MeasuringPlan begin(const CalibratePlanOptions& options) {
  MeasuringPlan plan;
  plan.machine_file = options.machine;
  plan.pilot = options.pilot;
  plan.machine = machine::load_machine(options.machine);
  plan.accuracy = options.accuracy;
  plan.setup_minutes = options.setup_minutes;
  plan.reading_seconds = options.reading_seconds;
  plan.noise = options.noise;
  plan.motions = options.motions;
  plan.angles = options.angles;
  plan.prior = metrology::assumed_prior(plan.machine, options.motions, options.angles);
  if (options.pilot.empty()) return plan;
  const auto pilot = metrology::identify(plan.machine, read_lines(options.pilot, plan.machine).lines);
  plan.prior = pilot.prior;
  plan.noise = pilot.noise;
  plan.misfit = pilot.misfit;
  std::cout << "pilot " << options.pilot.filename().string() << ": noise " << um(plan.noise)
            << ", error motions " << um(plan.prior.amplitude[0]) << ", " << um(plan.prior.amplitude[1])
            << ", " << report::number(1e6 * plan.prior.amplitude[2], 3) << " urad\n";
  return plan;
}

/// Line sets, intervals and passes, each with what to expect of it.
void weigh(MeasuringPlan& plan, bool search) {
  const auto& machine = plan.machine;
  double longest = 0.0;
  for (int k = 0; k < 3; ++k)
    if (machine.chain.has(k))
      longest = std::max(longest, machine.travel[static_cast<std::size_t>(k)].width());
  struct Set {
    bool searched;
    std::vector<PlannedLine> lines;
  };
  std::vector<Set> sets;
  for (int level = 0; level < 3; ++level) sets.push_back({false, metrology::recipe_lines(machine, level)});
  for (int level = 0; level < 3 && search; ++level) {
    const bool watched = isatty(STDERR_FILENO) != 0;
    const auto progress = [&](double part) {
      if (!watched) return;
      steer(std::cerr, clear_line);
      std::cerr << static_cast<int>(100.0 * (level + part) / 3.0) << " % searching lines" << std::flush;
    };
    sets.push_back(
        {true, metrology::search_lines(machine, metrology::recipe_lines(machine, level),
                                       {longest / 20.0, 6, plan.noise}, plan.prior, plan.misfit, progress)});
    if (watched) steer(std::cerr, clear_line);
  }
  for (const Set& set : sets) {
    for (const double pieces : {10.0, 20.0, 40.0}) {
      for (const int passes : {2, 6}) {
        PlanChoice choice;
        choice.searched = set.searched;
        choice.lines = set.lines;
        choice.effort = {longest / pieces, passes, plan.noise};
        choice.expectation = metrology::expect(machine, choice.lines, choice.effort, plan.prior, plan.misfit);
        choice.minutes = static_cast<double>(choice.lines.size()) * plan.setup_minutes +
                         choice.expectation.readings * plan.reading_seconds / 60.0;
        plan.choices.push_back(std::move(choice));
      }
    }
  }
  for (const PlanChoice& choice : plan.choices)
    if (choice.expected_rms() <= plan.accuracy &&
        (plan.best == nullptr || choice.minutes < plan.best->minutes))
      plan.best = &choice;
}

void print_choices(const MeasuringPlan& plan) {
  std::printf("%6s %-8s %10s %7s %9s %8s %12s\n", "lines", "", "interval", "passes", "readings", "minutes",
              "expected RMS");
  for (const PlanChoice& choice : plan.choices)
    std::printf("%6zu %-8s %7.1f mm %7d %9d %8.0f %9.2f um\n", choice.lines.size(),
                choice.searched ? "searched" : "recipe", 1e3 * choice.effort.interval, choice.effort.passes,
                choice.expectation.readings, choice.minutes, 1e6 * choice.expected_rms());
  std::fflush(stdout);
}

void print_best(const PlanChoice& best) {
  std::cout << "\nmeasure " << best.lines.size() << " lines every "
            << report::number(1e3 * best.effort.interval, 3) << " mm in " << best.effort.passes
            << " passes (forward and backward in turn): expect " << um(best.expected_rms())
            << " over the volume (RMS of the vector)\n";
  for (const PlannedLine& line : best.lines)
    std::printf("  %-16s (%g, %g, %g) to (%g, %g, %g) mm, %d points\n", line.name.c_str(),
                1e3 * line.from.x(), 1e3 * line.from.y(), 1e3 * line.from.z(), 1e3 * line.to.x(),
                1e3 * line.to.y(), 1e3 * line.to.z(), metrology::points_of(line, best.effort.interval));
  std::fflush(stdout);
  for (const auto& open : best.expectation.knowledge.unidentified)
    std::cout << "left open: " << open.words() << '\n';
}

void propose(const CalibratePlanOptions& options) {
  MeasuringPlan plan = begin(options);
  weigh(plan, options.search);
  print_choices(plan);
  if (plan.best == nullptr) {
    const auto finest = std::min_element(
        plan.choices.begin(), plan.choices.end(),
        [](const PlanChoice& a, const PlanChoice& b) { return a.expected_rms() < b.expected_rms(); });
    std::cout << um(options.accuracy) << " is out of reach with these lines: the best is "
              << um(finest->expected_rms()) << "; "
              << (options.search ? "" : "--search looks for better lines; else ")
              << "a quieter laser, more passes or a machine that repeats better would be needed\n";
    throw CLI::RuntimeError(1);
  }
  print_best(*plan.best);
  if (options.output.extension() == ".yaml")
    write_job(*plan.best, plan.machine, options);
  else if (!options.output.empty())
    write_table(*plan.best, options.output);
  if (options.report.empty()) return;
  plan_page(plan).write(options.report);
  std::cout << "report: " << options.report.string() << '\n';
}

}  // namespace

void add_calibrate_plan(CLI::App& group) {
  auto* command =
      group.add_subcommand("plan", "Propose the displacement lines to measure for a wanted accuracy");
  command->footer(
      "Example: invar calibrate plan --machine machine.yaml --accuracy 1.5e-6 --search --output plan.csv "
      "--report plan.html\n"
      "machine.yaml: see invar calibrate geometric --help. Exit status: 0; 1 the accuracy is out of reach; 2 "
      "a file is "
      "unusable.");
  auto options = std::make_shared<CalibratePlanOptions>();
  command->add_option("--machine", options->machine, "machine.yaml: chain, travel, tool")->required();
  command->add_option("--accuracy", options->accuracy, "wanted RMS length of the remaining error vector [m]")
      ->required()
      ->check(positive());
  command->add_option("--pilot", options->pilot,
                      "lines already measured: noise and roughness are taken from them");
  command->add_option("--noise", options->noise, "standard deviation of one reading [m], without a pilot")
      ->check(positive())
      ->capture_default_str();
  command
      ->add_option("--motions", options->motions,
                   "positioning and straightness expected, RMS about the best line [m], without a pilot")
      ->check(positive())
      ->capture_default_str();
  command
      ->add_option("--angles", options->angles,
                   "angular error motions expected, RMS about the best line [rad], without a pilot")
      ->check(positive())
      ->capture_default_str();
  command->add_flag("--search", options->search,
                    "also search end points freely over the travels, not only the recipe (some seconds)");
  command->add_option("--setup", options->setup_minutes, "time to set up a line [min]")
      ->capture_default_str();
  command->add_option("--reading", options->reading_seconds, "time a reading takes [s]")
      ->capture_default_str();
  command->add_option("--output", options->output,
                      "the lines to measure: a table, .csv, or a job of the cell, .yaml");
  command->add_option("--report", options->report,
                      "page to take to the machine, .html: lines, set-up, what to expect, what stays open");
  command->callback([options] { propose(*options); });
}

}  // namespace invar::tools

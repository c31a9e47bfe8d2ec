// Fuzzes every reader of outside files: seeds are valid files, changed at random; `--help` says how to run more.
#include <CLI/CLI.hpp>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <iterator>

#include "tests/fuzz/targets.hpp"

int main(int argc, char** argv) {
  using namespace invar::fuzz;  // NOLINT: a program of one page
  CLI::App program{"Fuzzes every reader of outside files"};
  Plan plan;
  plan.seed = static_cast<std::uint64_t>(std::time(nullptr));
  std::string only, input;
  std::uint64_t runs = 0;
  program.add_option("--runs", runs, "of all readers together (without: as many as --seconds allows)");
  program.add_option("--seconds", plan.seconds, "at most, of each reader");
  program.add_option("--seed", plan.seed, "of the changes (the time of day)");
  program.add_option("--only", only, "one reader, by its name");
  program.add_option("--keep", plan.keep, "folder for the inputs that failed");
  program.add_option("--replay", input, "read this input once, in this process; needs --only");
  CLI11_PARSE(program, argc, argv);

  std::vector<Target> targets = text_targets();
  for (auto* more : {recording_targets, image_targets})
    for (auto& target : more()) targets.push_back(std::move(target));
  if (!only.empty()) std::erase_if(targets, [&](const Target& target) { return target.name != only; });
  if (targets.empty()) {
    std::cerr << "there is no reader `" << only << "`\n";
    return 2;
  }
  if (!input.empty()) {
    std::ifstream stream{input, std::ios::binary};
    replay(targets.front(), {std::istreambuf_iterator<char>{stream}, {}});
    return 0;
  }
  plan.runs = runs == 0 ? ~std::uint64_t{0} : std::max<std::uint64_t>(1, runs / targets.size());
  if (runs == 0 && plan.seconds == 0.0) plan.seconds = 1.0;
  std::cout << "seed " << plan.seed << '\n'
            << std::left << std::setw(18) << "reader" << std::right << std::setw(9) << "runs" << std::setw(9)
            << "refused" << std::setw(12) << "slowest [s]" << std::setw(14) << "memory [MiB]" << std::setw(10)
            << "failures" << '\n';
  std::uint64_t all = 0;
  std::vector<std::string> failures;
  for (const Target& target : targets) {
    const Result result = run(target, plan);
    std::cout << std::left << std::setw(18) << result.target << std::right << std::setw(9) << result.runs
              << std::setw(9) << result.refused << std::setw(12) << std::fixed << std::setprecision(3)
              << result.slowest << std::setw(14) << (result.memory >> 20U) << std::setw(10)
              << result.failures.size() << std::endl;
    all += result.runs;
    failures.insert(failures.end(), result.failures.begin(), result.failures.end());
  }
  for (const auto& failure : failures) std::cout << failure << '\n';
  std::cout << all << " runs, " << failures.size() << " failures, seed " << plan.seed << '\n';
  return failures.empty() ? 0 : 1;
}

// How far the diagnosis can be trusted: made machines of all plants, effects large and small, noise of all colours.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>

#include "tests/support/mismatch/marks.hpp"

namespace invar::test::mismatch {
namespace {

struct Row {
  Machine machine;
  double win = 0.0;
  Marks marks;
  std::string verdict, findings;
};

Row run(const std::string& plant, const std::string& effect, double size, unsigned seed,
        const Trouble& trouble, const diagnose::Options& options) {
  Row row;
  row.machine = make(plant, effect, size, seed, trouble);
  row.win = row.machine.missing.empty() ? 0.0 : to_be_won(row.machine);
  const std::clock_t begin = std::clock();  // of all threads: what it costs, however busy the host
  auto data = case_of(row.machine);
  const auto d = diagnose::search(
      data, [](double, const std::string&) {}, options);
  row.marks = mark(row.machine, data, d, row.win);
  row.marks.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  row.verdict = diagnose::name_of(d.verdict);
  for (const auto& finding : d.findings) {
    char text[200];
    std::snprintf(text, sizeof text, "%s%s%s %.2f", row.findings.empty() ? "" : ", ",
                  std::string{finding.term.info->name}.c_str(),
                  finding.term.curve.over.empty() ? "" : ("(" + finding.term.curve.over + ")").c_str(),
                  finding.probability);
    row.findings += text;
    for (const auto& a : finding.alternatives) {
      std::snprintf(text, sizeof text, " [%s %.1f]", std::string{a.term.info->name}.c_str(), a.log_odds);
      row.findings += text;
    }
  }
  return row;
}

struct Sum {
  double verdict = 0.0, located = 0.0, named = 0.0, fit = 0.0, false_claims = 0.0;
  int cases = 0, missing = 0;
  void add(const Row& row) {
    ++cases;
    verdict += row.marks.verdict, false_claims += row.marks.false_claims, fit += row.marks.fit;
    if (row.machine.missing.empty()) return;
    ++missing;
    located += row.marks.located, named += row.marks.named;
  }
  void print(const std::string& name) const {
    std::printf("| %-10s | %4d | %.3f | %.3f | %.3f | %.3f | %.3f |\n", name.c_str(), cases, verdict / cases,
                missing > 0 ? located / missing : 1.0, missing > 0 ? named / missing : 1.0,
                false_claims / cases, fit / cases);
  }
};

}  // namespace
}  // namespace invar::test::mismatch

int main(int argc, char** argv) {
  using namespace invar;
  using namespace invar::test::mismatch;
  CLI::App program{"Diagnosis of made machines: verdict, place, name, false claims, fit"};
  std::vector<std::string> of = plants, only;
  unsigned seed = 1, each = 1;
  double size = 0.0;
  program.add_option("--plants", of, "these plants alone");
  program.add_option("--effects", only, "these effects alone, pairs joined by +");
  program.add_option("--seed", seed, "of the first machine")->capture_default_str();
  program.add_option("--each", each, "machines of each effect")->capture_default_str();
  program.add_option("--size", size, "of the effect against the usual one; 0: drawn from 0.05 to 3");
  unsigned pairs = 0;
  program.add_option("--pairs", pairs, "machines of each plant with two effects");
  CLI11_PARSE(program, argc, argv);
  std::map<std::string, Sum> sums;
  std::vector<double> seconds;
  const auto one = [&](const std::string& plant, const std::string& effect, unsigned number, double least) {
    Draw draw{number};
    Trouble trouble;
    trouble.coloured = draw.once_in(3.0), trouble.faults = draw.once_in(3.0),
    trouble.renamed = draw.once_in(4.0);
    const double drawn = draw.log_between(least, 3.0);
    const auto row = run(plant, effect, size > 0.0 ? size : drawn, number, trouble, {});
    std::printf(
        "%-9s %-34s seed %5u size %.2f%s%s win %9.1f  v %.1f l %.1f n %.1f false %d fit %5.2f %5.1f s  %s: "
        "%s\n",
        plant.c_str(), effect.c_str(), number, row.machine.size, trouble.coloured ? " coloured" : "",
        trouble.faults ? " faults" : "", row.win, row.marks.verdict, row.marks.located, row.marks.named,
        row.marks.false_claims, row.marks.fit, row.marks.seconds, row.verdict.c_str(), row.findings.c_str());
    std::fflush(stdout);
    sums[plant].add(row);
    sums["all"].add(row);
    seconds.push_back(row.marks.seconds);
  };
  for (const auto& plant : of) {
    unsigned number = 1000 * seed;
    const auto list = only.empty() ? effects(plant) : only;
    for (const auto& effect : list)
      for (unsigned i = 0; i < each; ++i) one(plant, effect, ++number, 0.05);
    Draw draw{seed + 77U};
    const auto known = effects(plant);
    for (unsigned i = 0; i < pairs; ++i) {
      std::string a, b;
      do {
        a = known[draw.index(known.size())], b = known[draw.index(known.size())];
      } while (a == b || a == "none" || b == "none" || a == "parameter" || b == "parameter" ||
               a.rfind("unknown", 0) == 0 || b.rfind("unknown", 0) == 0);
      one(plant, a + "+" + b, ++number, 0.7);
    }
  }
  std::printf(
      "\n| plant      | cases | verdict | located | named | false claims a case | fit |\n| --- | --- | --- | "
      "--- | --- | --- | --- |\n");
  for (const auto& [name, sum] : sums) sum.print(name);
  std::nth_element(seconds.begin(), seconds.begin() + static_cast<std::ptrdiff_t>(seconds.size() / 2),
                   seconds.end());
  if (!seconds.empty()) std::printf("median %.2f s of CPU\n", seconds[seconds.size() / 2]);
}

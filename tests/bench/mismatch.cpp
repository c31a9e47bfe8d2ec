// How far the diagnosis can be trusted: made machines of all plants, effects large and small, noise of all colours.
#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <optional>

#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/evidence/claim.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/diagnosis/search/options.hpp"
#include "core/physics/library.hpp"
#include "tests/support/mismatch/claims.hpp"
#include "tests/support/mismatch/crowd.hpp"
#include "tests/support/mismatch/marks.hpp"

namespace invar::test::mismatch {
namespace {

struct Row {
  Machine machine;
  double win = 0.0;
  std::vector<double> beside;  // of each effect beside the others
  Marks marks;
  std::string verdict, findings, rejected;
  std::vector<diagnosis::Finding> claims;
  double still_follows = 0.0;
};

physics::Plant plant_of(const Machine& machine) {
  physics::Plant plant{};
  (void)physics::plant_by_name(machine.plant, plant);
  return plant;
}

/// All but the right names and as many others as make `keep`, drawn at random.
std::set<std::string, std::less<>> all_but(std::size_t keep, const Machine& machine, unsigned seed) {
  std::vector<std::string> others;
  for (const auto* info : physics::terms_of(plant_of(machine)))
    if (credit(machine, std::string{info->name}) < 1.0) others.emplace_back(info->name);
  Draw draw{seed};
  for (std::size_t i = others.size(); i > 1; --i) std::swap(others[i - 1], others[draw.index(i)]);
  const std::size_t right = machine.missing.size();
  others.erase(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                    others.size(), keep > right ? keep - right : 0)));
  return {others.begin(), others.end()};
}

Row run(const std::string& plant, const std::string& effect, double size, unsigned seed,
        const Trouble& trouble, bool leave_out, std::optional<std::size_t> keep, bool crowded) {
  diagnosis::Options options;
  Row row;
  row.machine =
      crowded ? make_crowded(plant, effect, size, seed, trouble) : make(plant, effect, size, seed, trouble);
  if (keep) options.without = all_but(*keep, row.machine, seed);
  if (leave_out)
    for (auto& missing : row.machine.missing) {
      for (const auto& [name, credit] : missing.names)
        if (credit == 1.0) options.without.insert(name);
      missing.names["unmodelled"] = 1.0;
      row.machine.verdicts = {{"unknown_physics", 1.0}, {"ambiguous", 1.0}, {"partly_explained", 1.0}};
    }
  row.win = row.machine.missing.empty() ? 0.0 : to_be_won(row.machine);
  if (row.machine.missing.size() > 1) row.beside = to_be_won_beside(row.machine, seed, trouble);
  const std::clock_t begin = std::clock();  // of all threads: what it costs, however busy the host
  auto data = case_of(row.machine);
  const auto d = diagnosis::diagnose(
      data, [](double, const std::string&) {}, options);
  row.marks = mark(row.machine, data, d, row.win, row.beside);
  row.marks.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  row.verdict = diagnosis::name_of(d.verdict);
  row.still_follows = d.still_follows;
  for (const auto& r : d.rejected)
    row.rejected += "    " + r.term + " " + std::to_string(r.gain) + ": " + r.why + "\n";
  for (const auto& finding : d.findings) {
    row.claims.push_back(finding);
    char text[200];
    std::snprintf(text, sizeof text, "%s%s%s %.2f", row.findings.empty() ? "" : ", ",
                  std::string{finding.term.info->name}.c_str(),
                  finding.term.curve.over.empty() ? "" : ("(" + finding.term.curve.over + ")").c_str(),
                  finding.probability);
    row.findings += text;
    std::snprintf(text, sizeof text,
                  "    %s: gain %.1f share %.2g left %.2g shape %.2g, odds %.2g, of relatives %.2g\n",
                  diagnosis::label(finding.term).c_str(), finding.gain, finding.share, row.still_follows,
                  finding.other_shape, finding.other_cause, finding.relatives);
    row.rejected += text;
    for (std::size_t i = 0; i < finding.term.info->parameter_count(); ++i)
      row.rejected += "    " + std::string{finding.term.info->name} + "." +
                      std::string{finding.term.info->parameters[i].name} + " = " +
                      std::to_string(finding.term.values[i]) + "\n";
    for (const auto& a : finding.alternatives) {
      std::snprintf(text, sizeof text, " [%s %.1f]", std::string{a.term.info->name}.c_str(), a.log_odds);
      row.findings += text;
    }
  }
  return row;
}

/// Clopper and Pearson's upper 95 % bound of a rate of which `hits` of `n` were seen: the p at which so few would come in
/// one of twenty.
double upper_bound(int hits, int n) {
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double p = 0.5 * (low + high);
    double sum = 0.0, term = std::pow(1.0 - p, n);
    for (int k = 0; k <= hits; ++k) {
      sum += term;
      term *= p / (1.0 - p) * (n - k) / (k + 1.0);
    }
    (sum > 0.05 ? low : high) = p;
  }
  return high;
}

/// As `invar diagnose` reads it.
void write(const Machine& machine, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  std::ofstream{folder / "model.yaml"} << machine.yaml;
  for (std::size_t r = 0; r < machine.recordings.size(); ++r)
    machine.recordings[r].write(folder / ("recording-" + std::to_string(r + 1) + ".csv"));
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
  program.add_option("--size", size, "of the effect against the usual one; 0: drawn from 0.01 to 2");
  unsigned pairs = 0;
  bool why = false;
  program.add_flag("--why", why, "also what was turned down");
  bool leave_out = false;
  program.add_flag("--leave-out", leave_out,
                   "the right names are taken out of the library: any other is false");
  unsigned machine = 0;
  program.add_option("--machine", machine, "the one of this seed alone");
  program.add_option("--pairs", pairs, "machines of each plant with two effects");
  bool crowded = false;
  program.add_flag("--crowd", crowded, "three to six small effects that no list tells beside each");
  std::optional<std::size_t> keep;
  program.add_option("--keep", keep,
                     "names that stay in the library: the right ones and others drawn at random");
  std::size_t rows = 0;
  program.add_option("--rows", rows, "of a recording (axis, thermal); 0: some thousands");
  std::filesystem::path folder;
  program.add_option("--write", folder,
                     "no diagnosis: model.yaml and recording-1.csv of each machine into this folder");
  std::string claims_file;
  program.add_option("--claims", claims_file, "add one line a claim to this file");
  CLI11_PARSE(program, argc, argv);
  std::map<std::string, Sum> sums;
  std::map<std::string, std::pair<int, int>> nulls;  // by plant: how many, with a claim
  Claims claims;
  if (!claims_file.empty()) claims.write_to(claims_file);
  std::vector<double> seconds;
  constexpr std::array colours{"", " memory", " wander", " resonance", " heavy"};
  const auto one = [&](const std::string& plant, const std::string& effect, unsigned number, double least) {
    if (machine > 0 && number != machine) return;
    Draw draw{number};
    Trouble trouble;
    trouble.colour = draw.once_in(2.0) ? static_cast<Colour>(1 + draw.index(4)) : Colour::white;
    trouble.faults = draw.once_in(3.0), trouble.renamed = draw.once_in(4.0),
    trouble.quantised = draw.once_in(5.0);
    const double drawn = draw.log_between(least, 2.0);
    trouble.rows = rows;
    if (!folder.empty()) {
      const double wanted = size > 0.0 ? size : drawn;
      write(crowded ? make_crowded(plant, effect, wanted, number, trouble)
                    : make(plant, effect, wanted, number, trouble),
            folder / (plant + "-" + effect + "-" + std::to_string(number)));
      return;
    }
    const auto row = run(plant, effect, size > 0.0 ? size : drawn, number, trouble, leave_out, keep, crowded);
    std::string beside;
    for (const double won : row.beside)
      beside += (beside.empty() ? " (" : ", ") + std::to_string(std::lround(std::min(won, 1e9)));
    if (!beside.empty()) beside += ")";
    std::printf(
        "%-9s %-34s seed %5u size %.2f%s%s win %9.1f%s  v %.1f l %.1f n %.1f false %d fit %5.2f %6.2f s  %s: "
        "%s\n",
        plant.c_str(), effect.c_str(), number, row.machine.size,
        colours[static_cast<std::size_t>(trouble.colour)],
        trouble.faults ? " faults" : (trouble.quantised ? " steps" : ""), row.win, beside.c_str(),
        row.marks.verdict, row.marks.located, row.marks.named, row.marks.false_claims, row.marks.fit,
        row.marks.seconds, row.verdict.c_str(), row.findings.c_str());
    if (why) std::printf("%s%s", row.rejected.c_str(), row.machine.yaml.c_str());
    std::fflush(stdout);
    sums[plant].add(row);
    sums["all"].add(row);
    if (row.machine.missing.empty())
      ++nulls[plant].first, nulls[plant].second += row.marks.false_claims > 0 ? 1 : 0;
    for (const auto& finding : row.claims) {
      // A twin that nothing tells from the right name is marked as right; but it is as probable as it is said to be.
      const std::string name{finding.term.info->name};
      const auto &unlisted = row.machine.unlisted, &crowd = row.machine.crowd;
      const bool is_of_crowd = std::find(crowd.begin(), crowd.end(), name) != crowd.end();
      if (!is_of_crowd && std::find(unlisted.begin(), unlisted.end(), name) != unlisted.end())
        continue;  // a relative of one of the crowd is neither right nor wrong
      const double right = ('+' + effect + '+').find('+' + name + '+') != std::string::npos ? 1.0 : 0.5;
      claims.add(finding, row.still_follows, is_of_crowd ? 1.0 : std::min(right, credit(row.machine, name)),
                 plant + "-" + effect + "-" + std::to_string(number) + (leave_out ? "-left-out" : ""),
                 row.claims.size() > 1);
    }
    seconds.push_back(row.marks.seconds);
  };
  for (const auto& plant : of) {
    unsigned number = 1000 * seed;
    const auto list = only.empty() ? effects(plant) : only;
    for (const auto& effect : list)
      for (unsigned i = 0; i < each; ++i) one(plant, effect, ++number, 0.01);
    Draw draw{seed + 77U};
    const auto known = effects(plant);
    for (unsigned i = 0; i < pairs; ++i) {
      std::string a, b;
      do {
        a = known[draw.index(known.size())], b = known[draw.index(known.size())];
      } while (a == b || a == "none" || b == "none" || a == "parameter" || b == "parameter" ||
               a.rfind("unknown", 0) == 0 || b.rfind("unknown", 0) == 0);
      one(plant, a + "+" + b, ++number, 0.2);
    }
  }
  std::printf(
      "\n| plant      | cases | verdict | located | named | false claims a case | fit |\n| --- | --- | --- | "
      "--- | --- | --- | --- |\n");
  for (const auto& [name, sum] : sums) sum.print(name);
  for (const auto& [plant, count] : nulls)
    std::printf("%s: %d nulls, %d with a claim; the rate is below %.3f (95 %%)\n", plant.c_str(), count.first,
                count.second, upper_bound(count.second, count.first));
  claims.print();
  if (seconds.empty()) return 0;
  std::nth_element(seconds.begin(), seconds.begin() + static_cast<std::ptrdiff_t>(seconds.size() / 2),
                   seconds.end());
  if (!seconds.empty()) std::printf("median %.2f s of CPU\n", seconds[seconds.size() / 2]);
}

// A folder of recordings whose missing physics is known: what is claimed, with the library whole and with each true name
// taken out of it in turn, and whether the stated probabilities mean what they say.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/search/options.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/model/model_file.hpp"
#include "tests/support/mismatch/claims.hpp"

namespace {

using namespace invar;
using nlohmann::json;
using Names = std::map<std::string, double>;

std::vector<Names> terms_of(const json& answer) {
  std::vector<Names> terms;
  for (const auto& term : answer.at("terms")) {
    Names names;
    for (const auto& [name, about] : term.at("names").items()) names[name] = about.at("credit");
    terms.push_back(std::move(names));
  }
  return terms;
}

/// All names that mean this term as truly as its own.
std::set<std::string, std::less<>> right_names(const Names& names) {
  std::set<std::string, std::less<>> all;
  for (const auto& [name, credit] : names)
    if (credit == 1.0 && name != "unmodelled") all.insert(name);
  return all;
}

struct Study {
  test::mismatch::Claims claims;
  std::vector<double> seconds;

  void run(const std::filesystem::path& folder, const std::vector<Names>& truth,
           const std::set<std::string, std::less<>>& without) {
    const auto yaml = config::Yaml::load(folder / "model.yaml");
    const auto model = model::read(yaml);
    yaml.finish();
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator{folder})
      if (entry.path().filename().string().starts_with("recording")) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    const std::clock_t begin = std::clock();
    auto data = diagnosis::load_case(model, files);
    diagnosis::Options options;
    options.without = without;
    const auto d = diagnosis::diagnose(
        data, [](double, const std::string&) {}, options);
    seconds.push_back(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    std::string missing, found;
    for (const auto& name : without) missing += " -" + name;
    for (const auto& finding : d.findings) {
      const std::string name{finding.term.info->name};
      double credit = 0.0;
      for (const auto& names : truth)
        if (const auto at = names.find(name); at != names.end()) credit = std::max(credit, at->second);
      claims.add(finding, d.still_follows, credit,
                 folder.filename().string() + (without.empty() ? "" : "-" + *without.begin()),
                 d.findings.size() > 1);
      char text[120];
      std::snprintf(text, sizeof text, "  %s %.3f%s", name.c_str(), finding.probability,
                    name == "unmodelled" ? ""
                    : credit == 0.0      ? " WRONG"
                    : credit < 0.9       ? " (relative)"
                                         : "");
      found += text;
    }
    std::printf("%-12s%s: %s%s  [%.1f s]\n", folder.filename().c_str(), missing.c_str(),
                diagnosis::name_of(d.verdict).c_str(), found.c_str(), seconds.back());
    std::fflush(stdout);
  }
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App program{
      "Recordings whose missing physics is known: claims with the right names in the library and out of it"};
  std::filesystem::path cases, answers;
  std::vector<std::string> only;
  std::string claims;
  bool leave_out = false;
  program.add_option("--cases", cases, "folder with one folder a case")
      ->required()
      ->check(CLI::ExistingDirectory);
  program.add_option("--answers", answers, "answers.json")->required()->check(CLI::ExistingFile);
  program.add_option("--only", only, "these cases alone");
  program.add_flag("--leave-out", leave_out, "each true name is taken out of the library in turn");
  program.add_option("--claims", claims, "add one line a claim to this file");
  CLI11_PARSE(program, argc, argv);
  Study study;
  if (!claims.empty()) study.claims.write_to(claims);
  const auto all = json::parse(std::ifstream{answers}).at("cases");
  for (const auto& [name, answer] : all.items()) {
    if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
    const auto truth = terms_of(answer);
    if (!leave_out) study.run(cases / name, truth, {});
    for (const auto& names : truth)
      if (const auto right = right_names(names); leave_out && !right.empty())
        study.run(cases / name, truth, right);
  }
  study.claims.print();
}

#include "tests/support/mismatch/marks.hpp"

#include <cmath>
#include <limits>
#include <sstream>

#include "core/diagnosis/candidates/place.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/load.hpp"
#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/model/model_file.hpp"
#include "core/model/record_file.hpp"
#include "core/physics/simulation.hpp"

namespace invar::test::mismatch {

physics::Model model_of(const Machine& machine) {
  const auto yaml = config::Yaml::parse(machine.yaml, machine.plant + "/" + machine.effect);
  auto model = model::read(yaml);
  yaml.finish();
  return model;
}

diagnosis::Case case_of(const Machine& machine) {
  return diagnosis::make_case(model_of(machine), machine.recordings);
}

namespace {

double to_be_won(const Machine& machine, diagnosis::Case quiet) {
  auto weighing = diagnosis::weigh(quiet, diagnosis::simulate(quiet, quiet.model), diagnosis::Colour::white);
  for (std::size_t o = 0; o < quiet.outputs.size(); ++o) {
    const auto& column = quiet.model.signal(quiet.outputs[o])->column;
    weighing.filters[o] = diagnosis::fit_whitening({machine.noise.at(column)}, 16);
  }
  auto best = diagnosis::fit(quiet, weighing, quiet.model, quiet.model, diagnosis::Effort::follow(10));
  best = diagnosis::fit(quiet, weighing, best.model, quiet.model, diagnosis::Effort::follow(10));
  return best.cost;
}

}  // namespace

double to_be_won(const Machine& machine) {
  return to_be_won(machine, diagnosis::make_case(model_of(machine), machine.quiet));
}

std::vector<double> to_be_won_beside(const Machine& machine, unsigned seed, const Trouble& trouble) {
  std::vector<double> won;
  std::istringstream parts{machine.effect};
  for (std::string part; std::getline(parts, part, '+');) {
    if (part == "parameter" || part == "none") continue;
    auto as_is = trouble;
    as_is.muted = part;
    const auto without = make(machine.plant, machine.effect, machine.size, seed, as_is);
    auto quiet = diagnosis::make_case(model_of(machine), machine.quiet);
    // What the user's model gives, and on top of it what the effect changes.
    const auto other = diagnosis::make_case(model_of(machine), without.quiet);
    const auto nominal = diagnosis::simulate(quiet, quiet.model);
    bool same = without.yaml == machine.yaml && other.recordings.size() == quiet.recordings.size();
    for (std::size_t r = 0; same && r < nominal.size(); ++r)
      for (std::size_t o = 0; o < nominal[r].size(); ++o) {
        auto& measured = quiet.recordings[r].measured[o];
        const auto& before = other.recordings[r].measured[o];
        same = same && before.size() == measured.size();
        for (std::size_t i = 0; same && i < measured.size(); ++i) measured[i] += nominal[r][o][i] - before[i];
      }
    won.push_back(same ? to_be_won(machine, std::move(quiet)) : std::numeric_limits<double>::infinity());
  }
  return won;
}

double credit(const Machine& machine, const std::string& term) {
  double most = 0.0;
  for (const auto& missing : machine.missing)
    if (const auto at = missing.names.find(term); at != missing.names.end())
      most = std::max(most, at->second);
  return most;
}

namespace {

/// Outputs of a model on the run that no fit saw, read as the believed model reads its inputs.
physics::Outputs on_test(const Machine& machine, const physics::Model& believed,
                         const physics::Model& model) {
  physics::Outputs outputs;
  physics::prepare(believed, model::to_record(machine.test_inputs, believed, false).record)
      ->run(model, outputs);
  return outputs;
}

}  // namespace

double fit_on_test(const Machine& machine, const physics::Model& believed, const physics::Model& patched) {
  return fit_on_test(machine, believed, on_test(machine, believed, patched));
}

double fit_on_test(const Machine& machine, const physics::Model& believed, const physics::Outputs& after) {
  const auto before = on_test(machine, believed, believed);
  double sum = 0.0, n = 0.0;
  const auto names = believed.outputs();
  for (std::size_t o = 0; o < names.size(); ++o) {
    const auto& signal = *believed.signal(names[o]);
    const auto truth = machine.test_outputs.in(signal.column, signal.unit);
    double noise = noise_power(machine.noise.at(signal.column)), was = 0.0, is = 0.0;
    if (const auto at = machine.left_by_crowd.find(signal.column); at != machine.left_by_crowd.end())
      noise += at->second;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      was += std::pow(truth[i] - before[o][i], 2) / static_cast<double>(truth.size());
      is += std::pow(truth[i] - after[o][i], 2) / static_cast<double>(truth.size());
    }
    const double floor = std::sqrt(noise), nominal = std::sqrt(was + noise), patch = std::sqrt(is + noise);
    if (nominal < 1.05 * floor) {  // nothing to gain: but do not spoil it
      if (patch > 1.05 * std::max(nominal, floor)) sum += -std::log2(patch / nominal), n += 1.0;
      continue;
    }
    const double gain = nominal < 1.25 * floor ? std::log(nominal / patch) / std::log(nominal / floor)
                                               : (nominal - patch) / (nominal - floor);
    sum += std::clamp(gain, -1.0, 1.0), n += 1.0;
  }
  return n > 0.0 ? sum / n : 1.0;
}

namespace {

/// Does a model foretell the run that no fit saw to the noise of the instruments? It is whole then, whatever its names.
bool foretells_to_noise(const Machine& machine, const physics::Model& believed,
                        const physics::Model& patched) {
  const auto after = on_test(machine, believed, patched);
  const auto names = believed.outputs();
  for (std::size_t o = 0; o < names.size(); ++o) {
    const auto& signal = *believed.signal(names[o]);
    const auto truth = machine.test_outputs.in(signal.column, signal.unit);
    double off = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) off += std::pow(truth[i] - after[o][i], 2);
    if (!(off / static_cast<double>(truth.size()) <= noise_power(machine.noise.at(signal.column))))
      return false;
  }
  return true;
}

}  // namespace

Marks mark(const Machine& machine, const diagnosis::Case& data, const diagnosis::Diagnosis& d, double win,
           const std::vector<double>& beside) {
  Marks marks;
  const auto verdict = diagnosis::name_of(d.verdict);
  if (const auto at = machine.verdicts.find(verdict); at != machine.verdicts.end())
    marks.verdict = at->second;
  if (!machine.crowd.empty() && verdict == "explained" &&
      foretells_to_noise(machine, data.model, d.best.model))
    marks.verdict = 1.0;
  const bool modest = verdict == "no_mismatch" || verdict == "parameters_only";
  if (machine.missing.empty() && modest && win < plain) marks.verdict = 1.0;
  if (!machine.missing.empty() && win < plain && modest) marks.verdict = 1.0;
  for (std::size_t m = 0; m < machine.missing.size(); ++m) {
    const auto& missing = machine.missing[m];
    double named = 0.0, located = 0.0;
    for (const auto& finding : d.findings) {
      const auto site = diagnosis::site_of(data, finding.term);
      if (const auto at = missing.names.find(std::string{finding.term.info->name}); at != missing.names.end())
        named = std::max(named, at->second);
      if (!missing.sites.empty() &&
          std::find(missing.sites.begin(), missing.sites.end(), site) == missing.sites.end())
        continue;
      const auto over = diagnosis::dependence(data, finding.term);
      const bool meets =
          missing.depends_on.empty() || std::any_of(over.begin(), over.end(), [&](const auto& name) {
            return std::find(missing.depends_on.begin(), missing.depends_on.end(), name) !=
                   missing.depends_on.end();
          });
      located = std::max(located, meets ? 1.0 : 0.5);
    }
    if ((win < plain && modest) || (m < beside.size() && beside[m] < plain)) named = located = 1.0;
    marks.named += named / static_cast<double>(machine.missing.size());
    marks.located += located / static_cast<double>(machine.missing.size());
  }
  for (const auto& finding : d.findings) {
    const std::string name{finding.term.info->name};
    if (std::find(machine.unlisted.begin(), machine.unlisted.end(), name) != machine.unlisted.end()) continue;
    if (name == "unmodelled" ? machine.missing.empty() : credit(machine, name) == 0.0) ++marks.false_claims;
  }
  marks.fit = fit_on_test(machine, data.model, d.best.model);
  return marks;
}

}  // namespace invar::test::mismatch

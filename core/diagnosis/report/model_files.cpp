#include "core/diagnosis/report/model_files.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/search/other_run.hpp"
#include "core/model/model_file.hpp"

namespace invar::diagnosis {

namespace {

using physics::Model;

/// As a file of the user's may hold it: his parameters alone, with the encoder's steps that the fit looked through.
Model as_file(Model changed, const Model& model, const Case& data) {
  changed.parameters.resize(model.parameters.size());  // without the states at the beginning of windows
  for (std::size_t i = 0; i < changed.parameters.size(); ++i)
    if (changed.parameters[i].name == "resolution") changed.parameters[i] = model.parameters[i];
  if (model.plant == physics::Plant::error_map)
    if (const auto range = covered(data, "temperature")) changed.baseline.temperature = range;
  return changed;
}

/// The sigmas of what was found, which stands behind the user's own terms, but for the places in `left_out`.
void give_sigmas(Model& patched, std::size_t own_terms, const Diagnosis& d,
                 const std::vector<std::size_t>& left_out) {
  std::size_t next = own_terms;
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    if (std::binary_search(left_out.begin(), left_out.end(), own_terms + i)) continue;
    auto& term = patched.terms[next++];
    const auto& sigmas = d.findings[i].sigmas;
    for (std::size_t k = 0; k < sigmas.size(); ++k)
      if (sigmas[k] > 0.0 && std::isfinite(sigmas[k])) term.sigmas[k] = sigmas[k];  // 0: was not fitted
  }
}

/// A comment line for each recording on which a model is worse.
std::string warnings(const Diagnosis& d) {
  std::string lines;
  for (const auto& run : d.other_runs)
    if (const auto worse = worse_on(d, run); !worse.empty()) lines += "# " + worse + "\n";
  return lines;
}

}  // namespace

ModelFiles model_files(const config::Yaml& given, const Model& model, const std::string& name,
                       const Case& data, const Diagnosis& diagnosis) {
  const auto warned = warnings(diagnosis);
  const auto retuned = as_file(diagnosis.retuned.model, model, data);
  const auto left_out = of_one_recording(diagnosis);
  auto patched = as_file(best_without(data, diagnosis, left_out), model, data);
  give_sigmas(patched, model.terms.size(), diagnosis, left_out);
  std::string made_of =
      "# " + name + " after `invar diagnose`. " + verdict_sentence(data, diagnosis) + "\n" + warned;
  for (const std::size_t term : left_out)
    made_of += "# Without the curve over " + diagnosis.best.model.terms[term].curve.over +
               ", with which it is worse elsewhere.\n";
  return {"# " + name + ", its own parameters refitted, no physics added\n" + warned +
              model::patched(given, retuned),
          made_of + model::patched(given, patched)};
}

}  // namespace invar::diagnosis

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/evidence/odds.hpp"
#include "core/diagnosis/report/region.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/curve_memory.hpp"

namespace invar::diagnosis {

namespace {

using nlohmann::json;

json fit_json(const std::vector<FitRow>& rows) {
  json out = json::object();
  for (const auto& row : rows)
    out[row.signal] = {{"unit", row.unit},
                       {"before", row.before},
                       {"retuned", row.retuned},
                       {"after", row.after},
                       {"noise_floor", row.noise_floor}};
  return out;
}

/// How unlikely (log) white noise makes an RMS so many times its own: Chernoff's bound for chi squared.
double above_noise(const Case& data, double times) {
  if (!(times > thresholds::times_noise)) return 0.0;
  double rows = 0.0;
  for (const auto& recording : data.recordings) rows += static_cast<double>(recording.inputs.rows());
  const double power = times * times;
  return 0.5 * rows * (power - 1.0 - std::log(power));
}

std::string text(double value) {
  std::ostringstream out;
  out.precision(3);
  out << value;
  return out.str();
}

json parameters_json(const Case& data, const Finding& finding) {
  const auto& term = finding.term;
  json parameters = json::object();
  for (std::size_t k = 0; k < term.info->parameter_count(); ++k)
    parameters[std::string{term.info->parameters[k].name}] = {
        {"value", term.values[k]}, {"unit", unit_of(data, term, k)}, {"sigma", finding.sigmas[k]}};
  // The user's equations know a wave by its period, be it in time or in a state; all others have the name of which it is.
  if (const auto k = term.info->index_of("period");
      k < physics::most_parameters && term.info->plant == physics::Plant::equations) {
    const double period = term.values[k], sigma = finding.sigmas[k];
    if (term.with == "t")
      parameters["frequency"] = {
          {"value", 1.0 / period}, {"unit", "Hz"}, {"sigma", sigma / (period * period)}};
    else
      parameters["pitch"] = parameters["period"];
  }
  return parameters;
}

json mismatch_json(const Case& data, const Diagnosis& d) {
  double over = 0.0;
  for (const auto& row : d.train)
    over = std::max(over, row.noise_floor > 0.0 ? row.before / row.noise_floor : 1.0);
  // What moves within the user's own uncertainty is no mismatch, however far the residual of his best guess is above the noise.
  const bool is_believed = d.verdict == Verdict::no_mismatch && !d.is_partial;
  const double left = most_over_noise(d);
  return {{"significant",
           !is_believed && (d.mismatch_gain > thresholds::claim_margin || left > thresholds::times_noise)},
          {"residual_over_noise", over},
          {"p_value", is_believed ? std::erfc(d.parameter_excursion / std::sqrt(2.0))
                                  : std::exp(-std::clamp(std::max(d.mismatch_gain, above_noise(data, left)),
                                                         0.0, 600.0))}};
}

std::vector<std::string> depends_on(const Case& data, const Finding& finding) {
  const auto variables = dependence(data, finding);
  auto depends = variables;
  for (const auto& variable : variables)
    for (const auto& name : recorded_as(data, variable))
      if (std::find(depends.begin(), depends.end(), name) == depends.end()) depends.push_back(name);
  return depends;
}

/// Where a finding acts; where the place alone is open, each of them.
void add_location(json& location, const Case& data, const Diagnosis& d, std::size_t which) {
  const auto& finding = d.findings[which];
  const auto& term = finding.term;
  const auto depends = depends_on(data, finding);
  json where = json::object();
  for (const auto& region : regions_of(data, d, which))
    where[region.variable] = {region.within.lower, region.within.upper};
  location.push_back({{"site", site_of(data, term)},
                      {"depends_on", depends},
                      {"where", where},
                      {"share", finding.share},
                      {"why", "without " + std::string{term.info->name} + " there, " +
                                  text(100.0 * finding.share) + " % of the excess residual comes back"}});
  for (const auto& a : finding.alternatives)
    if (a.explains_as_well() && is_elsewhere(term, a.term) && site_of(data, a.term) != site_of(data, term))
      location.push_back({{"site", site_of(data, a.term)},
                          {"depends_on", depends},
                          {"where", where},
                          {"share", finding.share},
                          {"why", std::string{term.info->name} + " there explains the recording as well"}});
}

json curve_json(const physics::Curve& curve) {
  json one = {{"over", curve.over}, {"knots", curve.knots}, {"values", curve.values}};
  if (curve.period > 0.0) one["period"] = curve.period;
  if (curve.memory != physics::Curve::Memory::none) one["memory"] = physics::name_of(curve.memory);
  return one;
}

void add_place(json& entry, const physics::Term& term) {
  if (!term.on.empty()) entry["on"] = term.on;
  if (!term.with.empty()) entry["with"] = term.with;
}

void add_finding(json& report, const Case& data, const Diagnosis& d, const Finding& finding) {
  const auto& term = finding.term;
  json alternatives = json::array();
  for (const auto& a : finding.alternatives) {
    if (const double p = probability_of(finding, a); p > 1e-4) {
      json other = {{"term", a.term.info->name}, {"site", site_of(data, a.term)}, {"probability", p}};
      add_place(other, a.term);
      alternatives.push_back(std::move(other));
    }
    if (a.explains_as_well())
      report["ambiguity"].push_back(
          {{"between", {name_beside(data, term, a.term), name_beside(data, a.term, term)}},
           {"experiment", separating_experiment(data, term, a.term)}});
  }
  json entry = {{"term", term.info->name},
                {"site", site_of(data, term)},
                {"probability", finding.probability},
                {"share", finding.share},
                {"share_of_rest", finding.share_of_rest},
                {"parameters", parameters_json(data, finding)},
                {"alternatives", alternatives},
                {"description", description_of(d, finding)}};
  if (finding.stand_in != nullptr) entry["stand_in"] = finding.stand_in->name;
  add_place(entry, term);
  if (!term.curve.knots.empty()) entry["curve"] = curve_json(term.curve);
  report["findings"].push_back(entry);
}

/// A mismatch without name and curve is said with its place alone. The mismatch itself is as good as sure, its place is not.
void add_suspect(json& report, const Diagnosis& d) {
  if (!d.suspect) return;
  const bool off_law = d.off_law && d.off_law->is_chief();
  if (d.findings.empty() && d.verdict == Verdict::unknown_physics) {
    report["findings"].push_back(
        {{"term", "unmodelled"},
         {"site", d.suspect->site},
         {"probability", off_law ? thresholds::sure_of_its_place : thresholds::place_alone},
         {"share", d.still_follows},
         {"parameters", json::object()},
         {"alternatives", json::array()},
         {"description",
          "Neither a known term nor a curve over a recorded column describes it; "
          "patched.yaml is the retuned model."}});
  }
  report["location"].push_back(
      {{"site", d.suspect->site},
       {"depends_on", d.suspect->depends_on},
       {"where", json::object()},
       {"share", d.still_follows},
       {"why",
        off_law
            ? "the recorded current is not what the controller makes of the recorded reference and position"
            : "the residual follows the recording, most of all by way of the " + d.suspect->place}});
}

json corrections_json(const Case& data, const Diagnosis& d) {
  json corrections = json::array();
  for (std::size_t k = 0; k < d.best.free.size(); ++k) {
    const auto& f = d.best.free[k];
    const double to = get(d.best.model, f), sigma = d.best.sigma(static_cast<Eigen::Index>(k));
    const auto add = [&](const std::string& name, double from, const std::string& unit) {
      if (std::abs(to - from) > 2.0 * sigma)
        corrections.push_back({{"name", name}, {"from", from}, {"to", to}, {"sigma", sigma}, {"unit", unit}});
    };
    if (f.where == Freedom::Where::parameter) {
      const auto& p = data.model.parameters[f.index];
      if (!is_start(p)) add(p.name, p.value, p.unit);
    } else if (f.where == Freedom::Where::term && f.term < data.model.terms.size()) {
      const auto& term = data.model.terms[f.term];
      add(std::string{term.info->name} + "." + std::string{term.info->parameters[f.index].name},
          term.values[f.index], unit_of(data, term, f.index));
    }
  }
  return corrections;
}

std::string how_split(const Case& data) {
  if (data.windows.count > 0)
    return "each of the last three quarters of a window was kept from a fit in turn, never its beginning; " +
           how_windowed(data);
  return "each third of 18 stretches of each recording was kept from a fit in turn; " +
         (data.windows.anew > 0 ? how_windowed(data)
                                : std::string{"simulated without restart over the whole recording"});
}

/// The errors of the models, on stretches and recordings that no fit saw and on those that fits saw.
void add_fits(json& report, const Case& data, const Diagnosis& d) {
  json other_runs = json::object(), worse = json::array(), left_out = json::object();
  for (const auto& run : d.other_runs) {
    other_runs[run.name] = fit_json(run.fit);
    if (run.is_worse) worse.push_back(run.name);
    if (const auto text = left_out_of(data, d, run); !text.empty()) left_out[run.name] = text;
  }
  report["worse_on"] = worse;
  report["fit"] = {{"heldout", fit_json(d.heldout)},
                   {"train", fit_json(d.train)},
                   {"other_recordings", other_runs},
                   {"left_out_there", left_out},
                   {"split", how_split(data)}};
}

json assumed_json(const Case& data, const Diagnosis& d) {
  json all = json::array();
  for (const auto& [finding, heldout] : d.assumed) {
    json one = {{"term", finding.term.info->name},
                {"site", site_of(data, finding.term)},
                {"parameters", parameters_json(data, finding)},
                {"heldout", fit_json(heldout)}};
    add_place(one, finding.term);
    all.push_back(one);
  }
  return all;
}

json detectable_json(const Diagnosis& d) {
  json all = json::array();
  for (const auto& entry : d.detectable) {
    auto& one = all.emplace_back(json{{"term", entry.term},
                                      {"parameter", entry.parameter},
                                      {"smallest", {{"value", entry.value}, {"unit", entry.unit}}}});
    if (entry.at) one["at"][entry.at->name] = {{"value", entry.at->value}, {"unit", entry.at->unit}};
  }
  return all;
}

json data_json(const Case& data) {
  std::size_t used = 0;
  for (const auto& recording : data.recordings)
    for (std::size_t i = 0; i < recording.inputs.rows(); ++i)
      used += std::isfinite(recording.measured.front()[i]) ? 1U : 0U;
  json all = {{"rows", data.count.rows},
              {"used", used},
              {"dropped",
               {{"nan", data.count.missing},
                {"outlier", data.count.outliers + data.count.lone_inputs},
                {"duplicate", data.count.duplicates}}},
              {"reordered", data.count.out_of_order},
              {"gaps", data.count.gaps},
              {"before_standstill", data.count.before_standstill},
              {"behind_rest", data.count.behind_rest},
              {"not_run_through", data.count.shortened},
              {"left_to_chance", data.count.left_to_chance}};
  if (const auto part = what_was_looked_at(data); !part.empty()) all["looked_at"] = part;
  return all;
}

}  // namespace

std::string report_json(const Case& data, const Diagnosis& d) {
  json report;
  report["invar_report"] = 1;
  report["verdict"] = name_of(d.verdict);
  if (d.is_partial) report["partial"] = true;
  report["not_tried"] = d.not_tried;
  report["mismatch"] = mismatch_json(data, d);
  for (const auto* list : {"location", "findings", "ambiguity"}) report[list] = json::array();
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    add_location(report["location"], data, d, i);
    add_finding(report, data, d, d.findings[i]);
  }
  if (d.is_partial && d.findings.empty() && d.verdict == Verdict::ambiguous)
    report["ambiguity"].push_back(
        {{"between", {"nothing is missing", "physics that was not tried"}},
         {"experiment", "none: let the diagnosis run to its end, with a longer --budget"}});
  add_suspect(report, d);
  if (d.off_law && d.off_law->is_beside())
    report["location"].push_back(
        {{"site", "axis.controller"},
         {"depends_on", {"reference", "position"}},
         {"where", json::object()},
         {"share", d.off_law->share},
         {"why",
          "beside the others, the recorded current is not quite what the controller makes of the recorded "
          "reference and position"}});
  report["parameter_corrections"] = corrections_json(data, d);
  add_fits(report, data, d);
  if (!d.assumed.empty()) report["assumed"] = assumed_json(data, d);
  report["unexplained"] = {{"residual_over_noise", d.unexplained}, {"depends_on", d.unexplained_over}};
  report["detectable"] = detectable_json(d);
  report["rejected"] = json::array();
  for (const auto& r : d.rejected) report["rejected"].push_back({{"term", r.term}, {"why", r.why}});
  report["data"] = data_json(data);
  report["patched_model"] = "patched.yaml";
  return report.dump(2, ' ', false, json::error_handler_t::replace);
}

}  // namespace invar::diagnosis

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
  if (!(times > times_noise)) return 0.0;
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

}  // namespace

std::string report_json(const Case& data, const Diagnosis& d) {
  json report;
  report["invar_report"] = 1;
  report["verdict"] = name_of(d.verdict);
  if (d.is_partial) report["partial"] = true;
  report["not_tried"] = d.not_tried;
  double over = 0.0;
  for (const auto& row : d.train)
    over = std::max(over, row.noise_floor > 0.0 ? row.before / row.noise_floor : 1.0);
  // What moves within the user's own uncertainty is no mismatch, however far the residual of his best guess is above the noise.
  const bool is_believed = d.verdict == Verdict::no_mismatch && !d.is_partial;
  const double left = most_over_noise(d);
  report["mismatch"] = {
      {"significant", !is_believed && (d.mismatch_gain > claim_margin || left > times_noise)},
      {"residual_over_noise", over},
      {"p_value",
       is_believed ? std::erfc(d.parameter_excursion / std::sqrt(2.0))
                   : std::exp(-std::clamp(std::max(d.mismatch_gain, above_noise(data, left)), 0.0, 600.0))}};
  report["location"] = json::array();
  report["findings"] = json::array();
  report["ambiguity"] = json::array();
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    const auto& finding = d.findings[i];
    const auto& term = finding.term;
    const auto variables = dependence(data, finding);
    auto depends = variables;
    for (const auto& variable : variables)
      for (const auto& name : recorded_as(data, variable))
        if (std::find(depends.begin(), depends.end(), name) == depends.end()) depends.push_back(name);
    json where = json::object();
    for (const auto& region : regions_of(data, d, i))
      where[region.variable] = {region.within.lower, region.within.upper};
    report["location"].push_back(
        {{"site", site_of(data, term)},
         {"depends_on", depends},
         {"where", where},
         {"share", finding.share},
         {"why", "without " + std::string{term.info->name} + " there, " + text(100.0 * finding.share) +
                     " % of the excess residual comes back"}});
    // Where the place alone is open, each of them.
    for (const auto& a : finding.alternatives)
      if (a.explains_as_well() && is_elsewhere(term, a.term) && site_of(data, a.term) != site_of(data, term))
        report["location"].push_back(
            {{"site", site_of(data, a.term)},
             {"depends_on", depends},
             {"where", where},
             {"share", finding.share},
             {"why", std::string{term.info->name} + " there explains the recording as well"}});
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
    json alternatives = json::array();
    for (const auto& a : finding.alternatives) {
      const double p = finding.probability * std::exp(0.5 * std::min(0.0, a.log_odds));
      if (p > 1e-4) alternatives.push_back({{"term", a.term.info->name}, {"probability", p}});
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
                  {"parameters", parameters},
                  {"alternatives", alternatives},
                  {"description", description_of(d, finding)}};
    if (finding.stand_in != nullptr) entry["stand_in"] = finding.stand_in->name;
    if (!term.on.empty()) entry["on"] = term.on;
    if (!term.with.empty()) entry["with"] = term.with;
    if (!term.curve.knots.empty())
      entry["curve"] = {
          {"over", term.curve.over}, {"knots", term.curve.knots}, {"values", term.curve.values}};
    if (term.curve.period > 0.0) entry["curve"]["period"] = term.curve.period;
    if (term.curve.memory != physics::Curve::Memory::none)
      entry["curve"]["memory"] = term.curve.memory == physics::Curve::Memory::stop ? "stop" : "relaxation";
    report["findings"].push_back(entry);
  }
  if (d.is_partial && d.findings.empty() && d.verdict == Verdict::ambiguous)
    report["ambiguity"].push_back(
        {{"between", {"nothing is missing", "physics that was not tried"}},
         {"experiment", "none: let the diagnosis run to its end, with a longer --budget"}});
  // What has neither a name nor a curve is said with its place alone. That something is missing at all is as good as sure.
  if (d.suspect && d.findings.empty() && d.verdict == Verdict::unknown_physics) {
    constexpr double of_its_place = 0.9;
    report["findings"].push_back({{"term", "unmodelled"},
                                  {"site", d.suspect->site},
                                  {"probability", of_its_place},
                                  {"share", d.still_follows},
                                  {"parameters", json::object()},
                                  {"alternatives", json::array()},
                                  {"description",
                                   "What no known term describes, nor a curve over what was recorded; "
                                   "patched.yaml is the retuned model."}});
  }
  if (d.suspect)
    report["location"].push_back(
        {{"site", d.suspect->site},
         {"depends_on", d.suspect->depends_on},
         {"where", json::object()},
         {"share", d.still_follows},
         {"why",
          d.off_law && d.off_law->is_chief()
              ? "the recorded current is not what the controller makes of the recorded reference and position"
              : "what is left over follows what was recorded, most of all by way of the " +
                    d.suspect->place}});
  if (d.off_law && d.off_law->is_beside())
    report["location"].push_back(
        {{"site", "axis.controller"},
         {"depends_on", {"reference", "position"}},
         {"where", json::object()},
         {"share", d.off_law->share},
         {"why",
          "beside the others, the recorded current is not quite what the controller makes of the recorded "
          "reference and position"}});
  report["parameter_corrections"] = json::array();
  for (std::size_t k = 0; k < d.best.free.size(); ++k) {
    const auto& f = d.best.free[k];
    const double to = get(d.best.model, f), sigma = d.best.sigma(static_cast<Eigen::Index>(k));
    if (f.where == Freedom::Where::parameter) {
      const auto& p = data.model.parameters[f.index];
      if (is_start(p)) continue;
      if (std::abs(to - p.value) > 2.0 * sigma)
        report["parameter_corrections"].push_back(
            {{"name", p.name}, {"from", p.value}, {"to", to}, {"sigma", sigma}, {"unit", p.unit}});
    } else if (f.where == Freedom::Where::term && f.term < data.model.terms.size()) {
      const auto& term = data.model.terms[f.term];
      const double from = term.values[f.index];
      if (std::abs(to - from) > 2.0 * sigma)
        report["parameter_corrections"].push_back(
            {{"name", std::string{term.info->name} + "." + std::string{term.info->parameters[f.index].name}},
             {"from", from},
             {"to", to},
             {"sigma", sigma},
             {"unit", unit_of(data, term, f.index)}});
    }
  }
  json other_runs = json::object(), worse = json::array(), left_out = json::object();
  for (const auto& run : d.other_runs) {
    other_runs[run.name] = fit_json(run.fit);
    if (run.is_worse) worse.push_back(run.name);
    if (const auto text = left_out_of(data, d, run); !text.empty()) left_out[run.name] = text;
  }
  report["worse_on"] = worse;
  report["fit"] = {
      {"heldout", fit_json(d.heldout)},
      {"train", fit_json(d.train)},
      {"other_recordings", other_runs},
      {"left_out_there", left_out},
      {"split",
       data.windows.count > 0 ? "each of the last three quarters of a window was kept from a fit in turn, "
                                "never its beginning; " +
                                    how_windowed(data)
       : data.windows.anew > 0
           ? "each third of 18 stretches of each recording was kept from a fit in turn; " + how_windowed(data)
           : "each third of 18 stretches of each recording was kept from a fit in turn; simulated without "
             "restart over the whole recording"}};
  report["unexplained"] = {{"residual_over_noise", d.unexplained}, {"depends_on", d.unexplained_over}};
  report["detectable"] = json::array();
  for (const auto& entry : d.detectable) {
    auto& one =
        report["detectable"].emplace_back(json{{"term", entry.term},
                                               {"parameter", entry.parameter},
                                               {"smallest", {{"value", entry.value}, {"unit", entry.unit}}}});
    if (entry.at) one["at"][entry.at->name] = {{"value", entry.at->value}, {"unit", entry.at->unit}};
  }
  report["rejected"] = json::array();
  for (const auto& r : d.rejected) report["rejected"].push_back({{"term", r.term}, {"why", r.why}});
  std::size_t used = 0;
  for (const auto& recording : data.recordings)
    for (std::size_t i = 0; i < recording.inputs.rows(); ++i)
      used += std::isfinite(recording.measured.front()[i]) ? 1U : 0U;
  report["data"] = {{"rows", data.count.rows},
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
  if (const auto part = what_was_looked_at(data); !part.empty()) report["data"]["looked_at"] = part;
  report["patched_model"] = "patched.yaml";
  return report.dump(2, ' ', false, json::error_handler_t::replace);
}

}  // namespace invar::diagnosis

#include "tools/report/page.hpp"

#include <algorithm>
#include <cmath>

#include "tools/diagnose/candidates.hpp"
#include "tools/diagnose/report.hpp"

namespace invar::diagnose {

namespace {

using report::Plot;
using report::Series;

std::string unit_shown(const std::string& unit) { return unit == "degC" ? "K" : unit; }

/// measured - simulated of one output, one recording behind the other.
std::vector<double> difference(const Case& data, const std::vector<physics::Outputs>& simulated,
                               std::size_t output) {
  std::vector<double> out;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    for (std::size_t i = 0; i < data.recordings[r].inputs.rows(); ++i)
      out.push_back(data.recordings[r].measured[output][i] - simulated[r][output][i]);
    out.push_back(std::nan(""));  // breaks the line between recordings
  }
  return out;
}

std::vector<double> over(const Case& data, const std::string& variable) {
  std::vector<double> out;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    auto values = variable_values(data, r, variable);
    values.resize(data.recordings[r].inputs.rows(), std::nan(""));
    out.insert(out.end(), values.begin(), values.end());
    out.push_back(std::nan(""));
  }
  return out;
}

/// Mean of y in cells of x.
Series averaged(const std::string& label, const std::vector<double>& x, const std::vector<double>& y,
                std::size_t cells) {
  double low = 1e300, high = -1e300;
  for (double v : x)
    if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  std::vector<double> sum(cells, 0.0), count(cells, 0.0);
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i]) || !(high > low)) continue;
    const auto cell = std::min(
        cells - 1, static_cast<std::size_t>((x[i] - low) / (high - low) * static_cast<double>(cells)));
    sum[cell] += y[i];
    count[cell] += 1.0;
  }
  Series series;
  series.label = label;
  for (std::size_t c = 0; c < cells; ++c) {
    if (count[c] < 3.0) continue;
    series.x.push_back(low + (static_cast<double>(c) + 0.5) / static_cast<double>(cells) * (high - low));
    series.y.push_back(sum[c] / count[c]);
  }
  return series;
}

std::string share_text(double before, double after) {
  return before > 0.0 ? report::number(100.0 * (1.0 - after / before), 3) + " % less" : "-";
}

}  // namespace

void write_page(const Case& data, const Diagnosis& d, const std::string& subject,
                const std::filesystem::path& file) {
  report::Page page{"Why model and machine differ", subject};
  const bool fine = d.verdict == Verdict::no_mismatch;
  const bool clear = d.verdict == Verdict::explained || d.verdict == Verdict::parameters_only;
  page.callout(verdict_sentence(data, d), fine ? "good" : (clear ? "plain" : "warn"));

  std::vector<std::vector<std::string>> rows;
  for (const auto& row : d.heldout)
    rows.push_back({row.signal, report::si(row.before, row.unit), report::si(row.retuned, row.unit),
                    report::si(row.after, row.unit), report::si(row.noise_floor, row.unit),
                    share_text(row.retuned, row.after)});
  page.heading("Error on data that was not fitted");
  page.table({"output", "model as it is", "its parameters refitted", "with what was found", "noise",
              "against refitted"},
             rows);
  page.paragraph(
      "RMS of measured - simulated on every third stretch of the recording, which the fit did not see. "
      "`Refitted` is the fair rival: the same model with its own parameters tuned, no physics added.");

  const auto nominal = simulate(data, data.model), retuned = simulate(data, d.retuned.model),
             after = simulate(data, d.best.model);
  const auto time = over(data, "time");
  std::vector<Plot> residuals;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto unit = unit_shown(data.model.signal(data.outputs[o])->unit);
    Plot plot;
    plot.title = data.outputs[o] + ": what the model leaves";
    plot.x_label = "time [s]";
    plot.y_label = "measured - simulated" + (unit.empty() ? "" : " [" + unit + "]");
    const auto style =
        data.is_time_series && time.size() > 1500 ? Series::Style::line : Series::Style::points;
    plot.series.push_back({"refitted", style, time, difference(data, retuned, o), {}, {}, "#d08770"});
    plot.series.push_back({"after", style, time, difference(data, after, o), {}, {}, "#2e6f9e"});
    residuals.push_back(std::move(plot));
  }
  page.heading("The residual");
  page.plots(residuals, "Before and after, in the unit of the signal; what is left should look like noise.");

  if (!d.findings.empty()) page.heading("Where it lives");
  for (const auto& finding : d.findings) {
    std::vector<Plot> plots;
    for (const auto& variable : dependence(data, finding.term)) {
      if (plots.size() >= 2) break;
      const auto x = over(data, variable == "direction" || variable == "speed" ? "velocity" : variable);
      if (std::none_of(x.begin(), x.end(), [](double v) { return std::isfinite(v); })) continue;
      // In a loop the controller's output tells; elsewhere the first output.
      const std::size_t o = data.model.controller && data.outputs.size() > 1 ? 1 : 0;
      Plot plot;
      plot.title = data.outputs[o] + " over " + variable;
      plot.x_label = variable;
      plot.y_label = "mean of measured - simulated";
      plot.series.push_back(averaged("refitted", x, difference(data, retuned, o), 60));
      plot.series.push_back(averaged("after", x, difference(data, after, o), 60));
      // A variable that stood still has nothing to show.
      if (plot.series[0].x.size() < 2) continue;
      plot.series[0].colour = "#d08770", plot.series[1].colour = "#2e6f9e";
      plots.push_back(std::move(plot));
    }
    if (!finding.term.curve.knots.empty()) {
      Plot plot;
      plot.title = "the effect without a name";
      plot.x_label = finding.term.curve.over;
      plot.y_label = "fitted curve";
      plot.series.push_back(
          {"", Series::Style::line, finding.term.curve.knots, finding.term.curve.values, {}, {}, "#2e6f9e"});
      plots.push_back(std::move(plot));
    }
    page.paragraph(std::string{finding.term.info->name} + " at " + site_of(data, finding.term) + ": " +
                   std::string{finding.term.info->description} + " (" +
                   std::string{finding.term.info->source} + "). Without it, " +
                   report::number(100.0 * finding.share, 3) + " % of the excess comes back. Probability " +
                   report::number(finding.probability, 3) + ".");
    if (!plots.empty()) page.plots(plots, "Averaged over cells of the variable on which it depends.");
    std::vector<std::vector<std::string>> numbers;
    for (std::size_t i = 0; i < finding.term.info->parameter_count(); ++i)
      numbers.push_back({std::string{finding.term.info->parameters[i].name},
                         report::si(finding.term.values[i], unit_of(data, finding.term, i), 4),
                         report::si(finding.sigmas[i], unit_of(data, finding.term, i), 2),
                         std::string{finding.term.info->parameters[i].description}});
    if (!numbers.empty()) page.table({"parameter", "value", "1 sigma", "meaning"}, numbers);
  }

  std::vector<std::vector<std::string>> corrections;
  for (std::size_t k = 0; k < d.best.free.size(); ++k) {
    const auto& f = d.best.free[k];
    if (f.where != Freedom::Where::parameter) continue;
    const auto& p = data.model.parameters[f.index];
    const double to = get(d.best.model, f);
    corrections.push_back(
        {p.name, report::number(p.value, 5) + " " + p.unit, report::number(to, 5) + " " + p.unit,
         report::number(d.best.sigma(static_cast<Eigen::Index>(k)), 2),
         f.sigma > 0.0 ? report::number((to - f.center) / f.sigma, 2) + " sigma of what was believed" : "-"});
  }
  page.heading("The model's own parameters");
  page.table({"parameter", "was", "is", "1 sigma", "moved by"}, corrections);

  page.heading("What was considered and why it is not claimed");
  std::vector<std::vector<std::string>> considered;
  for (const auto& finding : d.findings)
    for (const auto& a : finding.alternatives)
      considered.push_back(
          {std::string{a.term.info->name}, "in place of " + std::string{finding.term.info->name} +
                                               ": log evidence " + report::number(a.log_odds, 3)});
  for (const auto& r : d.rejected) considered.push_back({r.term, r.why});
  if (considered.empty())
    page.paragraph("No other term of the library came near: none had a gain worth a fit.");
  else
    page.table({"term", "why not"}, considered);

  if (!d.detectable.empty()) {
    page.heading("The smallest effects that this recording would have shown");
    std::vector<std::vector<std::string>> smallest;
    for (const auto& entry : d.detectable)
      smallest.push_back(
          {entry.term, entry.parameter, report::si(entry.value, entry.unit == "*" ? "" : entry.unit)});
    page.table({"term", "parameter", "smallest"}, smallest);
  }
  page.heading("What remains, and what to do next");
  page.paragraph("After all that, the residual on held-out data is " + report::number(d.unexplained, 3) +
                 " times the noise.");
  for (const auto& finding : d.findings)
    for (const auto& a : finding.alternatives)
      if (a.log_odds > -ambiguous_margin)
        page.callout(
            "Next experiment: " +
                separating_experiment(std::string{finding.term.info->name}, std::string{a.term.info->name}) +
                ".",
            "warn");
  page.paragraph(
      std::to_string(data.count.rows) + " rows read; left out: " + std::to_string(data.count.missing) +
      " missing values, " + std::to_string(data.count.outliers) + " outliers, " +
      std::to_string(data.count.duplicates) + " repeated rows; " + std::to_string(data.count.out_of_order) +
      " rows put in order, " + std::to_string(data.count.gaps) + " gaps bridged" +
      (data.count.shortened == 0
           ? "."
           : "; of a long recording " + std::to_string(data.count.shortened) + " rows not run through."));
  page.write(file);
}

}  // namespace invar::diagnose

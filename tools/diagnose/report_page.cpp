#include "tools/diagnose/report_page.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/evidence/odds.hpp"
#include "core/diagnosis/report/region.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "tools/report/page.hpp"

namespace invar::diagnosis {

namespace {

using report::Plot;
using report::Series;
using Names = std::vector<std::vector<std::string>>;

constexpr const char* grey = "#9aa5b1";
constexpr const char* orange = "#d08770";
constexpr const char* blue = "#2e6f9e";
constexpr const char* green = "#7fb08a";

std::string unit_shown(const std::string& unit) { return unit == "degC" ? "K" : unit; }
std::string in_brackets(const std::string& unit) {
  return unit.empty() || unit == "1" ? "" : " [" + unit + "]";
}

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

/// Did a run leave the machine for good? None of that is drawn.
bool ran_away(const std::vector<double>& measured, const std::vector<double>& left) {
  constexpr double far = 100.0;  // times as far as the machine itself went
  double low = 1e300, high = -1e300, most = 0.0;
  for (const double v : measured)
    if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  for (const double v : left)
    most = std::isinf(v) ? v * v : std::max(most, std::isnan(v) ? 0.0 : std::abs(v));
  return high > low && most > far * (high - low);
}

/// The same of an output over all recordings.
bool ran_away(const Case& data, const std::vector<double>& left, std::size_t output) {
  std::vector<double> measured;
  for (const auto& recording : data.recordings)
    measured.insert(measured.end(), recording.measured[output].begin(), recording.measured[output].end());
  return ran_away(measured, left);
}

/// Of a sensor the place is the true position.
std::string recorded_name(const Case& data, const std::string& variable) {
  return data.model.plant == physics::Plant::sensor && variable == "position" ? "true_position" : variable;
}

/// What an effect repeats over: the pitch of a finding over position, the period of one over time. 0: it does not repeat.
double period_over(const physics::Term& term, const std::string& variable) {
  const auto value = [&](const char* name) {
    const auto i = term.info->index_of(name);
    return i < term.info->parameter_count() ? term.values[i] : 0.0;
  };
  if (variable == "position" || variable == "true_position") return std::abs(value("pitch"));
  const double frequency = value("frequency");
  return variable == "time" && frequency > 0.0 ? 1.0 / frequency : 0.0;
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

double rms(const std::vector<double>& values) {
  double sum = 0.0, n = 0.0;
  for (const double v : values)
    if (std::isfinite(v)) sum += v * v, n += 1.0;
  return n > 0.0 ? std::sqrt(sum / n) : 0.0;
}

/// An output of which the recording holds no more than a start value.
bool is_bare(const FitRow& row) { return row.before == 0.0 && row.after == 0.0; }

/// Mean of y in cells of x.
Series averaged(const std::string& label, const std::vector<double>& x, const std::vector<double>& y,
                std::size_t cells) {
  double low = 1e300, high = -1e300;
  for (double v : x)
    if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  cells = std::clamp<std::size_t>(x.size() / 8, 4, cells);
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

/// The four numbers of one output beside one another.
void add_bars(report::Page& page, const FitRow& row, bool any_found) {
  const auto bar = [&](const char* label, double value, const char* colour) {
    std::string text = error_of(value, row);
    if (text == "runs away") return report::Page::Bar{label, 0.0, text, colour};
    if (row.noise_floor > 0.0 && value != row.noise_floor)
      text += " (" + number(value / row.noise_floor) + " x noise)";
    return report::Page::Bar{label, value, text, colour};
  };
  std::vector<report::Page::Bar> bars{bar("model as it is", row.before, grey),
                                      bar("its parameters refitted", row.retuned, orange)};
  if (any_found) bars.push_back(bar("with what was found", row.after, blue));
  if (row.noise_floor > 0.0) bars.push_back(bar("noise", row.noise_floor, green));
  page.bars(row.signal, bars);
}

/// Other names for what was found, in percent of the name that each would replace.
std::string rivals_of(const Case& data, const Diagnosis& d) {
  std::string text;
  for (const auto& finding : d.findings)
    for (const auto& a : finding.alternatives)
      text += (text.empty() ? "" : "; ") + readable(finding.term.info->name) + " may be " +
              readable(a.term.info->name) + " (" + place_of(data, a.term) +
              "): " + number(100.0 * probability_of(finding, a), 3) + " %";
  return text.empty() ? "no other term of the library comes near" : text;
}

/// What somebody must know who reads no further.
void in_short(report::Page& page, const Case& data, const Diagnosis& d) {
  Names missing;
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    const auto& finding = d.findings[i];
    missing.push_back({title_of(finding), where_of(data, d, i), number(100.0 * finding.share, 3) + " %",
                       number(100.0 * finding.probability, 3) + " %", sizes_of(data, d, finding)});
  }
  if (!missing.empty()) {
    page.table({"missing", "where", "share", "how sure", "size"}, missing);
    page.paragraph(
        "Share: part of the mismatch that comes back when the effect alone is taken out. The rest belongs to "
        "the model's own parameters, refitted, and to what remains. How sure: probability that the name is "
        "right, against its rivals and against a cause that the library lacks.");
  }
  std::string fit;
  for (const auto& row : d.heldout) {
    if (is_bare(row)) continue;
    fit += (fit.empty() ? "" : "; ") + row.signal + " " + error_of(row.before, row) + " as it is, " +
           error_of(row.retuned, row) + " with its own parameters refitted" +
           (d.findings.empty() ? "" : ", " + error_of(row.after, row) + " with what was found") + " (noise " +
           si(row.noise_floor, row.unit) + ")";
  }
  const std::string rest = number(d.unexplained, 3) + " times the noise";
  Names rows;
  if (d.is_partial)
    rows.push_back({"what is missing", missing.empty()
                                           ? "not known: the search ended before all was tried"
                                           : "so far the above: the search ended before all was tried"});
  else if (missing.empty() && d.verdict != Verdict::unknown_physics)
    rows.push_back({"what is missing", "nothing that this recording shows"});
  if (!missing.empty()) rows.push_back({"other names", rivals_of(data, d)});
  rows.push_back({"error (RMS) on data that no fit saw", fit});
  rows.push_back({"what remains", d.unexplained < 1.3 ? rest + ": nothing to speak of" : rest});
  rows.push_back({"next step", next_experiment(data, d)});
  page.table({"in short", ""}, rows);
}

void add_other_run(report::Page& page, const Case& data, const Diagnosis& d, const OtherRun& run) {
  page.heading("Another recording, not used here: " + run.name);
  if (const auto worse = worse_on(d, run); !worse.empty()) page.callout(worse, "bad");
  page.paragraph(run.how_windowed.empty()
                     ? "All three models run freely from the recording's first row to its last."
                     : "All three models are " + run.how_windowed + ".");
  if (const auto left_out = left_out_of(data, d, run); !left_out.empty()) page.paragraph(left_out + ".");
  for (const auto& row : run.fit) add_bars(page, row, !d.findings.empty());
  std::vector<Plot> plots;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    if (std::none_of(run.fit.begin(), run.fit.end(),
                     [&](const FitRow& row) { return row.signal == data.outputs[o]; }))
      continue;
    const auto& unit = data.model.signal(data.outputs[o])->unit;
    Plot both, apart;
    both.title = data.outputs[o];
    both.x_label = apart.x_label = "time [s]";
    both.y_label = data.outputs[o] + in_brackets(unit);
    apart.title = data.outputs[o] + ": measured - simulated";
    apart.y_label = "difference" + in_brackets(unit_shown(unit));
    const auto line = [&](const char* label, const std::vector<double>& y, const char* colour) {
      return Series{label, Series::Style::line, run.inputs.time, y, {}, {}, colour};
    };
    const auto rest = [&](const physics::Outputs& simulated) {
      auto values = run.measured[o];
      for (std::size_t i = 0; i < values.size(); ++i) values[i] -= simulated[o][i];
      return values;
    };
    both.series = {line("measured", run.measured[o], "#1c2733")};
    const auto add = [&](const char* label, const physics::Outputs& simulated, const char* colour) {
      const auto left = rest(simulated);
      if (ran_away(run.measured[o], left)) return;
      both.series.push_back(line(label, simulated[o], colour));
      apart.series.push_back(line(label, left, colour));
    };
    add("refitted", run.retuned, orange);
    add("with what was found", run.after, blue);
    if (apart.series.empty()) continue;
    for (auto* plot : {&both, &apart}) {
      report::in_handy_units(*plot);
      plots.push_back(std::move(*plot));
    }
  }
  page.plots(plots);
}

/// The error of a map over the position, by the side from which the points were approached.
Plot from_both_sides(const Case& data, const std::vector<double>& without, const std::vector<double>& with) {
  const auto position = over(data, "position"), direction = over(data, "direction");
  const auto from = [&](double side) {
    auto x = position;
    for (std::size_t i = 0; i < x.size(); ++i)
      if (!(side * direction[i] > 0.0)) x[i] = std::nan("");
    return x;
  };
  Plot plot;
  plot.title = "residual error, by the side of approach";
  plot.x_label = "position [m]";
  plot.y_label = "mean of measured - simulated [m]";
  plot.series = {averaged("without it, from below", from(1.0), without, 40),
                 averaged("without it, from above", from(-1.0), without, 40),
                 averaged("with it", position, with, 40)};
  plot.series[0].colour = orange, plot.series[1].colour = green, plot.series[2].colour = blue;
  report::in_handy_units(plot);
  return plot;
}

/// A finding's own section: what it is, and what would be missing without it alone.
void add_finding(report::Page& page, const Case& data, const Diagnosis& d, std::size_t which,
                 const std::vector<physics::Outputs>& after) {
  const auto& finding = d.findings[which];
  const auto& info = *finding.term.info;
  const auto& in_file = finding.stand_in != nullptr ? *finding.stand_in : info;
  const auto without = simulate(data, physics::without_term(d.best.model, data.model.terms.size() + which));
  bool leaves = false;
  for (std::size_t o = 0; o < data.outputs.size(); ++o)
    leaves = leaves || ran_away(data, difference(data, without, o), o);
  page.paragraph(title_of(finding) + " (" + where_of(data, d, which) + "; in the model file " +
                 std::string{in_file.name} + " at " + site_of(data, finding.term) +
                 "): " + description_of(d, finding) + " [" + std::string{in_file.source} + "] " +
                 (leaves ? "Without it alone the model runs away from the machine."
                         : "Of the mismatch, " + number(100.0 * finding.share, 3) +
                               " % comes back when it alone is taken out."));
  // The output that it moves most, seen from its noise.
  std::size_t shown = 0;
  double most = -1.0;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const double noise = o < d.heldout.size() ? d.heldout[o].noise_floor : 0.0;
    const double by =
        (rms(difference(data, without, o)) - rms(difference(data, after, o))) / (noise > 0.0 ? noise : 1.0);
    if (by > most) most = by, shown = o;
  }
  const auto unit = unit_shown(data.model.signal(data.outputs[shown])->unit);
  std::vector<Plot> plots;
  const auto add = [&](const std::string& said, const std::string& said_label) {
    const auto variable = recorded_name(data, said);
    auto label = said_label == said ? variable : said_label;
    auto x = over(data, variable);
    if (plots.size() >= 2 || std::none_of(x.begin(), x.end(), [](double v) { return std::isfinite(v); }))
      return;
    if (const double period = period_over(finding.term, variable); period > 0.0) {
      for (double& value : x) value -= period * std::floor(value / period);
      label += " within one period";
    }
    Plot plot;
    plot.title = "residual of " + data.outputs[shown] + ", over " + label;
    if (!plots.empty() && plots.back().title == plot.title)
      return;  // direction and speed are both seen over velocity
    plot.x_label = label + in_brackets(unit_of_variable(data, variable));
    plot.y_label = "mean of measured - simulated" + in_brackets(unit);
    const auto draw = [&](const char* series, const std::vector<physics::Outputs>& simulated,
                          const char* colour) {
      const auto left = difference(data, simulated, shown);
      if (ran_away(data, left, shown)) return;
      plot.series.push_back(averaged(series, x, left, 80));
      plot.series.back().colour = colour;
    };
    draw("without it", without, orange);
    draw("with it", after, blue);
    if (plot.series.empty()) return;
    report::in_handy_units(plot);
    if (plot.series[0].x.size() > 1) plots.push_back(std::move(plot));  // else it stood still
  };
  // What moves a drop along x goes with what it did along x; a turned camera takes the one for the other.
  const bool along_x = data.outputs[shown] == "landed_x", across = info.name == "camera_rotation";
  for (const auto& variable : dependence(data, finding)) {
    if (data.model.plant == physics::Plant::error_map && variable == "direction")
      plots.push_back(
          from_both_sides(data, difference(data, without, shown), difference(data, after, shown)));
    else if (data.model.plant == physics::Plant::droplet && variable == "velocity")
      add(along_x ? "velocity_x" : "velocity_y", along_x ? "velocity_x" : "velocity_y");
    else if (variable == "image")
      add(along_x != across ? "image_x" : "image_y", along_x != across ? "image_x" : "image_y");
    else if (variable == "direction" || variable == "speed")
      add("velocity", "velocity");
    else if (data.model.plant == physics::Plant::thermal && variable == "temperature" &&
             !finding.term.on.empty())
      add(finding.term.on, "temperature of " + finding.term.on);
    else
      add(variable, variable);
  }
  if (plots.empty() && data.is_time_series) add("time", "time");
  if (!finding.term.curve.knots.empty()) {
    Plot plot;
    plot.title = "the effect without a name";
    const auto& curve = finding.term.curve;
    using Memory = physics::Curve::Memory;
    plot.x_label = curve.memory == Memory::relaxation
                       ? "time constant [s]"
                       : (curve.memory == Memory::stop ? "threshold of " : "") + curve.over +
                             in_brackets(unit_of_variable(data, curve.over));
    plot.y_label = "fitted curve" + in_brackets(unit_of_curve(data, finding.term));
    plot.series.push_back(
        {"", Series::Style::line, finding.term.curve.knots, finding.term.curve.values, {}, {}, blue});
    report::in_handy_units(plot);
    plots.push_back(std::move(plot));
  }
  if (!plots.empty()) page.plots(plots, "Averaged over cells of the variable with which it goes.");
  Names numbers;
  for (std::size_t i = 0; i < info.parameter_count(); ++i)
    numbers.push_back({readable(info.parameters[i].name),
                       with_sigma(finding.term.values[i], finding.sigmas[i], unit_of(data, finding.term, i)),
                       std::string{info.parameters[i].description}});
  if (!numbers.empty()) page.table({"parameter", "value +- 1 sigma", "meaning"}, numbers);
}

void add_parameters(report::Page& page, const Case& data, const Diagnosis& d) {
  Names corrections;
  for (std::size_t k = 0; k < d.best.free.size(); ++k) {
    const auto& f = d.best.free[k];
    if (f.where != Freedom::Where::parameter) continue;
    const auto& p = data.model.parameters[f.index];
    if (is_start(p)) continue;
    const double to = get(d.best.model, f), sigma = d.best.sigma(static_cast<Eigen::Index>(k));
    corrections.push_back(
        {p.name, f.sigma > 0.0 ? with_sigma(p.value, f.sigma, p.unit) : si(p.value, p.unit, 4),
         with_sigma(to, sigma, p.unit),
         f.sigma > 0.0 ? number(std::round(1e3 * std::abs(to - f.center) / f.sigma) / 1e3, 2) +
                             " sigma of what was believed"
                       : "nothing was believed beyond a start value"});
  }
  if (corrections.empty()) return;
  page.heading("The model's own parameters");
  page.table(
      {"parameter", "believed", d.findings.empty() ? "fitted" : "fitted beside what was found", "moved by"},
      corrections);
}

void add_considered(report::Page& page, const Case& data, const Diagnosis& d) {
  page.heading("Considered and not claimed");
  if (!d.not_tried.empty()) page.paragraph(why_ended(d) + " before all was tried. " + not_tried(d) + ".");
  Names rivals, tried;
  for (const auto& finding : d.findings)
    for (const auto& a : finding.alternatives)
      rivals.push_back(
          {readable(a.term.info->name) + " (" + place_of(data, a.term) + ")",
           "in place of " + readable(finding.term.info->name) +
               (a.explains_as_well() ? ": explains the recording as well" : ": explains the recording worse"),
           number(100.0 * probability_of(finding, a), 3) + " %"});
  for (const auto& r : d.rejected) tried.push_back({readable(r.term), r.why, number(r.gain)});
  if (rivals.empty() && tried.empty()) {
    page.paragraph(d.is_partial ? "The search ended before anything else was weighed."
                                : "No other term of the library came near: none had a gain worth a fit.");
    return;
  }
  if (!rivals.empty()) page.table({"rival", "why not", "how sure"}, rivals);
  if (tried.empty()) return;
  page.table({"tried by itself", "why not", "log evidence gained"}, tried);
  page.paragraph("A claim needs a gain of " + number(claim_margin_of(d.weighing)) +
                 ", also against slow noise, a possible sign and a gain on held-out data.");
}

/// Terms that the user named, beside what was found.
void add_assumed(report::Page& page, const Case& data, const Diagnosis& d) {
  if (d.assumed.empty()) return;
  page.heading("Terms that you named (--assume)");
  Names rows;
  for (const auto& [finding, heldout] : d.assumed) {
    std::string errors;
    for (const auto& row : heldout)
      if (!is_bare(row))
        errors += (errors.empty() ? "" : "; ") + row.signal + " " + error_of(row.retuned, row) + " to " +
                  error_of(row.after, row);
    rows.push_back({readable(finding.term.info->name), place_of(data, finding.term),
                    sizes_of(data, d, finding), errors});
  }
  page.table({"term", "where", "size", "error held out, retuned to with it"}, rows);
  page.paragraph("Each stands alone on top of your retuned model, whether the recording asks for it or not.");
}

}  // namespace

std::string page_text(const Case& data, const Diagnosis& d, const std::string& subject) {
  report::Page page{"Model and machine compared", subject};
  const bool fine = d.verdict == Verdict::no_mismatch && !d.is_partial;
  const bool clear =
      (d.verdict == Verdict::explained || d.verdict == Verdict::parameters_only) && !d.is_partial;
  page.callout(verdict_sentence(data, d), fine ? "good" : (clear ? "plain" : "warn"));
  for (const auto& run : d.other_runs)
    if (const auto worse = worse_on(d, run); !worse.empty()) page.callout(worse, "bad");
  if (const auto beside = beside_the_verdict(data, d); !beside.empty()) page.callout(beside, "warn");
  in_short(page, data, d);

  page.heading("Error on data that no fit saw");
  for (const auto& row : d.heldout)
    if (!is_bare(row)) add_bars(page, row, !d.findings.empty());
  page.paragraph(
      "RMS of measured - simulated on each third of the recording in turn, which its fit did not see. "
      "`Refitted` is the fair rival: the same model with its own parameters tuned, no physics added. `Noise` "
      "is what the model file says, or what differences between neighbouring rows and rests say.");
  for (const auto& run : d.other_runs) add_other_run(page, data, d, run);

  const auto retuned = simulate(data, d.retuned.model), after = simulate(data, d.best.model);
  const auto time = over(data, "time");
  std::vector<Plot> residuals;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    if (o < d.heldout.size() && is_bare(d.heldout[o])) continue;
    Plot plot;
    plot.title = data.outputs[o] + ": what the model leaves";
    plot.x_label = data.is_time_series ? "time [s]" : "time of the droplet [s]";
    plot.y_label = "measured - simulated" + in_brackets(unit_shown(data.model.signal(data.outputs[o])->unit));
    const auto style =
        data.is_time_series && time.size() > 1500 ? Series::Style::line : Series::Style::points;
    const auto draw = [&](const char* label, const std::vector<physics::Outputs>& simulated,
                          const char* colour) {
      auto left = difference(data, simulated, o);
      if (!ran_away(data, left, o))
        plot.series.push_back({label, style, time, std::move(left), {}, {}, colour});
    };
    draw("refitted", retuned, orange);
    if (!d.findings.empty()) draw("with what was found", after, blue);
    if (plot.series.empty()) continue;
    report::in_handy_units(plot);
    residuals.push_back(std::move(plot));
  }
  page.heading("The residual of this recording");
  page.plots(residuals, "In the unit of the signal; what is left at the end should look like noise.");

  if (!d.findings.empty()) page.heading("Where it lives");
  for (std::size_t i = 0; i < d.findings.size(); ++i) add_finding(page, data, d, i, after);
  add_parameters(page, data, d);
  add_considered(page, data, d);

  if (!d.detectable.empty()) {
    page.heading("The smallest effects that this recording would have shown");
    Names smallest;
    for (const auto& entry : d.detectable)
      smallest.push_back(
          {readable(entry.term), readable(entry.parameter),
           si(entry.value, entry.unit == "*" ? "" : entry.unit),
           entry.at ? readable(entry.at->name) + " " + si(entry.at->value, entry.at->unit) : std::string{}});
    page.table({"effect", "parameter", "smallest", "at"}, smallest);
    page.paragraph(
        "To first order, each by itself: more than noise, a wander of the instrument or a parameter within "
        "what was "
        "believed could pass for. Twice as much is seen.");
  }
  add_assumed(page, data, d);
  page.heading("Remaining mismatch and next steps");
  std::string with;
  for (const auto& one : d.unexplained_over) with += (with.empty() ? ", and goes with " : ", ") + one;
  page.paragraph("After all that, the residual on held-out data is " + number(d.unexplained, 3) +
                 " times the noise" + with + ".");
  page.callout("Next experiment: " + next_experiment(data, d),
               d.verdict == Verdict::ambiguous ? "warn" : "plain");
  const auto looked_at = what_was_looked_at(data);
  page.paragraph(rows_read(data.count) + (looked_at.empty() ? "." : "; " + looked_at + "."));
  return page.text();
}

}  // namespace invar::diagnosis

#include "tools/geometric/geometric_report.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>

#include "tools/geometric/lines_used.hpp"

namespace invar::tools {

namespace {

using metrology::Identification;

/// Of the values that are numbers.
double rms(const Eigen::VectorXd& values) {
  double square = 0.0;
  double count = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    square += value * value;
    count += 1.0;
  }
  return count > 0.0 ? std::sqrt(square / count) : 0.0;
}

double largest(const Eigen::VectorXd& values) {
  double result = 0.0;
  for (const double value : values)
    if (std::isfinite(value)) result = std::max(result, std::abs(value));
  return result;
}

/// Measured deviation less what is `told` of it, zero at its mean over the line's good points: where the laser was zeroed is
/// no property of the machine. NaN where no reading is left or the point does not fit.
Eigen::VectorXd rest_of(const Identification& found, std::size_t l, const Eigen::VectorXd& told) {
  Eigen::VectorXd rest = found.lines[l].deviation - found.rows[l].remainder - told;
  double mean = 0.0;
  double count = 0.0;
  for (Eigen::Index j = 0; j < rest.size(); ++j) {
    if (found.point_weights[l][j] <= 0.5) rest[j] = std::numeric_limits<double>::quiet_NaN();
    if (!std::isfinite(rest[j])) continue;
    mean += rest[j];
    count += 1.0;
  }
  return rest.array() - mean / std::max(count, 1.0);
}

/// With the line among those fitted.
Eigen::VectorXd rest_fitted(const Identification& found, std::size_t l, const Eigen::VectorXd& unknowns) {
  const auto& rows = found.rows[l];
  return rest_of(found, l, rows.rows * unknowns(rows.unknowns));
}

/// Told by all lines but this one, at the same prior.
Eigen::VectorXd rest_unseen(const Identification& found, std::size_t l) {
  return rest_of(found, l,
                 metrology::told_by_others(found.lines[l], found.rows[l], found.misfit,
                                           found.point_weights[l], found.posterior));
}

}  // namespace

std::string micro(double value, int digits) {
  return std::abs(value) < 0.5e-9 ? "0" : report::number(1e6 * value, digits);
}

void evaluate(GeometricResult& result) {
  const Identification& found = result.found;
  double before = 0.0;
  double after = 0.0;
  double unseen = 0.0;
  double points = 0.0;
  for (std::size_t l = 0; l < found.lines.size(); ++l) {
    LineFigures figures;
    const Eigen::VectorXd& raw = found.lines[l].deviation;
    const Eigen::VectorXd fitted = rest_fitted(found, l, found.posterior.mean);
    const bool full = result.method == "full" && found.lines.size() > 1;
    figures.before_rms = rms(raw);
    figures.before_max = largest(raw);
    figures.after_rms = rms(fitted);
    figures.after_max = largest(fitted);
    result.rest.push_back(fitted);
    result.unseen.push_back(full ? rest_unseen(found, l) : Eigen::VectorXd{});
    figures.unseen_rms = rms(result.unseen.back());
    figures.unseen_max = largest(result.unseen.back());
    result.figures.push_back(figures);
    const double count = static_cast<double>((fitted.array() == fitted.array()).count());
    before += count * figures.before_rms * figures.before_rms;
    after += count * figures.after_rms * figures.after_rms;
    unseen += count * figures.unseen_rms * figures.unseen_rms;
    points += count;
    result.unseen_max = std::max(result.unseen_max, figures.unseen_max);
  }
  result.before_rms = std::sqrt(before / points);
  result.after_rms = std::sqrt(after / points);
  result.unseen_rms = std::sqrt(unseen / points);
  result.knowledge = metrology::identifiability(found.basis, found.posterior, found.model.squareness,
                                                found.model.travel, found.model.tool);
  // What repeats but no smooth model explains stays, whatever is measured more.
  const double stays = std::sqrt(static_cast<double>(found.basis.chain.axes)) * found.misfit;
  result.knowledge.volumetric_rms = std::hypot(result.knowledge.volumetric_rms, stays);
  if (found.basis.chain.axes > 1) result.next = metrology::next_lines(result.machine, found, 3);
  for (auto& next : result.next) next.volumetric_rms = std::hypot(next.volumetric_rms, stays);
}

void test_positioning(GeometricResult& result, double device, double environment) {
  double drift = 0.0;
  for (const auto& line : result.input.at_one_point) {
    if (line.readings.size() < 2) continue;
    const auto [low, high] =
        std::minmax_element(line.readings.begin(), line.readings.end(),
                            [](const auto& a, const auto& b) { return a.displacement < b.displacement; });
    result.drifts.push_back({line.name, static_cast<int>(line.readings.size()),
                             high->displacement - low->displacement,
                             line.readings.back().displacement - line.readings.front().displacement});
    drift = std::max(drift, result.drifts.back().range);
  }
  const metrology::Iso230Conditions conditions{
      device, environment >= 0.0 ? environment : drift / (2.0 * std::sqrt(3.0))};
  for (const auto& line : result.input.lines)
    if (auto test = test_of(line, conditions)) result.tests.push_back(std::move(*test));
  result.diagonals = diagonals_of(result.tests, result.machine);
  result.motions = motion_figures(result.found, result.knowledge);
  result.not_judged = unmet(result.tolerances, result.tests, result.motions);
}

std::string wave_words(const Identification& found) {
  std::string words;
  for (const auto& wave : found.basis.waves)
    words += (words.empty() ? "" : ", ") +
             std::string(1, metrology::axis_letters[static_cast<std::size_t>(wave.axis)]) + " every " +
             report::si(wave.period(), "m", 4) + " by " + report::si(std::hypot(wave.cosine, wave.sine), "m");
  return words;
}

const IntervalFigures* interval_to_choose(const GeometricResult& result) {
  constexpr double enough = 1.1;  // times the accuracy at the finest interval
  const IntervalFigures* chosen = nullptr;
  for (const auto& one : result.intervals)
    if (one.expected_rms <= enough * result.intervals.front().expected_rms) chosen = &one;
  return chosen;
}

void study_intervals(GeometricResult& result) {
  const Identification& all = result.found;
  for (const std::size_t step : {1U, 2U, 4U, 8U}) {
    std::vector<metrology::DisplacementLine> kept;
    double interval = 0.0;
    double length = 0.0;
    int points = 0;
    for (std::size_t l = 0; l < all.lines.size(); ++l) {
      const auto& line = all.lines[l];
      const auto source = std::find_if(result.input.lines.begin(), result.input.lines.end(),
                                       [&](const auto& one) { return one.name == line.name; });
      // Points by their order along the beam; every step-th stays.
      std::vector<std::pair<double, std::size_t>> order;
      for (std::size_t j = 0; j < line.points.size(); ++j)
        order.emplace_back(line.beam.direction.dot(line.points[j] - line.beam.start), j);
      std::sort(order.begin(), order.end());
      std::vector<bool> stays(line.points.size(), false);
      for (std::size_t i = 0; i < order.size(); i += step) stays[order[i].second] = true;
      if (line.beam.length > length) {
        length = line.beam.length;
        interval = line.beam.length * static_cast<double>(step) / static_cast<double>(order.size() - 1);
      }
      metrology::DisplacementLine thinned{line.name, {}};
      for (std::size_t i = 0; i < source->readings.size(); ++i)
        if (stays[static_cast<std::size_t>(line.point_of[i])])
          thinned.readings.push_back(source->readings[i]);
      points += static_cast<int>((order.size() + step - 1) / step);
      if (order.size() > 2 * step && !thinned.readings.empty()) kept.push_back(std::move(thinned));
    }
    if (kept.size() < all.lines.size()) break;
    metrology::IdentificationOptions how;
    how.search_prior = false;
    how.prior = all.prior;
    how.strengths = all.strengths;
    how.misfit = all.misfit;
    how.waves = all.basis.waves;
    for (const auto& spline : all.basis.splines)
      how.least_intervals = std::max(how.least_intervals, spline.intervals());
    const auto found = metrology::identify(result.machine, kept, how);
    double square = 0.0;
    double count = 0.0;
    double integral = 0.0;
    for (const auto& line : all.lines) {
      Eigen::VectorXd rest = line.deviation - metrology::predicted_readings(found.model, line);
      std::vector<double> good;
      for (Eigen::Index j = 0; j < rest.size(); ++j)
        if (std::isfinite(rest[j])) good.push_back(rest[j]);
      double mean = 0.0;
      for (const double value : good) mean += value / static_cast<double>(good.size());
      for (const double value : good) square += (value - mean) * (value - mean);
      count += static_cast<double>(good.size());
      if (line.beam.length < length - 1e-9 || integral > 0.0) continue;
      for (const double value : good)
        integral += std::abs(value - mean) * line.beam.length / static_cast<double>(good.size());
    }
    const auto knowledge = metrology::identifiability(found.basis, found.posterior, found.model.squareness,
                                                      found.model.travel, found.model.tool);
    const double expected = std::hypot(knowledge.volumetric_rms,
                                       std::sqrt(static_cast<double>(all.basis.chain.axes)) * all.misfit);
    result.intervals.push_back({interval, points, std::sqrt(square / count), expected, integral});
  }
}

std::vector<Expansion> expansions(const Identification& found) {
  std::vector<Expansion> result;
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (!found.model.reference_temperature || !found.model.chain.has(k)) continue;
    result.push_back({std::string(1, metrology::axis_letters[i]), found.model.expansion[i],
                      found.model.expansion_sigma[i],
                      found.model.expansion_sigma[i] < 0.5 * found.prior.expansion});
  }
  return result;
}

std::string temperature_words(const GeometricResult& result) {
  if (!result.found.model.reference_temperature || !result.input.temperature) return "";
  const Range range = *result.input.temperature;
  std::string known;
  std::string open;
  for (const auto& one : expansions(result.found)) {
    if (one.known)
      known += (known.empty() ? "" : ", ") + one.axis + " " + micro(one.value) + " +- " + micro(one.sigma) +
               " ppm/K";
    else
      open += (open.empty() ? "" : ", ") + one.axis;
  }
  std::string words = "temperature " + report::number(range.lower, 4) + " to " +
                      report::number(range.upper, 4) + " degC: the model holds at " +
                      report::number(*result.found.model.reference_temperature, 4) + " degC";
  if (!known.empty()) words += "; expansion " + known;
  if (!open.empty())
    words += "; the readings do not tell the expansion of " + open + " (assumed 0 +- " +
             micro(result.found.prior.expansion) + " ppm/K)";
  return words;
}

nlohmann::json report_json(const GeometricResult& result) {
  const Identification& found = result.found;
  nlohmann::json json;
  json["kind"] = "geometric";
  json["method"] = result.method;
  json["readings"] = result.input.rows;
  json["noise"] = {{"value", found.noise}, {"unit", "m"}};
  json["misfit"] = {{"value", found.misfit}, {"unit", "m"}};
  for (const auto& wave : found.basis.waves)
    json["waves"].push_back(
        {{"axis", std::string(1, metrology::axis_letters[static_cast<std::size_t>(wave.axis)])},
         {"period", wave.period()},
         {"amplitude", std::hypot(wave.cosine, wave.sine)},
         {"unit", "m"}});
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& curve = found.model.reversal[k];
    if (curve.empty()) continue;
    auto& one = json["reversal"][std::string(1, metrology::axis_letters[k])];
    one = {{"mean", curve.mean()}, {"unit", "m"}};
    for (int i = 0; i <= curve.spline.intervals(); ++i) {
      const double at = curve.spline.interval().lower + i * curve.spline.spacing();
      one["position"].push_back(at);
      one["value"].push_back(curve.value(at));
      one["sigma"].push_back(curve.sigma_at(at));
    }
  }
  json["positioning"] = positioning_json(result.tests, result.tolerances);
  json["diagonals"] = diagonals_json(result.diagonals);
  json["motions"] = motions_json(result.motions, result.tolerances);
  json["not_judged"] = result.not_judged;
  for (const auto& one : result.drifts)
    json["drift_at_one_point"].push_back({{"line", one.line},
                                          {"readings", one.readings},
                                          {"range", one.range},
                                          {"end_minus_start", one.end},
                                          {"unit", "m"}});
  json["lines_rms"] = {{"before", result.before_rms}, {"after", result.after_rms}, {"unit", "m"}};
  if (result.method == "full" && found.lines.size() > 1) json["lines_rms"]["unseen"] = result.unseen_rms;
  json["volumetric_rms_predicted"] = result.knowledge.volumetric_rms;
  if (found.model.reference_temperature) {
    json["temperature"] = {{"reference", *found.model.reference_temperature},
                           {"lowest", result.input.temperature->lower},
                           {"highest", result.input.temperature->upper},
                           {"unit", "degC"}};
    for (const auto& one : expansions(found))
      json["temperature"]["expansion"][one.axis] = {
          {"value", one.value}, {"sigma", one.sigma}, {"known", one.known}, {"unit", "1/K"}};
  }
  json["rows"] = report::json_of(lines_used(result.found, result.input));
  json["unidentified"] = nlohmann::json::array();
  for (const auto& one : result.knowledge.unidentified) {
    // One component alone is its bare name; a combination names all its members.
    std::string what;
    for (const auto& name : one.components) what += (what.empty() ? "" : " with ") + name;
    json["unidentified"].push_back({{"what", what}, {"words", one.words()}, {"left", one.left}});
  }
  for (const auto& component : result.knowledge.components)
    json["components"][component.name] = {{"sigma", component.sigma},
                                          {"prior_variance_left", component.left}};
  for (const auto& next : result.next)
    json["next_lines"].push_back({{"line", next.line.name},
                                  {"from", {next.line.from.x(), next.line.from.y(), next.line.from.z()}},
                                  {"to", {next.line.to.x(), next.line.to.y(), next.line.to.z()}},
                                  {"volumetric_rms_predicted", next.volumetric_rms}});
  for (const auto& one : result.intervals)
    json["intervals"].push_back({{"interval", one.interval},
                                 {"points", one.points},
                                 {"points_rms", one.points_rms},
                                 {"integral", one.integral},
                                 {"volumetric_rms_predicted", one.expected_rms}});
  if (const auto* chosen = interval_to_choose(result)) json["interval_to_choose"] = chosen->interval;
  for (int pair = 0; pair < metrology::squareness_count; ++pair) {
    const auto p = static_cast<std::size_t>(pair);
    if (found.model.squareness_sigma[p] <= 0.0) continue;
    json["squareness"][std::string{metrology::squareness_iso_name(pair)}] = {
        {"value", metrology::squareness_angle_from_cosine(pair, found.model.squareness[p])},
        {"sigma", found.model.squareness_sigma[p]},
        {"unit", "rad"}};
  }
  for (std::size_t l = 0; l < found.lines.size(); ++l) {
    const auto& line = found.lines[l];
    const auto& figures = result.figures[l];
    json["lines"].push_back({{"line", line.name},
                             {"length", line.beam.length},
                             {"readings", line.noise.readings},
                             {"outliers", line.noise.outliers},
                             {"breaks", line.noise.breaks},
                             {"noise", line.noise.noise},
                             {"reversal", line.noise.reversal},
                             {"drift", line.noise.drift},
                             {"before_rms", figures.before_rms},
                             {"after_rms", figures.after_rms},
                             {"unseen_rms", figures.unseen_rms}});
  }
  return json;
}

void print_summary(const GeometricResult& result, std::ostream& out) {
  const Identification& found = result.found;
  out << found.lines.size() << " lines, " << result.input.rows << " readings, noise " << micro(found.noise)
      << " um\nerror on the lines: " << micro(result.before_rms) << " um before, " << micro(result.after_rms)
      << " um after";
  if (result.unseen_rms > 0.0) out << ", " << micro(result.unseen_rms) << " um on lines not fitted";
  out << " (RMS)\nexpected over the volume: " << micro(result.knowledge.volumetric_rms)
      << " um (RMS of the vector)\n";
  const report::LeftOut left_out = lines_used(result.found, result.input);
  out << line_of(left_out) << '\n';
  for (const auto& what : left_out.unexplained) out << "not explained: " << what << '\n';
  if (const std::string words = temperature_words(result); !words.empty()) out << words << '\n';
  if (const std::string words = wave_words(found); !words.empty()) out << "periodic error: " << words << '\n';
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& curve = found.model.reversal[k];
    if (curve.empty()) continue;
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -lowest;
    const Range range = curve.spline.interval();
    for (int i = 0; i <= 100; ++i) {
      const double value = curve.value(range.lower + range.width() * i / 100.0);
      lowest = std::min(lowest, value);
      highest = std::max(highest, value);
    }
    out << "reversal of " << metrology::axis_letters[k] << ": " << micro(curve.mean())
        << " um in the mean over the travel, " << micro(lowest) << " to " << micro(highest) << " um\n";
  }
  print_positioning(result.tests, result.tolerances, out);
  print_motions(result.motions, result.tolerances, true, out);
  for (const auto& one : result.diagonals) out << words(one) << '\n';
  for (const auto& note : result.not_judged) out << "note: " << note << '\n';
  for (const auto& one : result.drifts)
    out << "drift at one point, line " << one.line << ": range " << micro(one.range) << " um in "
        << one.readings << " readings\n";
  for (const auto& name : result.input.repeated)
    out << "left out: line " << name << ", the very readings of another line\n";
  for (const auto& one : result.knowledge.unidentified) out << "not identified: " << one.words() << '\n';
  if (const auto* chosen = interval_to_choose(result))
    out << "data interval to choose: " << report::si(chosen->interval, "m") << ", expected "
        << micro(chosen->expected_rms) << " um over the volume ("
        << report::si(result.intervals.front().interval, "m") << ": "
        << micro(result.intervals.front().expected_rms) << " um)\n";
  if (!result.next.empty() && !result.knowledge.unidentified.empty())
    out << "the next line that would help most" << (result.method == "full" ? "" : " (with --method full)")
        << ": " << result.next.front().line.name << ", expected then "
        << micro(result.next.front().volumetric_rms) << " um\n";
}

void describe_identification(const GeometricResult& result, compensation::ModelText& text) {
  text.open("identification");
  text.text("method", result.method);
  text.number("noise", result.found.noise);
  text.number("misfit", result.found.misfit);
  std::string open;  // components that the lines leave open by themselves
  for (const auto& one : result.knowledge.unidentified)
    if (one.components.size() == 1) open += (open.empty() ? "" : " ") + one.components.front();
  if (!open.empty()) text.text("unidentified", open);
  text.numbers("prior_amplitude", result.found.prior.amplitude.data(), 3);
  text.numbers("prior_length", result.found.prior.length.data(), 3);
  text.numbers("prior_stretch", result.found.prior.stretch.data(), 3);
  text.close();
}

}  // namespace invar::tools

#include "tools/geometric/geometric_report.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>

namespace invar::tools {

namespace {

using metrology::Identification;

double rms(const Eigen::VectorXd& values) {
  return values.size() == 0 ? 0.0 : std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

/// Measured deviation less its prediction from `unknowns`, both zero at their mean over the line's good points: where
/// the laser was zeroed is no property of the machine.
Eigen::VectorXd rest_of(const Identification& found, std::size_t l, const Eigen::VectorXd& unknowns) {
  Eigen::VectorXd rest = found.lines[l].deviation - found.rows[l].remainder;
  for (Eigen::Index i = 0; i < found.rows[l].rows.cols(); ++i)
    rest -= found.rows[l].rows.col(i) * unknowns[found.rows[l].unknowns[static_cast<std::size_t>(i)]];
  std::vector<double> good;
  for (Eigen::Index j = 0; j < rest.size(); ++j)
    if (std::isfinite(rest[j]) && found.point_weights[l][j] > 0.5) good.push_back(rest[j]);
  double mean = 0.0;
  for (const double value : good) mean += value / static_cast<double>(good.size());
  return Eigen::Map<const Eigen::VectorXd>(good.data(), static_cast<Eigen::Index>(good.size())).array() -
         mean;
}

/// The unknowns from all lines but one, at the same prior.
Eigen::VectorXd without(const Identification& found, std::size_t l) {
  const auto own = metrology::assemble({found.lines[l]}, {found.rows[l]}, found.basis.size, found.misfit,
                                       {found.point_weights[l]});
  auto others = found.equations;
  others.normal -= own.normal;
  others.right -= own.right;
  return metrology::solve_mean(others, found.basis, found.prior).mean;
}

std::string micro(double value) { return report::number(1e6 * value, 3); }

}  // namespace

void evaluate(GeometricResult& result) {
  const Identification& found = result.found;
  double before = 0.0;
  double after = 0.0;
  double unseen = 0.0;
  double points = 0.0;
  for (std::size_t l = 0; l < found.lines.size(); ++l) {
    LineFigures figures;
    const Eigen::VectorXd untouched = rest_of(found, l, Eigen::VectorXd::Zero(found.basis.size));
    Eigen::VectorXd raw(found.lines[l].deviation.size());
    Eigen::Index good = 0;
    for (Eigen::Index j = 0; j < raw.size(); ++j)
      if (std::isfinite(found.lines[l].deviation[j])) raw[good++] = found.lines[l].deviation[j];
    raw.conservativeResize(good);
    const Eigen::VectorXd fitted = rest_of(found, l, found.posterior.mean);
    const bool full = result.method == "full" && found.lines.size() > 1;
    const Eigen::VectorXd predicted = full ? rest_of(found, l, without(found, l)) : untouched;
    figures.before_rms = rms(raw);
    figures.before_max = raw.size() > 0 ? raw.cwiseAbs().maxCoeff() : 0.0;
    figures.after_rms = rms(fitted);
    figures.after_max = fitted.size() > 0 ? fitted.cwiseAbs().maxCoeff() : 0.0;
    figures.unseen_rms = full ? rms(predicted) : 0.0;
    figures.unseen_max = full && predicted.size() > 0 ? predicted.cwiseAbs().maxCoeff() : 0.0;
    result.figures.push_back(figures);
    result.unseen.push_back(predicted);
    before += raw.squaredNorm();
    after += fitted.squaredNorm();
    unseen += full ? predicted.squaredNorm() : 0.0;
    points += static_cast<double>(fitted.size());
    result.unseen_max = std::max(result.unseen_max, figures.unseen_max);
  }
  result.before_rms = std::sqrt(before / points);
  result.after_rms = std::sqrt(after / points);
  result.unseen_rms = std::sqrt(unseen / points);
  result.knowledge = metrology::identifiability(found.basis, found.posterior, found.model.squareness,
                                                found.model.travel, found.model.tool);
  result.knowledge.volumetric_rms = std::hypot(
      result.knowledge.volumetric_rms, std::sqrt(static_cast<double>(found.basis.chain.axes)) * found.misfit);
  if (result.method == "full") result.next = metrology::next_lines(result.machine, found, 3);
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
    how.misfit = all.misfit;
    const auto found = metrology::identify(result.machine, kept, how);
    double square = 0.0;
    double count = 0.0;
    for (const auto& line : all.lines) {
      Eigen::VectorXd rest = line.deviation - metrology::predicted_readings(found.model, line);
      std::vector<double> good;
      for (Eigen::Index j = 0; j < rest.size(); ++j)
        if (std::isfinite(rest[j])) good.push_back(rest[j]);
      double mean = 0.0;
      for (const double value : good) mean += value / static_cast<double>(good.size());
      for (const double value : good) square += (value - mean) * (value - mean);
      count += static_cast<double>(good.size());
    }
    const auto knowledge = metrology::identifiability(found.basis, found.posterior, found.model.squareness,
                                                      found.model.travel, found.model.tool);
    result.intervals.push_back({interval, points, std::sqrt(square / count), knowledge.volumetric_rms});
  }
}

nlohmann::json report_json(const GeometricResult& result) {
  const Identification& found = result.found;
  nlohmann::json json;
  json["kind"] = "geometric";
  json["method"] = result.method;
  json["readings"] = result.input.rows;
  json["noise"] = {{"value", found.noise}, {"unit", "m"}};
  json["misfit"] = {{"value", found.misfit}, {"unit", "m"}};
  json["lines_rms"] = {{"before", result.before_rms}, {"after", result.after_rms}, {"unit", "m"}};
  if (result.method == "full" && found.lines.size() > 1) json["lines_rms"]["unseen"] = result.unseen_rms;
  json["volumetric_rms_predicted"] = result.knowledge.volumetric_rms;
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
                                 {"volumetric_rms_predicted", one.expected_rms}});
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
  for (const auto& one : result.knowledge.unidentified) out << "not identified: " << one.words() << '\n';
  if (!result.next.empty() && !result.knowledge.unidentified.empty())
    out << "the next line that would help most: " << result.next.front().line.name << ", expected then "
        << micro(result.next.front().volumetric_rms) << " um\n";
}

void describe_identification(const GeometricResult& result, compensation::ModelText& text) {
  text.open("identification");
  text.text("method", result.method);
  text.number("noise", result.found.noise);
  text.number("misfit", result.found.misfit);
  text.numbers("prior_amplitude", result.found.prior.amplitude.data(), 3);
  text.numbers("prior_length", result.found.prior.length.data(), 3);
  text.close();
}

}  // namespace invar::tools

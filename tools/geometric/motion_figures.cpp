#include "tools/geometric/motion_figures.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <ostream>

#include "core/base/index.hpp"
#include "core/metrology/geometric/iso230_motions.hpp"

namespace invar::tools {

namespace {

using metrology::error_motion_count;
using metrology::is_positioning;
using metrology::is_rotation;
using metrology::squareness_count;

constexpr double coverage = 2.0;
constexpr double place_cell = 1e-7;        // m, readings nearer than this are of one place
constexpr Eigen::Index curve_places = 41;  // at which an identified curve is judged
constexpr double most_left = 0.2;          // of the prior variance: beyond it a motion is open in part

/// Values of one motion at ascending places, and what they scatter by: `factor` times independent unit normals.
struct Curve {
  Eigen::VectorXd position, value;
  Eigen::MatrixXd factor;
  double shared = 0.0;  // standard uncertainty of each value beside the scatter
};

MotionFigure::Value figure_of(const Curve& curve, const std::string& reference,
                              const std::function<double(const Eigen::VectorXd&)>& figure) {
  const double scatter = metrology::scatter_of(curve.value, curve.factor, figure);
  return {reference, figure(curve.value), coverage * std::hypot(scatter, curve.shared)};
}

MotionFigure figures_of(int motion, const Curve& curve) {
  MotionFigure result{std::string{metrology::iso_name(motion)},
                      is_rotation(motion) ? "angular error" : "straightness",
                      is_rotation(motion) ? "rad" : "m",
                      {curve.position[0], curve.position[curve.position.size() - 1]},
                      {}};
  if (is_rotation(motion)) {
    result.values.push_back(figure_of(curve, "", metrology::angular_error));
    return result;
  }
  const auto add = [&](const char* reference, double metrology::Straightness::*which) {
    result.values.push_back(figure_of(curve, reference, [&, which](const Eigen::VectorXd& value) {
      return metrology::straightness(curve.position, value).*which;
    }));
  };
  add("least-squares line", &metrology::Straightness::least_squares);
  add("line through the ends", &metrology::Straightness::end_points);
  add("minimum zone", &metrology::Straightness::minimum_zone);
  return result;
}

/// Means of the readings used, of both directions alike where both were read.
std::optional<Curve> means_of(const metrology::ErrorMotionReadings& readings,
                              const metrology::ErrorMotionFit& fit) {
  struct Place {
    double at = 0.0;
    std::array<double, 2> sum{}, square{}, count{};
  };
  std::map<long, Place> all;
  for (Eigen::Index i = 0; i < readings.position.size(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    if (!fit.kept[row]) continue;
    const std::size_t way = readings.direction.empty() || readings.direction[row] > 0 ? 0 : 1;
    Place& one = all[std::lround(readings.position[i] / place_cell)];
    one.at = readings.position[i];
    one.sum[way] += readings.value[i];
    one.square[way] += readings.value[i] * readings.value[i];
    one.count[way] += 1.0;
  }
  if (all.size() < 3) return std::nullopt;
  double scatter = 0.0, degrees = 0.0;
  for (const auto& [key, one] : all)
    for (std::size_t way = 0; way < 2; ++way) {
      if (one.count[way] < 2.0) continue;
      scatter += one.square[way] - one.sum[way] * one.sum[way] / one.count[way];
      degrees += one.count[way] - 1.0;
    }
  // Without repeats the fit tells how far readings scatter.
  const double variance = degrees > 0.0 ? std::max(scatter, 0.0) / degrees : fit.noise * fit.noise;
  Curve curve;
  const auto count = static_cast<Eigen::Index>(all.size());
  curve.position.resize(count);
  curve.value.resize(count);
  curve.factor = Eigen::MatrixXd::Zero(count, count);
  Eigen::Index next = 0;
  for (const auto& [key, one] : all) {
    double ways = 0.0, mean = 0.0, inverse = 0.0;
    for (std::size_t way = 0; way < 2; ++way) {
      if (one.count[way] == 0.0) continue;
      ways += 1.0;
      mean += one.sum[way] / one.count[way];
      inverse += 1.0 / one.count[way];
    }
    curve.position[next] = one.at;
    curve.value[next] = mean / ways;
    curve.factor(next, next) = std::sqrt(variance * inverse) / ways;
    ++next;
  }
  return curve;
}

/// A curve of the model with the spread that its unknowns leave it.
Curve identified(const metrology::Identification& found, const metrology::GeometricBasis::Block& block) {
  const auto axis = index(metrology::axis_of(block.motion));
  const auto& spline = found.basis.splines[axis];
  const Range travel = found.model.travel[axis];
  Curve curve;
  curve.position.resize(curve_places);
  curve.value.resize(curve_places);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(curve_places, block.size());
  for (Eigen::Index i = 0; i < curve_places; ++i) {
    const double at =
        travel.lower + travel.width() * static_cast<double>(i) / static_cast<double>(curve_places - 1);
    curve.position[i] = at;
    curve.value[i] = found.model.error_motion(block.motion, at);
    const auto w = spline.at(at);
    for (int k = 0; k < 4; ++k) rows.row(i) += w.value[index(k)] * block.coefficients.row(w.first + k);
  }
  const auto& posterior = found.posterior;
  const Eigen::MatrixXd& told = posterior.widened.size() > 0 ? posterior.widened : posterior.covariance;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts{
      told.block(block.first, block.first, block.size(), block.size())};
  curve.factor = rows * parts.eigenvectors() * parts.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  curve.shared = is_rotation(block.motion) ? 0.0 : found.misfit;
  return curve;
}

bool is_known(const metrology::Identifiability& knowledge, std::string_view name) {
  return std::any_of(knowledge.components.begin(), knowledge.components.end(),
                     [&](const auto& one) { return one.name == name && one.left <= most_left; });
}

/// Squareness between the trajectories' lines through the ends, as the model holds it, and between least-squares lines where
/// both straightness curves in the plane are known: their slopes against the ends add to the cosine.
MotionFigure squareness_figure(const metrology::Identification& found, int pair, int a, int b,
                               const std::map<int, Curve>& curves) {
  const auto& model = found.model;
  MotionFigure result{std::string{metrology::squareness_iso_name(pair)}, "squareness", "rad", {0.0, 0.0}, {}};
  const double sigma = model.squareness_sigma[index(pair)];
  const double cosine = model.squareness[index(pair)];
  const auto ab = curves.find(metrology::translation(b, a));
  const auto ba = curves.find(metrology::translation(a, b));
  if (ab != curves.end() && ba != curves.end()) {
    double slopes = 0.0, variance = sigma * sigma;
    for (const auto* curve : {&ab->second, &ba->second}) {
      const auto slope = [&](const Eigen::VectorXd& v) {
        return metrology::slope_against_ends(curve->position, v);
      };
      slopes += slope(curve->value);
      variance += std::pow(metrology::scatter_of(curve->value, curve->factor, slope), 2);
    }
    result.values.push_back({"least-squares lines",
                             metrology::squareness_angle_from_cosine(pair, cosine + slopes),
                             coverage * std::sqrt(variance)});
  }
  result.values.push_back(
      {"lines through the ends", metrology::squareness_angle_from_cosine(pair, cosine), coverage * sigma});
  return result;
}

std::vector<Tolerance> tolerances_of(const MotionFigure& figure, const std::vector<Tolerance>& all) {
  std::vector<Tolerance> result;
  for (const Tolerance& one : all)
    if (!one.figure && one.motion == figure.motion) result.push_back(one);
  return result;
}

std::string words(const MotionFigure& figure, const Tolerance& tolerance) {
  const auto& first = figure.values.front();
  return verdict_words(figure.motion + " " + figure.figure, first.value, first.uncertainty, tolerance.limit,
                       figure.unit);
}

}  // namespace

std::vector<MotionFigure> motion_figures(const MotionReadings& readings, const MotionFits& fits,
                                         const metrology::ErrorMotionNetworks& model, double environment) {
  std::vector<MotionFigure> figures;
  for (int c = 0; c < error_motion_count; ++c) {
    if (!fits[index(c)] || is_positioning(c) || !fits[index(c)]->motion.states.empty()) continue;
    auto curve = means_of(*readings[index(c)], *fits[index(c)]);
    if (!curve) continue;
    if (!is_rotation(c)) curve->shared = environment;
    figures.push_back(figures_of(c, *curve));
  }
  for (int pair = 0; pair < squareness_count; ++pair) {
    const double sigma = model.squareness_sigma[index(pair)];
    if (sigma <= 0.0) continue;
    figures.push_back(
        {std::string{metrology::squareness_iso_name(pair)},
         "squareness",
         "rad",
         {0.0, 0.0},
         {{"as it was measured", metrology::squareness_angle_from_cosine(pair, model.squareness[index(pair)]),
           coverage * sigma}}});
  }
  return figures;
}

std::vector<MotionFigure> motion_figures(const metrology::Identification& found,
                                         const metrology::Identifiability& knowledge) {
  std::vector<MotionFigure> figures;
  std::map<int, Curve> curves;
  for (const auto& block : found.basis.blocks) {
    if (is_positioning(block.motion) || !is_known(knowledge, metrology::iso_name(block.motion))) continue;
    const Curve& curve = curves.emplace(block.motion, identified(found, block)).first->second;
    figures.push_back(figures_of(block.motion, curve));
  }
  for (int a = 0; a < 3; ++a)
    for (int b = a + 1; b < 3; ++b) {
      const int pair = metrology::squareness_of(a, b);
      if (found.model.squareness_sigma[index(pair)] > 0.0 &&
          is_known(knowledge, metrology::squareness_iso_name(pair)))
        figures.push_back(squareness_figure(found, pair, a, b, curves));
    }
  return figures;
}

std::vector<std::string> unmet(const std::vector<Tolerance>& tolerances,
                               const std::vector<PositioningTest>& tests,
                               const std::vector<MotionFigure>& figures) {
  std::vector<std::string> result;
  for (const Tolerance& one : tolerances) {
    const std::vector<Tolerance> alone{one};
    const bool met = std::any_of(tests.begin(), tests.end(),
                                 [&](const auto& test) { return !tolerances_of(test, alone).empty(); }) ||
                     std::any_of(figures.begin(), figures.end(),
                                 [&](const auto& figure) { return !tolerances_of(figure, alone).empty(); });
    if (!met)
      result.push_back("The tolerance " + one.text + " is not judged: the readings give no such figure");
  }
  return result;
}

nlohmann::json motions_json(const std::vector<MotionFigure>& figures,
                            const std::vector<Tolerance>& tolerances) {
  nlohmann::json list = nlohmann::json::array();
  for (const MotionFigure& figure : figures) {
    nlohmann::json one{{"standard", "ISO 230-1"},
                       {"motion", figure.motion},
                       {"figure", figure.figure},
                       {"unit", figure.unit}};
    if (figure.range.width() > 0.0) one["range_m"] = {figure.range.lower, figure.range.upper};
    for (const auto& value : figure.values)
      one["values"].push_back({{"reference", value.reference},
                               {"value", value.value},
                               {"expanded_uncertainty", value.uncertainty}});
    for (const Tolerance& tolerance : tolerances_of(figure, tolerances))
      one["tolerances"].push_back(
          {{"limit", tolerance.limit},
           {"verdict", verdict_name(verdict_of(figure.values.front().value, figure.values.front().uncertainty,
                                               tolerance.limit))}});
    list.push_back(std::move(one));
  }
  return list;
}

void write_motions(report::Page& page, const std::vector<MotionFigure>& figures,
                   const std::vector<Tolerance>& tolerances) {
  if (figures.empty()) return;
  page.heading("Straightness, angles and squareness");
  page.paragraph(
      "By ISO 230-1: largest less smallest deviation over the range, from the reference line named. A "
      "tolerance means "
      "the first line of a figure. Pass and fail by ISO 14253-1.");
  std::vector<std::vector<std::string>> rows;
  for (const MotionFigure& figure : figures) {
    for (const Tolerance& tolerance : tolerances_of(figure, tolerances)) {
      const auto& first = figure.values.front();
      page.callout(words(figure, tolerance),
                   callout_of(verdict_of(first.value, first.uncertainty, tolerance.limit)));
    }
    const std::string range = figure.range.width() > 0.0
                                  ? report::number(1e3 * figure.range.lower, 5) + " to " +
                                        report::number(1e3 * figure.range.upper, 5)
                                  : "";
    for (const auto& value : figure.values)
      rows.push_back(
          {figure.motion, figure.figure, value.reference, range, micro_or_arcsec(value.value, figure.unit),
           micro_or_arcsec(value.uncertainty, figure.unit, 2), figure.unit == "rad" ? "arcsec" : "um"});
  }
  page.table(
      {"motion", "figure", "reference line", "range [mm]", "value", "expanded uncertainty, k = 2", "unit"},
      rows);
}

void print_motions(const std::vector<MotionFigure>& figures, const std::vector<Tolerance>& tolerances,
                   bool brief, std::ostream& out) {
  for (const MotionFigure& figure : figures) {
    const auto& first = figure.values.front();
    if (!brief)
      out << figure.motion << ' ' << figure.figure
          << " (ISO 230-1): " << micro_or_arcsec(first.value, figure.unit) << " +- "
          << micro_or_arcsec(first.uncertainty, figure.unit, 2) << (figure.unit == "rad" ? " arcsec" : " um")
          << (first.reference.empty() ? "" : ", " + first.reference) << '\n';
    for (const Tolerance& tolerance : tolerances_of(figure, tolerances))
      out << (brief ? "" : "  ") << words(figure, tolerance) << '\n';
  }
}

}  // namespace invar::tools

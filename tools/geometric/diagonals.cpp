#include "tools/geometric/diagonals.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace invar::tools {

namespace {

using metrology::Iso230Figure;

constexpr double whole = 0.9;   // of a travel: shorter lines are no diagonal of the volume
constexpr double still = 1e-9;  // m
const std::string letters = "XYZ";

/// "XYZ", "XZ": the axes that a line moves over nine tenths of their travel; empty where one moves less.
std::string axes_of(const PositioningTest& test, const metrology::Machine& machine) {
  std::string axes;
  for (int k = 0; k < 3; ++k) {
    if (std::abs(test.span[k]) < still) continue;
    const double travel = machine.travel[static_cast<std::size_t>(k)].width();
    if (std::abs(test.span[k]) < whole * travel) return "";
    axes += letters[static_cast<std::size_t>(k)];
  }
  return axes;
}

/// "NP0": the last axis that moves counts as positive, for a line read backward is the same diagonal.
std::string name_of(const Eigen::Vector3d& span) {
  double sense = 1.0;
  for (int k = 0; k < 3; ++k)
    if (std::abs(span[k]) >= still) sense = span[k] > 0.0 ? 1.0 : -1.0;
  std::string name;
  for (int k = 0; k < 3; ++k) name += std::abs(span[k]) < still ? '0' : (sense * span[k] > 0.0 ? 'P' : 'N');
  return name;
}

std::string title_of(const DiagonalFigures& figures) {
  return figures.plane.empty() ? "body diagonals" : "face diagonals " + figures.plane;
}

}  // namespace

std::vector<DiagonalFigures> diagonals_of(const std::vector<PositioningTest>& tests,
                                          const metrology::Machine& machine) {
  std::vector<DiagonalFigures> result;
  for (const PositioningTest& test : tests) {
    const std::string axes = axes_of(test, machine);
    const double deviation = test.figures[Iso230Figure::E], reversal = test.figures[Iso230Figure::B];
    if (axes.size() < 2 || std::isnan(deviation) || std::isnan(reversal)) continue;
    const std::string plane = axes.size() == 3 ? "" : axes;
    auto found =
        std::find_if(result.begin(), result.end(), [&](const auto& one) { return one.plane == plane; });
    if (found == result.end())
      found = result.insert(result.end(), {plane, plane.empty() ? 4 : 2, {}, 0.0, 0.0});
    found->diagonals.push_back({name_of(test.span), test.line, deviation, reversal});
    found->deviation = std::max(found->deviation, deviation);
    found->reversal = std::max(found->reversal, reversal);
  }
  return result;
}

std::string words(const DiagonalFigures& figures) {
  std::set<std::string> names;
  for (const auto& one : figures.diagonals) names.insert(one.name);
  return title_of(figures) + " (ISO 230-6): E " + micro_or_arcsec(figures.deviation, "m") + " um, B " +
         micro_or_arcsec(figures.reversal, "m") + " um, over " + std::to_string(names.size()) + " of " +
         std::to_string(figures.count);
}

nlohmann::json diagonals_json(const std::vector<DiagonalFigures>& all) {
  nlohmann::json list = nlohmann::json::array();
  for (const DiagonalFigures& figures : all) {
    nlohmann::json one{{"standard", "ISO 230-6"}, {"plane", figures.plane}, {"there_are", figures.count},
                       {"E", figures.deviation},  {"B", figures.reversal},  {"unit", "m"}};
    for (const auto& each : figures.diagonals)
      one["diagonals"].push_back(
          {{"name", each.name}, {"line", each.line}, {"E", each.deviation}, {"B", each.reversal}});
    list.push_back(std::move(one));
  }
  return list;
}

void write_diagonals(report::Page& page, const std::vector<DiagonalFigures>& all) {
  if (all.empty()) return;
  page.heading("Diagonals");
  page.paragraph(
      "By ISO 230-6: the largest systematic deviation E and the largest reversal B of the diagonals that "
      "were read in both "
      "directions. Letters say the sense of each axis: P positive, N negative, 0 still.");
  std::vector<std::vector<std::string>> rows;
  for (const DiagonalFigures& figures : all) {
    for (const auto& one : figures.diagonals)
      rows.push_back({title_of(figures), one.name, one.line, micro_or_arcsec(one.deviation, "m"),
                      micro_or_arcsec(one.reversal, "m")});
    rows.push_back({title_of(figures), "largest", "", micro_or_arcsec(figures.deviation, "m"),
                    micro_or_arcsec(figures.reversal, "m")});
    if (static_cast<int>(figures.diagonals.size()) < figures.count)
      page.paragraph("Not every diagonal was read: " + words(figures) + ".");
  }
  page.table({"diagonals", "sense", "line", "E [um]", "B [um]"}, rows);
}

}  // namespace invar::tools

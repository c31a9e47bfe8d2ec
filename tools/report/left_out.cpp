#include "tools/report/left_out.hpp"

#include <algorithm>
#include <cmath>

namespace invar::report {

namespace {

constexpr std::size_t most_shown = 40;  // rows: more fill a screen

std::string counted(std::size_t count, const std::string& row) {
  return std::to_string(count) + " " + row + (count == 1 ? "" : "s");
}

std::string reasons_of(const LeftOut& left_out) {
  std::string text;
  for (const auto& [count, why] : left_out.reasons)
    if (count > 0) text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + why;
  return text;
}

}  // namespace

double rms_of(const std::vector<double>& values) {
  double squares = 0.0;
  for (const double value : values) squares += value * value;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

std::string line_of(const LeftOut& left_out) {
  std::string text = counted(left_out.given, left_out.row) + ", ";
  const std::string reasons = reasons_of(left_out);
  text += left_out.used == left_out.given ? "all used" : std::to_string(left_out.used) + " used";
  if (!reasons.empty()) text += " (left out: " + reasons + ")";
  if (std::isnan(left_out.rms_used)) return text;
  text += "; error " + si(left_out.rms_used, left_out.unit) + " RMS over those used";
  if (std::isfinite(left_out.rms_all)) text += ", " + si(left_out.rms_all, left_out.unit) + " over all";
  return text;
}

void show(Page& page, const LeftOut& left_out) {
  page.heading("Rows left out, and the cost of that");
  const auto told = [&](double value) {
    return std::isnan(value) ? "cannot be told" : si(value, left_out.unit);
  };
  page.table(
      {left_out.row + "s", "used", "left out", "error over those used (RMS)", "error over all (RMS)"},
      {{std::to_string(left_out.given), std::to_string(left_out.used),
        std::to_string(left_out.given - left_out.used), told(left_out.rms_used), told(left_out.rms_all)}});
  const std::string reasons = reasons_of(left_out);
  page.paragraph(reasons.empty() ? "No " + left_out.row + " was left out." : "Left out: " + reasons + ".");
  for (const auto& sentence : left_out.unexplained) page.paragraph(sentence);
  if (left_out.rows.empty()) return;
  const auto shown = std::min(most_shown, left_out.rows.size());
  if (shown < left_out.rows.size())
    page.paragraph("The first " + std::to_string(shown) + " of " + std::to_string(left_out.rows.size()) +
                   " that were left out:");
  page.table(left_out.header,
             {left_out.rows.begin(), left_out.rows.begin() + static_cast<std::ptrdiff_t>(shown)});
}

nlohmann::json json_of(const LeftOut& left_out) {
  nlohmann::json json{{"given", left_out.given},
                      {"used", left_out.used},
                      {"unit", left_out.unit},
                      {"left_out", nlohmann::json::array()},
                      {"unexplained", left_out.unexplained}};
  for (const auto& [count, why] : left_out.reasons)
    if (count > 0) json["left_out"].push_back({{"count", count}, {"why", why}});
  if (std::isfinite(left_out.rms_used)) json["rms_used"] = left_out.rms_used;
  if (std::isfinite(left_out.rms_all)) json["rms_all"] = left_out.rms_all;
  return json;
}

}  // namespace invar::report

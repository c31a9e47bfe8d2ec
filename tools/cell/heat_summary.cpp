#include "tools/cell/heat_summary.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "core/recording/table.hpp"

namespace invar::tools {

namespace {

using report::number;
using report::Plot;
using report::Series;
using report::si;

/// The readings with one model in use.
struct Comparison {
  std::vector<double> x;            // m
  std::vector<double> t;            // s
  std::vector<double> temperature;  // degC
  std::vector<double> error;        // m
  [[nodiscard]] double rms() const {
    double squares = 0.0;
    for (const double e : error) squares += e * e;
    return error.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(error.size()));
  }
  [[nodiscard]] std::pair<double, double> ends() const {
    if (error.empty()) return {0.0, 0.0};
    const auto [low, high] = std::minmax_element(error.begin(), error.end());
    return {*low, *high};
  }
};

const std::string room = "room temperature";
const std::string heat = "position and temperature";

std::map<std::string, Comparison> read_comparisons(const std::filesystem::path& file) {
  const auto table = recording::Table::read(file, {"model"});
  const auto& models = table.find("model")->texts;
  const auto x = table.in("x", "m");
  const auto t = table.in("t", "s");
  const auto temperature = table.in("temperature", "degC");
  const auto error = table.in("error", "m");
  std::map<std::string, Comparison> result;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    Comparison& one = result[models[i]];
    one.x.push_back(x[i]);
    one.t.push_back(t[i] - t.front());
    one.temperature.push_back(temperature[i]);
    one.error.push_back(error[i]);
  }
  return result;
}

Series points(const std::vector<double>& x, double factor, const std::vector<double>& y,
              const std::string& label) {
  Series series;
  series.style = Series::Style::points;
  series.label = label;
  for (std::size_t i = 0; i < x.size(); ++i) {
    series.x.push_back(x[i] * factor);
    series.y.push_back(y[i] * 1e6);
  }
  return series;
}

std::string ends_of(const Comparison& one) {
  const auto [low, high] = one.ends();
  return number(1e6 * low, 2) + " .. " + number(1e6 * high, 2) + " um";
}

}  // namespace

void summarise_heat(const std::filesystem::path& folder, report::Page& page, std::ostream& out) {
  struct Part {
    const char* file;
    const char* label;
    const char* title;
  };
  constexpr Part parts[] = {
      {"verify_fixed.csv", "at one temperature", "Error at one temperature"},
      {"verify_varying.csv", "on a varying trace", "Error while the temperature varies"}};
  if (std::ifstream tried{folder / "models_tried.txt"}; tried) {
    page.heading("Models tried over position and temperature");
    for (std::string line; std::getline(tried, line);) {
      page.paragraph(line);
      if (line.starts_with("* ")) out << "model           " << line.substr(2) << '\n';
    }
  }
  std::vector<Plot> plots;
  std::vector<std::vector<std::string>> rows;
  for (const Part& part : parts) {
    if (!std::filesystem::exists(folder / part.file)) return;
    auto models = read_comparisons(folder / part.file);
    const Comparison& before = models[room];
    const Comparison& after = models[heat];
    const auto [low, high] = std::minmax_element(after.temperature.begin(), after.temperature.end());
    const std::string range =
        after.temperature.empty() ? "" : number(*low, 4) + " to " + number(*high, 4) + " degC";
    out << part.label << " (" << range << "), points not fitted:\n"
        << "  " << room << " model          rms " << si(before.rms(), "m") << ", " << ends_of(before) << '\n'
        << "  " << heat << " model  rms " << si(after.rms(), "m") << ", " << ends_of(after) << "   ("
        << number(before.rms() / after.rms(), 2) << " times less)\n";
    rows.push_back({std::string{part.label} + ", " + range, si(before.rms(), "m"), ends_of(before),
                    si(after.rms(), "m"), ends_of(after)});
    Plot over_x;
    over_x.title = part.title;
    over_x.x_label = "x [mm]";
    over_x.y_label = "error [um]";
    over_x.series = {points(before.x, 1e3, before.error, room + " model"),
                     points(after.x, 1e3, after.error, heat + " model")};
    plots.push_back(over_x);
    if (&part == &parts[0]) continue;
    Plot over_t = over_x;
    over_t.title = "The same over time";
    over_t.x_label = "t [s]";
    over_t.series = {points(before.t, 1.0, before.error, room + " model"),
                     points(after.t, 1.0, after.error, heat + " model")};
    Plot trace;
    trace.title = "Slide temperature meanwhile";
    trace.x_label = "t [s]";
    trace.y_label = "T [degC]";
    Series line;
    for (const auto& [name, model] : models) {
      line.x.insert(line.x.end(), model.t.begin(), model.t.end());
      line.y.insert(line.y.end(), model.temperature.begin(), model.temperature.end());
    }
    line.style = Series::Style::points;
    trace.series = {line};
    plots.push_back(over_t);
    plots.push_back(trace);
  }
  page.heading("Position and temperature against room temperature");
  page.table({"where", "room temperature: rms", "from .. to", "position and temperature: rms", "from .. to"},
             rows);
  page.plots(plots,
             "Read by the laser with the one and the other model in the loop, at points between those "
             "fitted; in the form of "
             "figures 3.9 and 3.10 of the thesis.");
}

}  // namespace invar::tools

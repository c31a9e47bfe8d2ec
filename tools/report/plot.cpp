#include "tools/report/plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <stdexcept>

#include "core/base/temporary_folder.hpp"

namespace invar::report {

namespace {

constexpr std::array palette{"#1f6fb4", "#d1495b", "#2a9d5c", "#e09f1f",
                             "#7d5ba6", "#4d4d4d", "#17a2b8", "#8c564b"};
constexpr std::size_t most_points = 4000;

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out + "\"";
}

/// The rows to draw of a long line: in each bucket the lowest and the highest, in order.
std::vector<std::size_t> thinned(const Series& series) {
  const std::size_t n = series.x.size();
  std::vector<std::size_t> rows;
  const bool line = series.style == Series::Style::line || series.style == Series::Style::dashed ||
                    series.style == Series::Style::steps;
  if (n <= most_points || series.style == Series::Style::heat || series.style == Series::Style::vectors) {
    for (std::size_t i = 0; i < n; ++i) rows.push_back(i);
    return rows;
  }
  if (!line) {
    for (std::size_t k = 0; k < most_points; ++k) rows.push_back(k * n / most_points);
    return rows;
  }
  const std::size_t buckets = most_points / 2;
  for (std::size_t b = 0; b < buckets; ++b) {
    const std::size_t begin = b * n / buckets;
    const std::size_t end = std::max(begin + 1, (b + 1) * n / buckets);
    std::size_t low = begin;
    std::size_t high = begin;
    for (std::size_t i = begin; i < end; ++i) {
      if (series.y[i] < series.y[low] || std::isnan(series.y[low])) low = i;
      if (series.y[i] > series.y[high] || std::isnan(series.y[high])) high = i;
    }
    rows.push_back(std::min(low, high));
    if (low != high) rows.push_back(std::max(low, high));
  }
  return rows;
}

void write_data(std::ostream& script, const std::string& name, const Series& series) {
  script << "$" << name << " << EOD\n";
  const auto value = [&](double number) -> std::ostream& {
    return std::isfinite(number) ? script << number : script << "NaN";
  };
  double previous_x = std::numeric_limits<double>::quiet_NaN();
  for (const std::size_t i : thinned(series)) {
    // A grid is written in scans: gnuplot wants an empty line where x changes.
    if (series.style == Series::Style::heat && !std::isnan(previous_x) && series.x[i] != previous_x)
      script << '\n';
    previous_x = series.x[i];
    if (series.style == Series::Style::line && !std::isfinite(series.y[i])) {
      script << '\n';  // breaks the line
      continue;
    }
    value(series.x[i]) << ' ';
    value(series.y[i]);
    if (i < series.u.size()) value((script << ' ', series.u[i]));
    if (i < series.v.size()) value((script << ' ', series.v[i]));
    script << '\n';
  }
  script << "EOD\n";
}

std::string drawing(const Series& series, const std::string& name, const std::string& colour) {
  const std::string title = series.label.empty() ? "notitle" : "title " + quoted(series.label);
  const std::string with = "$" + name + " using ";
  switch (series.style) {
    case Series::Style::line:
      return with + "1:2 with lines lw 1.6 lc rgb '" + colour + "' " + title;
    case Series::Style::dashed:
      return with + "1:2 with lines lw 1.4 dt 2 lc rgb '" + colour + "' " + title;
    case Series::Style::points:
      return with + "1:2 with points pt 7 ps 0.35 lc rgb '" + colour + "' " + title;
    case Series::Style::steps:
      return with + "1:2 with steps lw 1.4 lc rgb '" + colour + "' " + title;
    case Series::Style::band:
      return with + "1:2:3 with filledcurves fs transparent solid 0.22 noborder lc rgb '" + colour + "' " +
             title;
    case Series::Style::bars:
      return with + "1:2 with boxes fs solid 0.55 lc rgb '" + colour + "' " + title;
    case Series::Style::vectors:
      return with + "1:2:3:4 with vectors head size screen 0.006,25 filled lw 1.2 lc rgb '" + colour + "' " +
             title;
    case Series::Style::heat:
      return with + "1:2:3 with image " + title;
  }
  return {};
}

void write_plot(std::ostream& script, const Plot& plot, std::size_t number,
                const std::filesystem::path& file) {
  for (std::size_t s = 0; s < plot.series.size(); ++s)
    write_data(script, "d" + std::to_string(number) + "_" + std::to_string(s), plot.series[s]);
  script << "set terminal svg size " << plot.width << "," << plot.height
         << " dynamic noenhanced font 'Helvetica,12' background rgb 'white'\nset output "
         << quoted(file.string()) << "\nset title " << quoted(plot.title) << "\nset xlabel "
         << quoted(plot.x_label) << " offset 0,0.4\nset ylabel " << quoted(plot.y_label)
         << "\nset grid lc rgb '#dddddd'\nset border 3 lc rgb '#888888'\nset tics nomirror\n"
         << "set key outside bottom center horizontal samplen 2 height 0.8\nset boxwidth 0.9 relative\n"
         << (plot.equal_axes ? "set size ratio -1\n" : "set size noratio\n")
         << (plot.log_x ? "set logscale x\n" : "unset logscale x\n")
         << (plot.log_y ? "set logscale y\n" : "unset logscale y\n")
         << "set palette defined (-1 '#2166ac', 0 '#f7f7f7', 1 '#b2182b')\n";
  const auto range = [&](char axis, const std::optional<Range>& r) {
    script << "set " << axis << "range [";
    if (r)
      script << r->lower << ":" << r->upper;
    else
      script << "*:*";
    script << "]\n";
  };
  script << "set autoscale\n";
  range('x', plot.x_range);
  range('y', plot.y_range);
  // A grid of values fills its frame; other curves end at round numbers.
  const bool heat = std::any_of(plot.series.begin(), plot.series.end(),
                                [](const Series& s) { return s.style == Series::Style::heat; });
  if (heat && !plot.x_range && !plot.y_range) script << "set autoscale xfix\nset autoscale yfix\n";
  script << "plot ";
  std::size_t colour = 0;
  bool any = false;
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const Series& series = plot.series[s];
    const bool drawable =
        std::any_of(series.y.begin(), series.y.end(), [](double y) { return std::isfinite(y); });
    if (!drawable) continue;
    const std::string rgb = series.colour.empty() ? palette[colour++ % palette.size()] : series.colour;
    script << (any ? ", " : "")
           << drawing(series, "d" + std::to_string(number) + "_" + std::to_string(s), rgb);
    any = true;
  }
  script << (any ? "\n" : "NaN notitle\n") << "unset output\n";
}

}  // namespace

void centre(Plot& plot) {
  double farthest = 0.0;
  for (const Series& series : plot.series)
    for (const auto* values : {&series.x, &series.y})
      for (const double value : *values)
        if (std::isfinite(value)) farthest = std::max(farthest, std::abs(value));
  plot.equal_axes = true;
  if (farthest > 0.0) plot.x_range = plot.y_range = Range{-1.05 * farthest, 1.05 * farthest};
}

void add_curve(Plot& plot, const Range& range, const std::string& label, const std::string& colour,
               const std::function<CurvePoint(double x)>& at) {
  Series band;
  band.style = Series::Style::band;
  band.colour = colour;
  Series line;
  line.label = label;
  line.colour = colour;
  for (int i = 0; i <= 200; ++i) {
    const double x = range.lower + range.width() * i / 200.0;
    const CurvePoint point = at(x);
    line.x.push_back(x);
    line.y.push_back(point.value);
    band.x.push_back(x);
    band.y.push_back(point.value - 2.0 * point.sigma);
    band.u.push_back(point.value + 2.0 * point.sigma);
  }
  plot.series.push_back(std::move(band));
  plot.series.push_back(std::move(line));
}

Series histogram(const std::vector<double>& values, double width, double unit) {
  constexpr int reach = 12;
  Series bars;
  bars.style = Series::Style::bars;
  for (int k = -reach; k <= reach; ++k) bars.x.push_back(unit * width * k);
  bars.y.assign(bars.x.size(), 0.0);
  for (const double value : values)
    if (const long k = std::lround(value / width); std::abs(k) <= reach)
      bars.y[static_cast<std::size_t>(k + reach)] += 1.0;
  return bars;
}

std::vector<std::string> draw(const std::vector<Plot>& plots) {
  if (plots.empty()) return {};
  const TemporaryFolder folder{"invar-plots"};
  const auto file = [&](std::size_t i) { return folder / (std::to_string(i) + ".svg"); };
  {
    std::ofstream script{folder / "script"};
    script << std::setprecision(9);
    for (std::size_t i = 0; i < plots.size(); ++i) write_plot(script, plots[i], i, file(i));
  }
  const std::string call =
      "gnuplot '" + (folder / "script").string() + "' 2> '" + (folder / "errors").string() + "'";
  const int status = std::system(call.c_str());  // NOLINT: the path is ours
  std::vector<std::string> drawings;
  for (std::size_t i = 0; i < plots.size() && status == 0; ++i) {
    std::ifstream stream{file(i)};
    std::ostringstream svg;
    svg << stream.rdbuf();
    std::string text = svg.str();
    const auto begin = text.find("<svg");
    text = begin == std::string::npos ? "" : text.substr(begin);
    // Several drawings share one page: gnuplot's marker names must not clash.
    for (const std::string name : {"gpDot", "gpPt", "hline", "gnuplot_plot_", "gnuplot_canvas", "greybox"}) {
      const std::string unique = "p" + std::to_string(i) + "_" + name;
      for (std::size_t at = 0; (at = text.find(name, at)) != std::string::npos; at += unique.size())
        text.replace(at, name.size(), unique);
    }
    drawings.push_back(std::move(text));
  }
  std::string errors;
  if (status != 0) {
    std::ifstream stream{folder / "errors"};
    std::getline(stream, errors, '\0');
  }
  if (status != 0) throw std::runtime_error{"gnuplot failed: " + errors + " (is gnuplot-nox installed?)"};
  return drawings;
}

}  // namespace invar::report

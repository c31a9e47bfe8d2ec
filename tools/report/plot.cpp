#include "tools/report/plot.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <limits>
#include <span>
#include <sstream>

#include "core/base/contract.hpp"
#include "core/base/name.hpp"
#include "core/base/temporary_folder.hpp"
#include "tools/report/escaped.hpp"

namespace invar::report {

namespace {

constexpr std::array palette{"#1f6fb4", "#d1495b", "#2a9d5c", "#e09f1f",
                             "#7d5ba6", "#4d4d4d", "#17a2b8", "#8c564b"};
constexpr std::size_t most_points = 4000;

/// Texts of a plot. gnuplot never sees one: its script has a mark of as many characters in its place, so that the key is
/// laid out as wide as the text, and the text is written into the SVG afterwards, escaped.
class Texts {
 public:
  /// The mark of a text, quoted for the script.
  std::string mark(const std::string& text) {
    if (text.empty()) return "''";
    texts_.push_back(text);
    return "'" + mark_of(texts_.size() - 1) + "'";
  }
  /// The SVG with each text in the place of its mark.
  [[nodiscard]] std::string written_into(const std::string& svg) const {
    std::string out;
    std::size_t at = 0;
    for (std::size_t next; (next = svg.find(lead, at)) != std::string::npos;) {
      out.append(svg, at, next - at);
      const std::size_t number = number_at(svg, next);
      if (number < texts_.size() && svg.compare(next, mark_of(number).size(), mark_of(number)) == 0) {
        out += escaped(texts_[number]);
        at = next + mark_of(number).size();
      } else {
        out += svg[next];
        at = next + 1;
      }
    }
    return out.append(svg, at);
  }

 private:
  /// A character of plane 15, which is for private use, says which text it is; dots follow up to the text's length.
  static constexpr char lead = static_cast<char>(0xF3);
  [[nodiscard]] std::string mark_of(std::size_t number) const {
    const auto part = [&](unsigned shift) { return static_cast<char>(0x80U | (number >> shift & 0x3FU)); };
    const auto letters = std::count_if(texts_[number].begin(), texts_[number].end(), [](char c) {
      return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
    });
    return std::string{lead, static_cast<char>(0xB0U | (number >> 12U & 0xFU)), part(6), part(0)}.append(
        static_cast<std::size_t>(std::max<std::ptrdiff_t>(letters, 1) - 1), '.');
  }
  static std::size_t number_at(const std::string& svg, std::size_t at) {
    std::size_t number = 0;
    for (std::size_t i = 1; i < 4; ++i)
      number = number << 6U | (static_cast<unsigned char>(at + i < svg.size() ? svg[at + i] : 0) & 0x3FU);
    return number & 0xFFFFU;
  }

  std::vector<std::string> texts_;
};

/// A colour is ours, never a text from outside: it stands in the script as it is.
const std::string& checked_colour(const std::string& colour) {
  const bool good = colour.size() == 7 && colour[0] == '#' &&
                    colour.find_first_not_of("0123456789abcdefABCDEF", 1) == std::string::npos;
  INVAR_EXPECTS(good, colour);
  return colour;
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

std::string drawing(const Series& series, const std::string& name, const std::string& colour, Texts& texts) {
  const std::string title = series.label.empty() ? "notitle" : "title " + texts.mark(series.label);
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

/// The script has nine digits: ends that agree in them are one for gnuplot, which refuses an empty range.
bool is_range(const std::optional<Range>& r) {
  return r && std::isfinite(r->lower) && std::isfinite(r->upper) &&
         r->width() > 1e-7 * std::max(std::abs(r->lower), std::abs(r->upper));
}

/// Whether a row of the series is to be seen: gnuplot refuses a plot without one.
bool has_point(const Series& series, const Plot& plot) {
  for (std::size_t i = 0; i < std::min(series.x.size(), series.y.size()); ++i) {
    const double x = series.x[i], y = series.y[i];
    const bool seen = !is_range(plot.x_range) || plot.x_range->contains(x);
    if (seen && std::isfinite(x) && std::isfinite(y) && (!plot.log_x || x > 0.0) && (!plot.log_y || y > 0.0))
      return true;
  }
  return false;
}

void write_plot(std::ostream& script, const Plot& plot, std::size_t number, const std::string& file,
                Texts& texts) {
  for (std::size_t s = 0; s < plot.series.size(); ++s)
    write_data(script, "d" + std::to_string(number) + "_" + std::to_string(s), plot.series[s]);
  script << "set terminal svg size " << plot.width << "," << plot.height
         << " dynamic noenhanced font 'Helvetica,12' background rgb 'white'\nset output "
         << "'" << file << "'\nset title " << texts.mark(plot.title) << "\nset xlabel "
         << texts.mark(plot.x_label) << " offset 0,0.4\nset ylabel " << texts.mark(plot.y_label)
         << "\nset grid lc rgb '#dddddd'\nset border 3 lc rgb '#888888'\nset tics nomirror\n"
         << "set key outside bottom center horizontal samplen 2 height 0.8\nset boxwidth 0.9 relative\n"
         << (plot.equal_axes ? "set size ratio -1\n" : "set size noratio\n")
         << (plot.log_x ? "set logscale x\n" : "unset logscale x\n")
         << (plot.log_y ? "set logscale y\n" : "unset logscale y\n")
         << "set palette defined (-1 '#2166ac', 0 '#f7f7f7', 1 '#b2182b')\n";
  const auto range = [&](char axis, const std::optional<Range>& r) {
    script << "set " << axis << "range [";
    if (is_range(r))
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
  const bool any_point = std::any_of(plot.series.begin(), plot.series.end(),
                                     [&](const Series& series) { return has_point(series, plot); });
  if (!any_point) script << "set xrange [0.1:1]\nset yrange [0.1:1]\n";  // an empty frame needs ranges
  script << "plot ";
  std::size_t colour = 0;
  bool any = false;
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const Series& series = plot.series[s];
    if (!has_point(series, plot)) continue;
    const std::string rgb =
        series.colour.empty() ? palette[colour++ % palette.size()] : checked_colour(series.colour);
    script << (any ? ", " : "")
           << drawing(series, "d" + std::to_string(number) + "_" + std::to_string(s), rgb, texts);
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

namespace {

std::string content_of(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

/// gnuplot on `script` in the folder: no shell, none of the user's start files, and names of ours alone. Returns why it
/// failed; empty where it did not.
std::string fault_of_gnuplot(const std::filesystem::path& folder) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "errors", O_WRONLY | O_CREAT | O_TRUNC, 0600);
  std::array<std::string, 3> words{"gnuplot", "--default-settings", "script"};
  std::array<char*, 4> arguments{words[0].data(), words[1].data(), words[2].data(), nullptr};
  pid_t child = 0;
  const int error = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) return "gnuplot is not there; install gnuplot-nox";
  if (error != 0) return std::string{"gnuplot cannot be started: "} + std::strerror(error);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return "";
  if (const std::string said = content_of(folder / "errors"); !said.empty())
    return "gnuplot says: " + printable(said);
  return "gnuplot failed without a word (" +
         (WIFEXITED(status) ? "status " + std::to_string(WEXITSTATUS(status))
                            : "signal " + std::to_string(WTERMSIG(status))) +
         "); try `gnuplot --version`";
}

/// Several drawings share one page: gnuplot's marker names must not clash.
void make_names_unique(std::string& svg, std::size_t number) {
  for (const std::string name : {"gpDot", "gpPt", "hline", "gnuplot_plot_", "gnuplot_canvas", "greybox"}) {
    const std::string unique = "p" + std::to_string(number) + "_" + name;
    for (std::size_t at = 0; (at = svg.find(name, at)) != std::string::npos; at += unique.size())
      svg.replace(at, name.size(), unique);
  }
}

/// The drawings of plots by one gnuplot, or nothing and why.
std::vector<std::string> drawn_together(std::span<const Plot> plots, std::string& fault) {
  const TemporaryFolder folder{"invar-plots"};
  const auto file = [&](std::size_t i) { return std::to_string(i) + ".svg"; };
  std::vector<Texts> texts(plots.size());
  {
    std::ofstream script{folder / "script"};
    script << std::setprecision(9) << "set encoding utf8\n";
    for (std::size_t i = 0; i < plots.size(); ++i) write_plot(script, plots[i], i, file(i), texts[i]);
  }
  fault = fault_of_gnuplot(folder.path());
  if (!fault.empty()) return {};
  std::vector<std::string> drawings;
  for (std::size_t i = 0; i < plots.size(); ++i) {
    const std::string svg = content_of(folder / file(i));
    const auto begin = svg.find("<svg");
    if (begin == std::string::npos) {
      fault = "gnuplot wrote no drawing; try `gnuplot --version`";
      return {};
    }
    drawings.push_back(texts[i].written_into(svg.substr(begin)));
  }
  return drawings;
}

}  // namespace

std::vector<std::string> draw(const std::vector<Plot>& plots) {
  if (plots.empty()) return {};
  std::string fault;
  std::vector<std::string> drawings = drawn_together(plots, fault);
  // One that gnuplot refuses must not take the others with it.
  for (std::size_t i = 0; drawings.size() < plots.size(); ++i) {
    const auto one = drawn_together(std::span{plots}.subspan(i, 1), fault);
    drawings.push_back(!one.empty() ? one.front() : "");
    if (drawings.back().empty())
      drawings.back() =
          "<p>The plot \"" + escaped(plots[i].title) + "\" is not drawn: " + escaped(fault) + "</p>";
  }
  for (std::size_t i = 0; i < drawings.size(); ++i) make_names_unique(drawings[i], i);
  return drawings;
}

}  // namespace invar::report

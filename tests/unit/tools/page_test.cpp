// Numbers of a report as somebody reads them.
#include "tools/report/page.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/base/name.hpp"
#include "core/base/temporary_folder.hpp"
#include "tools/report/escaped.hpp"

namespace invar::report {
namespace {

TEST(Numbers, TakeTheHandiestPrefixAndOnlyWhereTheUnitTakesOne) {
  EXPECT_EQ(si(4.1e-6, "m"), "4.1 um");
  EXPECT_EQ(si(0.78, "s", 2), "780 ms");
  EXPECT_EQ(si(35.15, "N/A"), "35.1 N/A");
  EXPECT_EQ(si(0.013, "1"), "0.013");
  EXPECT_EQ(si(95.0, "kg"), "95 kg");
  EXPECT_EQ(si(2e-8, "1/px2"), "2e-08 1/px2");
  EXPECT_EQ(si(0.0, "V"), "0 V");
}

TEST(Numbers, ShowTwoDigitsOfTheirSigma) {
  EXPECT_EQ(with_sigma(19.4, 0.7753, "s"), "19.40 +- 0.78 s");
  EXPECT_EQ(with_sigma(0.005006, 0.0001642, "W/K"), "5.01 +- 0.16 mW/K");
  EXPECT_EQ(with_sigma(-7.275e5, 698.6, "1"), "(-7.2750 +- 0.0070)e5");
  EXPECT_EQ(with_sigma(2.4, 0.0, "N"), "2.4 N");
  EXPECT_EQ(with_sigma(3.0, 40.0, "N"), "3 +- 40 N");
  EXPECT_EQ(with_sigma(5.5e-8, 1.0e-5, "m"), "0 +- 10 um");
}

TEST(Plots, ShowNumbersOneCanRead) {
  Plot plot;
  plot.x_label = "time [s]";
  plot.y_label = "error [m]";
  plot.series.resize(2);
  plot.series[0].x = {0.0, 4000.0};
  plot.series[0].y = {1e-7, std::nan("")};
  plot.series[1].y = {-4e-7, 2e-9};
  in_handy_units(plot);
  EXPECT_EQ(plot.x_label, "time [s]");
  EXPECT_EQ(plot.y_label, "error [nm]");
  EXPECT_DOUBLE_EQ(plot.series[0].x[1], 4000.0);
  EXPECT_DOUBLE_EQ(plot.series[0].y[0], 100.0);
  EXPECT_DOUBLE_EQ(plot.series[1].y[0], -400.0);
  plot.y_label = "exponent";
  in_handy_units(plot);
  EXPECT_EQ(plot.y_label, "exponent");
  EXPECT_DOUBLE_EQ(plot.series[1].y[0], -400.0);
}

/// Words that steer a shell, gnuplot, a page or a terminal; each that can would make the file `made`.
std::vector<std::string> hostile_names(const std::string& made) {
  const std::string touch = "touch " + made;
  return {"`" + touch + "`",
          "$(" + touch + ")",
          "'; system('" + touch + "') #",
          "\"; system(\"" + touch + "\") #",
          "' . system('" + touch + "') . '",
          "a\n!" + touch + "\nb",
          "EOD\n!" + touch,
          "\\\"; !" + touch,
          "@HOME ^{x} _y {/Symbol a} %c &{b}",
          "</script><script>alert(1)</script>",
          "<svg onload=\"x\">",
          "'\"`\\",
          "\x1b]0;x\x07\x1b[2J",
          std::string("a\0b", 3),
          "\xF3\xB0\x80\x80",
          "\xC2\xB5m \xC2\xB0\x43"};
}

Plot plot_of(const std::string& name) {
  Plot plot;
  plot.title = plot.x_label = plot.y_label = name;
  plot.series.resize(2);
  for (Series& series : plot.series) {
    series.label = name;
    series.x = {0.0, 1.0};
    series.y = {0.0, 2.0};
  }
  return plot;
}

TEST(Plots, RunNothingThatStandsInAName) {
  const TemporaryFolder folder{"invar-test-plots"};
  const auto made = folder / "made";
  std::vector<Plot> plots;
  for (const auto& name : hostile_names(made.string())) plots.push_back(plot_of(name));
  const auto drawings = draw(plots);
  EXPECT_FALSE(std::filesystem::exists(made));
  ASSERT_EQ(drawings.size(), plots.size());
  for (std::size_t i = 0; i < plots.size(); ++i) {
    const std::string text = escaped(plots[i].title);
    std::size_t times = 0;
    for (std::size_t at = 0; (at = drawings[i].find(text, at)) != std::string::npos; at += text.size())
      ++times;
    EXPECT_EQ(times, 5u) << text;  // title, two axes, two keys
    EXPECT_EQ(drawings[i].find("<script"), std::string::npos);
    EXPECT_EQ(drawings[i].find('\x1b'), std::string::npos);
    EXPECT_FALSE(flaw_of_text(drawings[i])) << flaw_of_text(drawings[i])->what;
  }
}

TEST(Plots, TakeAFolderForTemporaryFilesWithAnyName) {
  const TemporaryFolder folder{"invar-test-plots"};
  const auto strange = folder / "a'`touch made`\" b";
  std::filesystem::create_directory(strange);
  const char* before = std::getenv("TMPDIR");
  const std::string kept = before == nullptr ? "" : before;
  setenv("TMPDIR", strange.c_str(), 1);
  EXPECT_EQ(draw({plot_of("a")}).size(), 1u);
  if (before == nullptr)
    unsetenv("TMPDIR");
  else
    setenv("TMPDIR", kept.c_str(), 1);
}

TEST(Plots, AreDrawnWhateverTheNumbers) {
  const double nan = std::nan(""), infinite = std::numeric_limits<double>::infinity();
  Plot empty = plot_of("empty"), logarithmic = plot_of("negative"), nowhere = plot_of("nowhere"),
       point = plot_of("point");
  empty.series.clear();
  logarithmic.log_y = logarithmic.log_x = true;
  for (Series& series : logarithmic.series) series.y = {-1.0, 0.0};
  for (Series& series : nowhere.series) series.x = {nan, infinite};
  point.x_range = Range{1.0, 1.0};
  point.y_range = Range{nan, infinite};
  EXPECT_EQ(draw({empty, logarithmic, nowhere, point}).size(), 4u);
}

/// PATH for as long as it lives.
struct Path {
  explicit Path(const std::string& now) { setenv("PATH", now.c_str(), 1); }
  ~Path() { setenv("PATH", before.c_str(), 1); }
  std::string before = std::getenv("PATH");
};

TEST(Plots, OneThatCannotBeDrawnSaysSoAndLeavesTheOthers) {
  const TemporaryFolder folder{"invar-test-plots"};
  {
    std::ofstream fake{folder / "gnuplot"};  // refuses any script with a grid
    fake << "#!/bin/sh\ngrep -q 'with image' script && echo no grids here >&2 && exit 1\n"
            "PATH=/usr/bin:/bin exec gnuplot \"$@\"\n";
  }
  std::filesystem::permissions(folder / "gnuplot", std::filesystem::perms::owner_all);
  Plot grid = plot_of("a grid");
  grid.series.resize(1);
  grid.series[0].style = Series::Style::heat;
  grid.series[0].u = grid.series[0].x;
  const Path path{folder.path().string() + ":/usr/bin:/bin"};
  const auto drawings = draw({plot_of("a"), grid, plot_of("b")});
  ASSERT_EQ(drawings.size(), 3u);
  EXPECT_TRUE(drawings[0].starts_with("<svg"));
  EXPECT_NE(drawings[1].find("a grid\" is not drawn: gnuplot says: no grids here"), std::string::npos)
      << drawings[1];
  EXPECT_TRUE(drawings[2].starts_with("<svg"));
}

TEST(Plots, AreDrawnInARangeThatIsNone) {
  Plot narrow = plot_of("narrow");
  narrow.x_range = narrow.y_range = Range{1.0, 1.0 + 1e-12};
  EXPECT_TRUE(draw({narrow}).front().starts_with("<svg"));
}

TEST(Plots, APageIsWrittenWithoutGnuplot) {
  const TemporaryFolder folder{"invar-test-plots"};
  const Path path{folder.path().string()};
  Page page{"Title"};
  page.plot(plot_of("a"));
  const std::string text = page.text();
  EXPECT_NE(text.find("is not drawn: gnuplot is not there; install gnuplot-nox"), std::string::npos);
}

/// A gnuplot of ours, first on the path.
void put_gnuplot(const std::filesystem::path& folder, const std::string& lines) {
  std::ofstream{folder / "gnuplot"} << "#!/bin/sh\n" << lines << "\n";
  std::filesystem::permissions(folder / "gnuplot", std::filesystem::perms::owner_all);
}

TEST(Plots, APageIsWrittenWithAGnuplotThatFails) {
  const TemporaryFolder folder{"invar-test-plots"};
  const char* path = std::getenv("PATH");
  const Path ours{folder.path().string() + ":" + (path != nullptr ? path : "/bin")};
  const std::vector<std::pair<std::string, std::string>> cases{
      {"exit 3", "gnuplot failed without a word (status 3)"},
      {"kill -9 $$", "gnuplot failed without a word (signal 9)"},
      {"echo no such terminal >&2; exit 1", "gnuplot says: no such terminal"},
      {"exit 0", "gnuplot wrote no drawing"},
      {"echo '<html>' >0.svg", "gnuplot wrote no drawing"}};
  for (const auto& [lines, words] : cases) {
    put_gnuplot(folder.path(), lines);
    Page page{"Title"};
    page.plot(plot_of("a"));
    page.plot(plot_of("b"));
    const std::string text = page.text();
    EXPECT_NE(text.find("The plot \""), std::string::npos) << lines;
    EXPECT_NE(text.find("is not drawn: " + words), std::string::npos) << lines << '\n' << text;
  }
}

TEST(Pages, ShowNamesAsLetters) {
  const TemporaryFolder folder{"invar-test-page"};
  for (const auto& name : hostile_names("made")) {
    Page page{name, name};
    page.heading(name);
    page.paragraph(name);
    page.callout(name, name);
    page.table({name}, {{name}});
    page.bars(name, {{name, 1.0, name, name}});
    page.preformatted(name);
    page.image({1, 2, 3}, name, name);
    const std::string text = page.text();
    EXPECT_EQ(text.find("<script"), std::string::npos);
    EXPECT_EQ(text.find("<svg onload"), std::string::npos);
    EXPECT_FALSE(flaw_of_text(text)) << flaw_of_text(text)->what;
    EXPECT_NE(text.find("<p>" + escaped(name) + "</p>"), std::string::npos);
  }
}

}  // namespace
}  // namespace invar::report

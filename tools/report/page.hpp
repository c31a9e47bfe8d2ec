// Page: a self-contained HTML report, built from top to bottom.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/quantity.hpp"
#include "tools/report/plot.hpp"

namespace invar::report {

using invar::number;
using invar::si;
using invar::with_sigma;

/// Texts are plain and are escaped here. Plots are drawn together when the page is written.
class Page {
 public:
  explicit Page(std::string title, std::string subtitle = "");

  void heading(const std::string& text);
  void paragraph(const std::string& text);
  /// A line that stands out: the verdict, the one number. `kind` is "good", "bad", "warn" or "plain".
  void callout(const std::string& text, const std::string& kind = "plain");
  void table(const std::vector<std::string>& header, const std::vector<std::vector<std::string>>& rows);
  void plot(Plot plot, const std::string& caption = "");
  /// Plots side by side where the window is wide enough.
  void plots(std::vector<Plot> plots, const std::string& caption = "");
  /// A PNG or JPEG file's bytes, embedded.
  void image(const std::vector<unsigned char>& bytes, const std::string& mime,
             const std::string& caption = "");
  /// Numbers of one kind beside one another; the longest bar is the largest value.
  struct Bar {
    std::string label;
    double value = 0.0;
    std::string text;    // the value with its unit
    std::string colour;  // "#rrggbb"
  };
  void bars(const std::string& title, const std::vector<Bar>& bars);
  void preformatted(const std::string& text);
  /// HTML that the caller made and escaped.
  void html(const std::string& text);

  /// Draws the plots.
  [[nodiscard]] std::string text() const;
  /// The same as a file, written through a temporary one. Throws InputError when it cannot be
  /// written.
  void write(const std::filesystem::path& file) const;

 private:
  struct Part {
    std::string html;
    std::vector<Plot> plots;
    std::string caption;
  };
  std::string title_;
  std::string subtitle_;
  std::vector<Part> parts_;
};

/// Both axes in the handiest prefix of the unit that ends their label: 4e-7 over "error [m]" becomes 400 over "error [nm]".
/// Seconds and hertz are left as they are: nobody reads kiloseconds.
void in_handy_units(Plot& plot);
}  // namespace invar::report

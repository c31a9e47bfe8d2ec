#include "tools/report/page.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <sstream>

#include "core/base/new_file.hpp"
#include "tools/report/escaped.hpp"

namespace invar::report {

namespace {

std::string base64(const std::vector<unsigned char>& bytes) {
  static constexpr char alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned block = 0;
    for (std::size_t k = 0; k < 3; ++k) block = block << 8U | (i + k < bytes.size() ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? alphabet[block >> (18U - 6U * k) & 63U] : '=';
  }
  return out;
}

/// A number, perhaps with its unit: stands right in its column.
bool numeric(const std::string& cell) {
  const std::size_t digit = cell.starts_with('-') ? 1 : 0;
  return cell.size() > digit && cell[digit] >= '0' && cell[digit] <= '9' &&
         std::count(cell.begin(), cell.end(), ' ') <= 1;
}

constexpr const char* style = R"(
:root{--ink:#1c2733;--soft:#5b6875;--line:#dfe4ea;--good:#1d7a46;--bad:#b3261e;--warn:#9a6700}
body{font:16px/1.5 system-ui,-apple-system,"Segoe UI",Helvetica,Arial,sans-serif;color:var(--ink);max-width:1180px;
margin:2rem auto;padding:0 1.2rem;background:#fff}
h1{font-size:1.7rem;margin:0}h2{font-size:1.2rem;margin:2.2rem 0 .6rem;border-bottom:1px solid var(--line);padding-bottom:.2rem}
.sub{color:var(--soft);margin:.2rem 0 1rem}.callout{border-left:5px solid var(--soft);background:#f5f7f9;padding:.7rem 1rem;
margin:.8rem 0;font-size:1.06rem}.callout.good{border-color:var(--good)}.callout.bad{border-color:var(--bad)}
.callout.warn{border-color:var(--warn)}table{border-collapse:collapse;margin:.6rem 0;font-size:.93rem}
th,td{padding:.28rem .8rem;text-align:left;border-bottom:1px solid var(--line);font-variant-numeric:tabular-nums}
th{color:var(--soft);font-weight:600}.n{text-align:right}.row{display:flex;flex-wrap:wrap;gap:1rem}figure{margin:.6rem 0;flex:1 1 430px;min-width:0;max-width:760px}
figure svg,figure img{max-width:100%;height:auto}figcaption{color:var(--soft);font-size:.9rem}
table.bars{width:100%;max-width:760px;margin:.4rem 0 1.2rem}table.bars caption{text-align:left;font-weight:600;padding-bottom:.2rem}
.bars th,.bars td{border:0;padding:.12rem .6rem .12rem 0}.bars th{width:13rem;font-weight:400}.bars td:nth-child(2){width:55%}.bars th,.bars td{white-space:nowrap}
.bars div{height:1rem;border-radius:2px}
pre{background:#f5f7f9;padding:.8rem;overflow-x:auto;font-size:.86rem}
@media(max-width:600px){table{display:block;overflow-x:auto}th,td{padding:.25rem .4rem}figure{flex-basis:100%}
.bars th,.bars td{white-space:normal}.bars th{width:7rem}.bars td:nth-child(2){width:40%}}
@media print{body{max-width:none;margin:0}h2{break-after:avoid}figure,tr,.callout{break-inside:avoid}.callout,div,svg{print-color-adjust:exact;-webkit-print-color-adjust:exact}})";

}  // namespace

Page::Page(std::string title, std::string subtitle)
    : title_{std::move(title)}, subtitle_{std::move(subtitle)} {}

void Page::heading(const std::string& text) { html("<h2>" + escaped(text) + "</h2>"); }
void Page::paragraph(const std::string& text) { html("<p>" + escaped(text) + "</p>"); }
void Page::callout(const std::string& text, const std::string& kind) {
  html("<div class=\"callout " + escaped(kind) + "\">" + escaped(text) + "</div>");
}
void Page::preformatted(const std::string& text) { html("<pre>" + escaped(text) + "</pre>"); }
void Page::html(const std::string& text) { parts_.push_back({text, {}, ""}); }

void Page::table(const std::vector<std::string>& header, const std::vector<std::vector<std::string>>& rows) {
  std::string out = "<table><thead><tr>";
  for (std::size_t c = 0; c < header.size(); ++c) {
    const bool right = !rows.empty() && c < rows.front().size() && numeric(rows.front()[c]);
    out += (right ? "<th class=\"n\">" : "<th>") + escaped(header[c]) + "</th>";
  }
  out += "</tr></thead><tbody>";
  for (const auto& row : rows) {
    out += "<tr>";
    for (const auto& cell : row)
      out += (numeric(cell) ? "<td class=\"n\">" : "<td>") + escaped(cell) + "</td>";
    out += "</tr>";
  }
  html(out + "</tbody></table>");
}

void Page::bars(const std::string& title, const std::vector<Bar>& bars) {
  double longest = 0.0;
  for (const auto& bar : bars) longest = std::max(longest, bar.value);
  std::string out = "<table class=\"bars\"><caption>" + escaped(title) + "</caption><tbody>";
  for (const auto& bar : bars) {
    const double share = longest > 0.0 ? 100.0 * std::max(0.0, bar.value) / longest : 0.0;
    out += "<tr><th>" + escaped(bar.label) +
           "</th><td><div style=\"width:" + number(std::max(0.3, share), 4) +
           "%;background:" + escaped(bar.colour) + "\"></div></td><td>" + escaped(bar.text) + "</td></tr>";
  }
  html(out + "</tbody></table>");
}

void Page::plot(Plot plot, const std::string& caption) { plots({std::move(plot)}, caption); }
void Page::plots(std::vector<Plot> plots, const std::string& caption) {
  parts_.push_back({"", std::move(plots), caption});
}

void Page::image(const std::vector<unsigned char>& bytes, const std::string& mime,
                 const std::string& caption) {
  html("<figure><img alt=\"" + escaped(caption) + "\" src=\"data:" + escaped(mime) + ";base64," +
       base64(bytes) + "\"><figcaption>" + escaped(caption) + "</figcaption></figure>");
}

std::string Page::text() const {
  std::vector<Plot> all;
  for (const Part& part : parts_) all.insert(all.end(), part.plots.begin(), part.plots.end());
  const auto drawings = draw(all);
  std::ostringstream out;
  out << "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
         "content=\"width=device-width\"><title>"
      << escaped(title_) << "</title><style>" << style << "</style></head><body><h1>" << escaped(title_)
      << "</h1>";
  if (!subtitle_.empty()) out << "<div class=\"sub\">" << escaped(subtitle_) << "</div>";
  std::size_t next = 0;
  for (const Part& part : parts_) {
    out << part.html;
    if (part.plots.empty()) continue;
    out << "<div class=\"row\">";
    for (std::size_t i = 0; i < part.plots.size(); ++i) out << "<figure>" << drawings[next++] << "</figure>";
    out << "</div>";
    if (!part.caption.empty()) out << "<figcaption>" << escaped(part.caption) << "</figcaption>";
  }
  out << "</body></html>\n";
  return out.str();
}

void Page::write(const std::filesystem::path& file) const { write_file(file, text()); }

void in_handy_units(Plot& plot) {
  const auto scale = [](std::string& label, const std::vector<std::vector<double>*>& all) {
    const auto begin = label.rfind('[');
    if (begin == std::string::npos || !label.ends_with(']')) return;
    const auto unit = label.substr(begin + 1, label.size() - begin - 2);
    if (unit == "s" || unit == "Hz") return;
    double most = 0.0;
    for (const auto* values : all)
      for (const double value : *values)
        if (std::isfinite(value)) most = std::max(most, std::abs(value));
    const auto prefix = prefix_of(most, unit);
    for (auto* values : all)
      for (double& value : *values) value /= prefix.factor;
    label.insert(begin + 1, prefix.name);
  };
  std::vector<std::vector<double>*> x, y;
  for (Series& series : plot.series) {
    x.push_back(&series.x);
    y.push_back(&series.y);
    if (series.style == Series::Style::band) y.push_back(&series.u);
  }
  scale(plot.x_label, x);
  scale(plot.y_label, y);
}

}  // namespace invar::report

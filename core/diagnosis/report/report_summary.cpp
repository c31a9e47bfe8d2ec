// The few lines for the terminal.
#include <algorithm>

#include "core/base/quantity.hpp"
#include "core/diagnosis/report/region.hpp"
#include "core/diagnosis/report/report.hpp"

namespace invar::diagnosis {

namespace {

/// Columns as wide as their widest cell.
std::string aligned(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows)
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (c >= widths.size()) widths.push_back(0);
      widths[c] = std::max(widths[c], row[c].size());
    }
  std::string out;
  for (const auto& row : rows) {
    std::string line = " ";
    for (std::size_t c = 0; c < row.size(); ++c) {
      line += " " + row[c];
      if (c + 1 < row.size()) line += std::string(widths[c] - row[c].size() + 1, ' ');
    }
    out += line + "\n";
  }
  return out;
}

void add_fit(std::vector<std::vector<std::string>>& rows, const std::string& title,
             const std::vector<FitRow>& fit) {
  rows.push_back({title, "before", "retuned", "after", "noise"});
  for (const auto& row : fit) {
    if (row.before == 0.0 && row.after == 0.0) continue;  // no more than a start value was recorded
    rows.push_back({row.signal, error_of(row.before, row), error_of(row.retuned, row),
                    error_of(row.after, row), si(row.noise_floor, row.unit)});
  }
}

}  // namespace

std::string summary(const Case& data, const Diagnosis& d) {
  std::string out = verdict_sentence(data, d) + "\n";
  if (const auto beside = beside_the_verdict(data, d); !beside.empty()) out += beside + "\n";
  for (const auto& run : d.other_runs)
    if (const auto worse = worse_on(d, run); !worse.empty()) out += worse + "\n";
  std::vector<std::vector<std::string>> rows;
  if (!d.findings.empty()) rows.push_back({"missing", "where", "how sure", "size"});
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    const auto& finding = d.findings[i];
    rows.push_back({title_of(finding), where_of(data, d, i), number(100.0 * finding.probability) + " %",
                    sizes_of(data, d, finding)});
  }
  out += aligned(rows);
  rows.clear();
  add_fit(rows, "error held out", d.heldout);
  for (const auto& run : d.other_runs) add_fit(rows, "in " + run.name, run.fit);
  for (const auto& assumed : d.assumed)
    add_fit(rows, readable(assumed.finding.term.info->name) + " assumed", assumed.heldout);
  out += aligned(rows);
  for (const auto& [finding, heldout] : d.assumed)
    out += "  assumed: " + readable(finding.term.info->name) + ", " + place_of(data, finding.term) + ": " +
           sizes_of(data, d, finding) + "\n";
  std::string considered;
  for (std::size_t i = 0; i < d.rejected.size() && i < 5; ++i)
    considered += "    " + d.rejected[i].term + ": " + d.rejected[i].why + "\n";
  if (const auto read = rows_read(data.count); read.find(';') != std::string::npos) out += "  " + read + "\n";
  if (const auto part = what_was_looked_at(data); !part.empty()) out += "  " + part + "\n";
  for (const auto& run : d.other_runs) {
    if (!run.how_windowed.empty()) out += "  in " + run.name + ": " + run.how_windowed + "\n";
    if (const auto left_out = left_out_of(data, d, run); !left_out.empty()) out += "  " + left_out + "\n";
  }
  if (!d.not_tried.empty()) out += "  " + not_tried(d) + "\n";
  if (!considered.empty()) out += "  not claimed:\n" + considered;
  return out + "  next: " + next_experiment(data, d) + "\n";
}

}  // namespace invar::diagnosis

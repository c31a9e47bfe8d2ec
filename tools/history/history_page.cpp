#include "tools/history/history_page.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace invar::tools {

namespace {

using report::number;
using report::si;

constexpr double day = 86400.0;
constexpr std::size_t most_plots = 6;

std::string shown(double value, const std::string& unit) { return si(value, unit.empty() ? "1" : unit); }

/// Names by how many sigmas they moved, the farthest first.
std::vector<const NameHistory*> by_movement(const std::vector<NameHistory>& names) {
  std::vector<const NameHistory*> order;
  for (const auto& name : names) order.push_back(&name);
  std::stable_sort(order.begin(), order.end(), [](const NameHistory* a, const NameHistory* b) {
    const double x = times_sigma(*a), y = times_sigma(*b);
    return (std::isnan(x) ? -1.0 : x) > (std::isnan(y) ? -1.0 : y);
  });
  return order;
}

/// The number of a name that moved farthest, less its first value, over time with its band.
report::Plot plot_of(const KindHistory& kind, const NameHistory& name) {
  const NumberHistory& one = name.numbers[name.farthest];
  report::Plot plot;
  plot.title = name.name + (one.last.place.empty() ? "" : " at " + one.last.place);
  plot.x_label = "days since " + time_text(kind.calibrations.front().time);
  plot.y_label = "moved [" + (name.unit.empty() ? "1" : name.unit) + "]";
  report::Series band, line;
  band.style = report::Series::Style::band;
  band.label = "two sigma";
  line.label = "calibrations";
  band.colour = line.colour = "#1f6fb4";
  for (std::size_t i = 0; i < one.values.size(); ++i) {
    const double t = (kind.calibrations[i].time - kind.calibrations.front().time) / day;
    const double moved = one.values[i] - one.values.front();
    const double sigma = std::isfinite(one.sigmas[i]) ? one.sigmas[i] : 0.0;
    line.x.push_back(t), line.y.push_back(moved);
    band.x.push_back(t), band.y.push_back(moved - 2.0 * sigma), band.u.push_back(moved + 2.0 * sigma);
  }
  report::Series points = line;
  points.label = "";
  points.style = report::Series::Style::points;
  plot.series = {std::move(band), std::move(line), std::move(points)};
  report::in_handy_units(plot);
  return plot;
}

void add_kind(report::Page& page, const KindHistory& kind) {
  page.heading("Calibration " + kind.kind + ": " + std::to_string(kind.calibrations.size()));
  std::vector<std::vector<std::string>> rows;
  for (const auto& one : kind.calibrations)
    rows.push_back({time_text(one.time), one.time_from, one.file.parent_path().string()});
  page.table({"made (UTC)", "by", "folder"}, rows);
  if (kind.calibrations.size() < 2) {
    page.callout("One calibration only: what moves cannot be told.", "plain");
    return;
  }
  page.callout(due_words(kind), kind.due.known && kind.due.after <= 0.0 ? "bad" : "plain");
  rows.clear();
  std::vector<report::Plot> plots;
  for (const NameHistory* name : by_movement(kind.names)) {
    const NumberHistory& one = name->numbers[name->farthest];
    rows.push_back({name->name, one.last.place, shown(one.values.front(), name->unit),
                    shown(one.values.back(), name->unit), shown(one.moved, name->unit),
                    std::isnan(one.sigma) ? "not known" : shown(one.sigma, name->unit),
                    number(times_sigma(*name)), shown(name->moved_rms, name->unit),
                    verdict_words(name->verdict)});
    if (plots.size() < most_plots && name->verdict != NameHistory::Verdict::still)
      plots.push_back(plot_of(kind, *name));
  }
  page.paragraph(
      "The place of each name at which it moved by most of its sigma, from the first calibration to the "
      "last.");
  page.table({"what", "where", "first", "last", "moved", "sigma", "times sigma", "moved, RMS over its places",
              "verdict"},
             rows);
  page.plots(std::move(plots), "The value that moved most, less its first value.");
}

}  // namespace

double times_sigma(const NameHistory& name) {
  const NumberHistory& one = name.numbers[name.farthest];
  return one.sigma > 0.0 ? std::abs(one.moved) / one.sigma : std::numeric_limits<double>::quiet_NaN();
}

std::string verdict_words(NameHistory::Verdict verdict) {
  switch (verdict) {
    case NameHistory::Verdict::moved:
      return "moved";
    case NameHistory::Verdict::more_than_sigma:
      return "by more than its sigma, as chance alone does";
    case NameHistory::Verdict::still:
      return "within its sigma";
    case NameHistory::Verdict::not_known:
      return "no sigma is known";
  }
  return {};
}

std::string due_words(const KindHistory& history) {
  if (!history.accuracy) return "No accuracy is wanted: when the next calibration is due is not asked.";
  const auto errors =
      std::find_if(history.names.begin(), history.names.end(), [](const auto& n) { return n.is_error; });
  if (errors == history.names.end())
    return "This kind has no error of the machine that an accuracy could be wanted of.";
  if (!history.due.known) return "One calibration does not tell when the next is due.";
  const std::string accuracy = shown(*history.accuracy, errors->unit);
  if (history.due.after <= 0.0)
    return "Due now: the last calibration leaves the " + history.due.by + " known to " +
           shown(history.due.left, errors->unit) + " (two sigma), more than the wanted " + accuracy + ".";
  if (!std::isfinite(history.due.after))
    return "Not due: nothing moved, and the last calibration is known to " +
           shown(history.due.left, errors->unit) + " (two sigma).";
  const double last = history.calibrations.back().time;
  std::string text = "Due " + time_text(last + history.due.after) + ", " +
                     number(history.due.after / day, 3) + " days after the last: then the " + history.due.by +
                     " reaches " + accuracy + " (two sigma).";
  const double seen = last - history.calibrations.front().time;
  if (history.due.after > seen)
    text += " That is beyond the " + number(seen / day, 3) + " days that were seen: an extrapolation.";
  if (history.calibrations.size() < 4)
    text += " From " + std::to_string(history.calibrations.size()) + " calibrations the rate is known badly.";
  return text;
}

report::Page history_page(const std::string& folder, const std::vector<KindHistory>& kinds,
                          const report::LeftOut& left_out) {
  std::size_t count = 0;
  for (const auto& kind : kinds) count += kind.calibrations.size();
  report::Page page{"History of calibrations", folder + ", " + std::to_string(count) + " calibrations"};
  for (const auto& kind : kinds) add_kind(page, kind);
  report::show(page, left_out);
  return page;
}

nlohmann::json history_json(const std::vector<KindHistory>& kinds, const report::LeftOut& left_out) {
  nlohmann::json json{
      {"kind", "history"}, {"kinds", nlohmann::json::array()}, {"rows", report::json_of(left_out)}};
  for (const auto& kind : kinds) {
    nlohmann::json one{
        {"kind", kind.kind}, {"calibrations", nlohmann::json::array()}, {"names", nlohmann::json::array()}};
    for (const auto& calibration : kind.calibrations)
      one["calibrations"].push_back({{"file", calibration.file.string()},
                                     {"made", time_text(calibration.time)},
                                     {"made_s", calibration.time},
                                     {"by", calibration.time_from}});
    for (const NameHistory* name : by_movement(kind.names)) {
      const NumberHistory& number = name->numbers[name->farthest];
      nlohmann::json entry{{"name", name->name},
                           {"unit", name->unit},
                           {"where", number.last.place},
                           {"values", number.values},
                           {"moved", number.moved},
                           {"moved_rms", name->moved_rms},
                           {"rate_per_day", number.rate * day},
                           {"verdict", verdict_words(name->verdict)},
                           {"has_moved", name->verdict == NameHistory::Verdict::moved}};
      if (number.sigma > 0.0) entry["sigma"] = number.sigma, entry["times_sigma"] = times_sigma(*name);
      one["names"].push_back(std::move(entry));
    }
    if (kind.accuracy) {
      one["due"] = {{"accuracy", *kind.accuracy}, {"known", kind.due.known}, {"words", due_words(kind)}};
      if (kind.due.known && std::isfinite(kind.due.after)) {
        one["due"]["days_after_last"] = kind.due.after / day;
        one["due"]["at"] = time_text(kind.calibrations.back().time + kind.due.after);
        one["due"]["by"] = kind.due.by;
      }
    }
    json["kinds"].push_back(std::move(one));
  }
  return json;
}

}  // namespace invar::tools

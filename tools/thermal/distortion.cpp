#include "tools/thermal/distortion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <ostream>
#include <utility>

namespace invar::tools {

namespace {

using report::number;
using report::si;

constexpr double hour = 3600.0;
constexpr double distortion_cell = 1e-5;  // m, readings nearer than this are of one place
constexpr double throughout = 0.8;        // of the recording between first and last reading of a place
constexpr std::size_t enough = 5;         // readings of a place
constexpr double not_identified = std::numeric_limits<double>::quiet_NaN();

double range_of(const std::vector<double>& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return *high - *low;
}

/// Values up to an hour after the start; NaN where the recording ends before, or has fewer than three there.
double range_of_first_hour(const std::vector<double>& time, const std::vector<double>& values,
                           double duration) {
  if (duration < hour) return not_identified;
  const auto end = std::upper_bound(time.begin(), time.end(), hour);
  const auto count = end - time.begin();
  return count < 3 ? not_identified : range_of({values.begin(), values.begin() + count});
}

/// Linear between readings, held at the ends.
double at_time(const DistortionAtPlace& place, double time) {
  const auto next = std::lower_bound(place.time.begin(), place.time.end(), time);
  if (next == place.time.begin()) return place.error.front();
  if (next == place.time.end()) return place.error.back();
  const auto i = static_cast<std::size_t>(next - place.time.begin());
  const double width = place.time[i] - place.time[i - 1];
  const double part = width > 0.0 ? (time - place.time[i - 1]) / width : 1.0;
  return place.error[i - 1] + part * (place.error[i] - place.error[i - 1]);
}

/// Places in order that were read throughout, each direction apart.
std::vector<DistortionAtPlace> all_places(const metrology::ThermalReadings& readings,
                                          const Eigen::VectorXd& kept, double duration) {
  std::map<std::pair<long, int>, DistortionAtPlace> all;
  const Eigen::VectorXd& time = *readings.time;
  for (Eigen::Index i = 0; i < time.size(); ++i) {
    if (kept(i) <= 0.0) continue;
    const int way = !readings.direction ? 0 : ((*readings.direction)(i) < 0.0 ? -1 : 1);
    DistortionAtPlace& one = all[{std::lround(readings.x(i) / distortion_cell), way}];
    one.x = readings.x(i);
    one.direction = way;
    one.time.push_back(time(i) - time(0));
    one.error.push_back(readings.error(i));
  }
  std::vector<DistortionAtPlace> result;
  for (auto& [key, one] : all) {
    if (one.time.size() < enough || one.time.back() - one.time.front() < throughout * duration) continue;
    one.readings = one.time.size();
    one.whole = range_of(one.error);
    one.first_hour = range_of_first_hour(one.time, one.error, duration);
    one.end = one.error.back() - one.error.front();
    result.push_back(std::move(one));
  }
  return result;
}

/// Of the second place less the first, at the times of the second, in a direction that both have.
void tell_growth(Distortion& distortion) {
  distortion.growth = distortion.growth_first_hour = not_identified;
  if (distortion.places.empty()) return;
  const DistortionAtPlace& first = distortion.places.front();
  for (const DistortionAtPlace& last : distortion.places) {
    if (last.x - first.x < distortion_cell || last.direction != first.direction) continue;
    std::vector<double> difference;
    for (std::size_t i = 0; i < last.time.size(); ++i)
      difference.push_back(last.error[i] - at_time(first, last.time[i]));
    distortion.growth = range_of(difference);
    distortion.growth_first_hour = range_of_first_hour(last.time, difference, distortion.duration);
  }
}

std::string place_words(const DistortionAtPlace& place) {
  return "x = " + si(place.x, "m", 4) +
         (place.direction == 0  ? ""
          : place.direction > 0 ? ", forward"
                                : ", backward");
}

std::string shown(double value) { return std::isnan(value) ? "-" : si(value, "m"); }

nlohmann::json value_of(double value) { return std::isnan(value) ? nlohmann::json{} : nlohmann::json(value); }

}  // namespace

Distortion distortion_of(const metrology::ThermalReadings& readings, const metrology::ThermalFit& fit) {
  Distortion result;
  result.growth = result.growth_first_hour = not_identified;
  if (!readings.time || readings.time->size() < 2) return result;
  result.duration = (*readings.time)(readings.time->size() - 1) - (*readings.time)(0);
  if (!(result.duration > 0.0)) return result;
  result.temperature = readings.temperature.maxCoeff() - readings.temperature.minCoeff();
  result.uncertainty = 2.0 * std::sqrt(2.0) * fit.model.noise;
  result.places = all_places(readings, fit.kept, result.duration);
  if (!result.places.empty()) {
    const double low = result.places.front().x, high = result.places.back().x;
    std::erase_if(result.places, [&](const DistortionAtPlace& one) {
      return std::abs(one.x - low) > distortion_cell && std::abs(one.x - high) > distortion_cell;
    });
  }
  tell_growth(result);
  return result;
}

nlohmann::json json_of(const Distortion& distortion) {
  nlohmann::json json{{"form", "ISO 230-3"},
                      {"duration_s", distortion.duration},
                      {"temperature_range_K", distortion.temperature},
                      {"expanded_uncertainty_m", distortion.uncertainty},
                      {"growth_between_places_60min_m", value_of(distortion.growth_first_hour)},
                      {"growth_between_places_m", value_of(distortion.growth)},
                      {"places", nlohmann::json::array()}};
  for (const auto& one : distortion.places)
    json["places"].push_back({{"x_m", one.x},
                              {"direction", one.direction},
                              {"readings", one.readings},
                              {"range_60min_m", value_of(one.first_hour)},
                              {"range_m", one.whole},
                              {"end_minus_start_m", one.end}});
  return json;
}

void show(report::Page& page, const Distortion& distortion) {
  if (distortion.places.empty()) return;
  page.heading("Distortion over time");
  page.paragraph("Ranges in the form of ISO 230-3, before any compensation, over " +
                 number(distortion.duration / 60.0, 3) + " min in which the temperature moved by " +
                 number(distortion.temperature, 3) +
                 " K. The recording does not say what warmed the machine. The figures are those of the "
                 "standard's test for moving linear "
                 "axes only if the axis moved by that test's cycle. With the machine at rest they are an "
                 "environmental variation "
                 "(ETVE); with the spindle running, the spindle's.");
  std::vector<std::vector<std::string>> rows;
  report::Plot plot;
  plot.title = "Error at places that were read again and again";
  plot.x_label = "time [min]";
  plot.y_label = "error [um]";
  for (const auto& one : distortion.places) {
    rows.push_back({place_words(one), std::to_string(one.readings), shown(one.first_hour), shown(one.whole),
                    shown(one.end)});
    report::Series line;
    line.label = place_words(one);
    for (std::size_t i = 0; i < one.time.size(); ++i) {
      line.x.push_back(one.time[i] / 60.0);
      line.y.push_back(1e6 * one.error[i]);
    }
    plot.series.push_back(std::move(line));
  }
  if (!std::isnan(distortion.growth))
    rows.push_back(
        {"difference of the places", "", shown(distortion.growth_first_hour), shown(distortion.growth), ""});
  page.table({"place", "readings", "range in the first 60 min", "range over the recording", "end less start"},
             rows);
  page.plot(std::move(plot), "A range has an expanded uncertainty (k = 2) of " +
                                 si(distortion.uncertainty, "m") + " by the noise of two readings." +
                                 (distortion.duration < hour
                                      ? " The recording is shorter than 60 min, so the first column is empty."
                                      : ""));
}

void print(const Distortion& distortion, std::ostream& out) {
  for (const auto& one : distortion.places)
    out << "distortion over time (form of ISO 230-3) at " << place_words(one) << ": range "
        << (std::isnan(one.first_hour) ? "" : si(one.first_hour, "m") + " in the first 60 min, ")
        << si(one.whole, "m") << " over " << number(distortion.duration / 60.0, 3) << " min\n";
}

}  // namespace invar::tools

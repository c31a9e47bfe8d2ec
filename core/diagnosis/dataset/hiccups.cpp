#include "core/diagnosis/dataset/hiccups.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/diagnosis/dataset/statistics.hpp"

namespace invar::diagnosis {

namespace {

/// A late instrument reads at first what was before the recording, and nobody knows that.
void leave_out_unknown_past(const physics::Model& model, physics::Record& record) {
  for (const auto& term : model.terms) {
    const auto delay = term.info->index_of("delay");
    const auto found = record.signals.find(term.on);
    if (delay >= term.info->parameter_count() || found == record.signals.end()) continue;
    constexpr std::size_t about = 2;  // rows: of the central difference
    std::size_t until = 0;
    while (until < record.rows() && record.time[until] < record.time.front() + term.values[delay]) ++until;
    if (until == 0 || until + about + 8 > record.rows()) continue;
    std::fill_n(found->second.begin(), until + about, std::numeric_limits<double>::quiet_NaN());
  }
}

}  // namespace

void leave_out_hiccups(const physics::Model& model, physics::Record& record, const std::string& file,
                       std::vector<std::string>& doubts) {
  constexpr double even = 0.2, too_fast = 0.7;  // of the usual step; a lost row makes none shorter
  constexpr double mostly = 0.9;                // of the steps are even, else there is no usual one
  constexpr std::size_t before = 3,
                        behind = 6;  // rows: of the central difference, and of an instrument that is late
  const auto found = record.signals.find("velocity_sensor");
  if (model.plant == physics::Plant::sensor) leave_out_unknown_past(model, record);
  if (model.plant != physics::Plant::sensor || found == record.signals.end() || record.rows() < 20) return;
  std::vector<double> steps;
  for (std::size_t i = 1; i < record.rows(); ++i) steps.push_back(record.time[i] - record.time[i - 1]);
  const double usual = median(steps);
  const auto are_even = std::count_if(steps.begin(), steps.end(),
                                      [&](double step) { return std::abs(step - usual) < even * usual; });
  if (static_cast<double>(are_even) < mostly * static_cast<double>(steps.size())) return;
  std::size_t stamps = 0, readings = 0;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    if (!(steps[k] < too_fast * usual)) continue;
    ++stamps;
    for (std::size_t i = k - std::min(k, before); i < std::min(record.rows(), k + behind); ++i) {
      auto& value = found->second[i];
      readings += std::isfinite(value) ? 1U : 0U;
      value = std::numeric_limits<double>::quiet_NaN();
    }
  }
  if (readings == 0) return;
  doubts.push_back(file + ": " + std::to_string(stamps) +
                   " stamps follow the one before in less than seven tenths of a step; " +
                   std::to_string(readings) + " readings of velocity_sensor about them are left out");
}

}  // namespace invar::diagnosis

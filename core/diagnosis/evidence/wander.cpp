#include "core/diagnosis/evidence/wander.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

/// The whitened residual of one output, recording by recording; NaN where nothing was measured.
std::vector<std::vector<double>> series_of(const Case& data, const Weighing& weighing,
                                           const Eigen::VectorXd& residual, std::size_t output) {
  std::vector<std::vector<double>> series;
  Eigen::Index at = 0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      const std::size_t rows = data.recordings[r].inputs.rows();
      if (o == output) {
        auto& one = series.emplace_back(rows);
        for (std::size_t i = 0; i < rows; ++i)
          one[i] = weighing.present[r][o][i] ? residual(at + static_cast<Eigen::Index>(i))
                                             : std::numeric_limits<double>::quiet_NaN();
      }
      at += static_cast<Eigen::Index>(rows);
    }
  return series;
}

}  // namespace

// Kalman's filter; the scale is the likeliest.
double likelihood(const std::vector<std::vector<double>>& series, const Wander& wander) {
  const double kept = std::exp(-1.0 / wander.rows);
  double squares = 0.0, logs = 0.0, count = 0.0;
  for (const auto& one : series) {
    double state = 0.0, variance = wander.driven / (1.0 - kept * kept);
    for (const double v : one) {
      if (std::isfinite(v)) {
        const double spread = variance + 1.0, apart = v - state;
        squares += apart * apart / spread, logs += std::log(spread), count += 1.0;
        state += variance / spread * apart;
        variance /= spread;
      }
      state *= kept;
      variance = kept * kept * variance + wander.driven;
    }
  }
  return count > 0.0 && squares > 0.0 ? -0.5 * (count * std::log(squares / count) + logs) : 0.0;
}

Wander wander_of(const std::vector<std::vector<double>>& series, bool is_instrument) {
  std::size_t longest = 0;
  for (const auto& one : series) longest = std::max(longest, one.size());
  // White noise alone seems to wander by a nat or two, the best of many tried. What many rows do not show, however long it
  // could last, hides nothing in a reading; a few hundred would not show it.
  std::size_t rows = 0;
  for (const auto& one : series) rows += one.size();
  const double by_chance = is_instrument && rows >= thresholds::rows_that_show_wander ? 3.0 : 0.0;
  Wander best;
  double most = likelihood(series, best) + by_chance;
  for (double memory = 8.0; memory < 4.0 * static_cast<double>(longest); memory *= 4.0) {
    double before = -std::numeric_limits<double>::infinity();
    for (double gain = 1e-3; gain < 0.7;
         gain *= 2.0) {  // by which a reading moves the estimate in the long run
      const double steady = gain / (1.0 - gain);
      const Wander tried{memory, steady - std::exp(-2.0 / memory) * steady * (1.0 - gain)};
      const double now = likelihood(series, tried);
      if (now > most) most = now, best = tried;
      if (now < before - 2.0) break;  // one hill
      before = now;
    }
  }
  return best;
}

double advantage_over_wander(const Case& data, const Weighing& weighing, const Fit& one, const Fit& other) {
  const double evidence = one.evidence - other.evidence;
  // What wanders louder than all that is left asks for a cause.
  if (!data.is_time_series || least_ratio(data, one, other) < 0.7) return evidence;
  const double prices = (one.evidence + one.data_cost) - (other.evidence + other.data_cost);
  double likelier = 0.0;
  bool any = false;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto with = series_of(data, weighing, one.residual, o),
               without = series_of(data, weighing, other.residual, o);
    const auto wander = wander_of(with, data.model.plant == physics::Plant::sensor);
    any = any || wander.driven > 0.0;
    double least = std::numeric_limits<double>::infinity();
    for (const double longer : {1.0, 4.0, 16.0}) {
      const Wander tried{longer * wander.rows, wander.driven};
      least = std::min(least, likelihood(with, tried) - likelihood(without, tried));
    }
    likelier += least;
  }
  return any ? weighing.temper * likelier + prices : evidence;
}

}  // namespace invar::diagnosis

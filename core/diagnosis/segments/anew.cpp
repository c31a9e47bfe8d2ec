#include "core/diagnosis/segments/anew.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/dataset/statistics.hpp"

namespace invar::diagnosis {

namespace {

/// No input is known between these two rows.
struct Gap {
  std::size_t before = 0, behind = 0;
};

/// Fewer rows say too little about states of their own.
constexpr std::size_t fewest_rows = 60;
/// Twice the log likelihood that what happened in a gap may cost in all before it matters.
constexpr double matters = 4.0;

/// The rows at which everything that drives the model was recorded.
std::vector<std::size_t> known_rows(const physics::Model& model, const physics::Record& inputs) {
  std::vector<std::string> drives;
  for (const auto& input : model.equations.inputs) drives.push_back(input.signal);
  if (model.plant == physics::Plant::axis) drives = {"current"};
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < inputs.rows(); ++i)
    if (std::all_of(drives.begin(), drives.end(), [&](const auto& signal) {
          const auto* values = inputs.find(signal);
          return values == nullptr || std::isfinite((*values)[i]);
        }))
      rows.push_back(i);
  return rows;
}

/// The longest gaps, in order of time. Rows that come unevenly have none: there a long step is nothing special.
std::vector<Gap> gaps_of(const physics::Model& model, const physics::Record& inputs) {
  constexpr std::size_t most = 20;
  const auto known = known_rows(model, inputs);
  const auto step = [&](const Gap& gap) { return inputs.time[gap.behind] - inputs.time[gap.before]; };
  std::vector<Gap> gaps;
  std::vector<double> steps;
  for (std::size_t k = 1; k < known.size(); ++k) {
    gaps.push_back({known[k - 1], known[k]});
    steps.push_back(step(gaps.back()));
  }
  if (steps.size() < fewest_rows) return {};
  std::sort(steps.begin(), steps.end());
  const double usual = steps[steps.size() * 19 / 20];
  std::erase_if(gaps, [&](const Gap& gap) { return !(step(gap) > 2.5 * usual); });
  std::stable_sort(gaps.begin(), gaps.end(), [&](const Gap& a, const Gap& b) { return step(a) > step(b); });
  if (gaps.size() > most) gaps.resize(most);
  std::sort(gaps.begin(), gaps.end(), [](const Gap& a, const Gap& b) { return a.before < b.before; });
  return gaps;
}

/// The inputs as they would have been, had they gone on in the gap as behind it (or before it), mirrored there.
physics::Record mirrored(const physics::Record& inputs, const Gap& gap, bool behind) {
  constexpr double finest = 500.0;
  const auto& time = inputs.time;
  const double from = time[gap.before], to = time[gap.behind];
  const double usual = (time.back() - time.front()) / static_cast<double>(time.size());
  const double step = std::max(usual, (to - from) / finest);
  std::vector<std::size_t> rows;  // of which the values are taken
  physics::Record whole;
  const auto add = [&](double t, std::size_t row) { whole.time.push_back(t), rows.push_back(row); };
  for (std::size_t i = 0; i <= gap.before; ++i) add(time[i], i);
  for (double t = from + 0.5 * step; t < to; t += step) {
    const double image = 2.0 * (behind ? to : from) - t;
    const auto at = std::upper_bound(time.begin(), time.end(), image) - time.begin();
    add(t, static_cast<std::size_t>(std::max<std::ptrdiff_t>(1, at) - 1));
  }
  for (std::size_t i = gap.behind; i < time.size(); ++i) add(time[i], i);
  for (const auto& [name, values] : inputs.signals) {
    const auto known = physics::bridged(time, values);
    auto& column = whole.signals[name];
    for (const std::size_t row : rows) column.push_back(known[row]);
  }
  return whole;
}

/// By output, the least that a reading is off.
std::vector<double> noise_of(const Case& data, const Recording& recording) {
  std::vector<double> all;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    double low = 1e300, high = -1e300;
    for (const double v : recording.measured[o])
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
    double noise = spread_of_differences(recording.measured[o]);
    if (std::isfinite(data.given_noise[o])) noise = std::min(noise, data.given_noise[o]);
    all.push_back(std::max(noise, 1e-3 * (high - low)));
  }
  return all;
}

/// From each row on to the end: the sum of squares, over the noise, of what the gap may have changed in the outputs.
std::vector<double> left_of(const Case& data, const Recording& recording, const physics::Outputs& as_held,
                            const std::vector<double>& noise, const Gap& gap) {
  const std::size_t n = recording.inputs.rows();
  std::vector<double> squares(n + 1, 0.0);
  for (const bool behind : {true, false}) {
    const auto inputs = mirrored(recording.inputs, gap, behind);
    physics::Outputs other;
    physics::prepare(data.model, inputs)->run(data.model, other);
    for (std::size_t i = gap.behind; i < n; ++i) {
      double sum = 0.0;
      for (std::size_t o = 0; o < other.size(); ++o) {
        if (!std::isfinite(recording.measured[o][i])) continue;
        const double changed = (other[o][i + inputs.rows() - n] - as_held[o][i]) / noise[o];
        sum += std::isfinite(changed) ? std::min(changed * changed, 1e12) : 1e12;
      }
      squares[i] = std::max(squares[i], sum);
    }
  }
  for (std::size_t i = n; i-- > 0;) squares[i] += squares[i + 1];
  return squares;
}

/// Takes rows out of what is compared.
void leave_out(Case& data, Recording& recording, std::size_t from, std::size_t to) {
  for (auto& measured : recording.measured)
    std::fill(measured.begin() + static_cast<std::ptrdiff_t>(from),
              measured.begin() + static_cast<std::ptrdiff_t>(to), std::nan(""));
  data.windows.forgetting += to - from;
}

/// The rows behind gaps from which on a recording begins anew; what is soon forgotten is taken out of what is compared.
std::vector<std::size_t> behind_gaps(Case& data, Recording& recording, std::size_t most) {
  const std::size_t n = recording.inputs.rows();
  const auto gaps = gaps_of(data.model, recording.inputs);
  std::vector<std::size_t> rows;
  if (gaps.empty()) return rows;
  const auto noise = noise_of(data, recording);
  physics::Outputs as_held;
  recording.simulation->run(data.model, as_held);
  const std::size_t soon = std::max(fewest_rows, n / 50);
  bool is_lost = false;  // since a gap before
  for (std::size_t k = 0; k < gaps.size(); ++k) {
    const std::size_t row = gaps[k].behind, next = k + 1 < gaps.size() ? gaps[k + 1].before + 1 : n;
    leave_out(data, recording, gaps[k].before + 1, row);
    const auto left = left_of(data, recording, as_held, noise, gaps[k]);
    if (!is_lost && left[row] < matters) continue;
    std::size_t until = row;
    while (until < n && left[until] >= matters) ++until;
    const bool is_soon = !is_lost && until - row <= soon;
    is_lost = !is_soon && next - row < fewest_rows;
    if (!is_soon && !is_lost) {
      if (rows.size() < most) rows.push_back(row);
      continue;
    }
    leave_out(data, recording, row, is_lost ? next : until);
  }
  return rows;
}

}  // namespace

bool starts_elsewhere(const Case& data, const Recording& recording) {
  const auto noise = noise_of(data, recording);
  const auto& equations = data.model.equations;
  for (std::size_t o = 0; o < equations.outputs.size(); ++o)
    for (const auto& state : equations.states) {
      const auto& y = recording.measured[o];
      if (equations.outputs[o].expression != state.name || y.size() < 3) continue;
      const double first = median({y[0], y[1], y[2]});
      if (std::abs(first - data.model.value(state.name + ".initial")) > 6.0 * noise[o]) return true;
    }
  return false;
}

std::vector<std::vector<std::size_t>> axis_begun_anew(Case& data) {
  std::vector<std::vector<std::size_t>> all;
  for (auto& recording : data.recordings) {
    auto& rows = all.emplace_back(1, 0);
    for (const auto& gap : gaps_of(data.model, recording.inputs)) {
      const bool is_short = gap.before + 1 < rows.back() + fewest_rows;  // too few rows to find states by
      leave_out(data, recording, is_short ? rows.back() : gap.before + 1, gap.behind);
      if (is_short && rows.size() > 1) rows.pop_back();
      rows.push_back(gap.behind);
    }
    data.windows.anew += rows.size() - 1;
  }
  return all;
}

std::vector<std::vector<std::size_t>> begun_anew(Case& data, std::size_t most) {
  const auto& equations = data.model.equations;
  const bool are_known =
      std::all_of(equations.states.begin(), equations.states.end(), [&](const auto& state) {
        const auto& sigma = data.model.find(state.name + ".initial")->sigma;
        return sigma && *sigma == 0.0;
      });
  std::vector<std::vector<std::size_t>> all;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    auto& rows = all.emplace_back();
    auto& recording = data.recordings[r];
    if (r > 0 && most > 0 && (!are_known || starts_elsewhere(data, recording))) rows.push_back(0), --most;
    for (const std::size_t row : behind_gaps(data, recording, most)) rows.push_back(row), --most;
  }
  return all;
}

}  // namespace invar::diagnosis

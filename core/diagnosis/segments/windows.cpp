#include "core/diagnosis/segments/windows.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/segments/anew.hpp"

namespace invar::diagnosis {

physics::Model showing_states(const physics::Model& model) {
  auto shown = model;
  shown.equations.outputs.clear();
  std::erase_if(shown.signals, [](const auto& signal) { return signal.is_output; });
  for (const auto& state : model.equations.states) {
    shown.equations.outputs.push_back({state.name, state.name, {}});
    shown.signals.push_back({state.name, state.name, "", true});
  }
  return shown;
}

namespace {

using physics::Model;

/// Fewer rows say too little about states of their own. Short windows keep a wrong model near the machine, where first order
/// says what it lacks; but each costs a fit as many numbers as there are states.
constexpr std::size_t fewest_rows_of_window = 60, most_starts = 200;
/// Where windows only lead the numbers near, longer ones tell more of them.
constexpr std::size_t most_starts_of_a_hint = 100;
/// A window is at most as long as a disturbance of its first state takes to grow so much.
constexpr double most_growth = 30.0;
/// As many windows where a disturbance grows no faster than the sum of a sum does.
constexpr std::size_t long_windows = 6;
constexpr double sum_growth = 6.0;
/// What integrates goes on by this factor from the middle to the end of a recording.
constexpr double still_going = 1.6;

double reach(const std::vector<double>& values, double begin, double end) {
  const auto n = static_cast<double>(values.size());
  double most = 0.0;
  for (auto i = static_cast<std::size_t>(begin * n); i < static_cast<std::size_t>(end * n); ++i)
    most = std::isfinite(values[i]) ? std::max(most, std::abs(values[i])) : 1e300;
  return most;
}

/// Slope and value of what was measured about a row, from the rows around it.
std::pair<double, double> measured_at(const Recording& recording, std::size_t output, std::size_t row) {
  const auto& time = recording.inputs.time;
  const auto& y = recording.measured[output];
  for (std::size_t about = 4; about < 64; about *= 2) {
    double n = 0.0, st = 0.0, sy = 0.0, stt = 0.0, sty = 0.0;
    for (std::size_t i = row - std::min(row, about); i < std::min(y.size(), row + about + 1); ++i) {
      if (!std::isfinite(y[i])) continue;
      const double t = time[i] - time[row];
      n += 1.0, st += t, sy += y[i], stt += t * t, sty += t * y[i];
    }
    if (n < 5.0) continue;
    const double slope = (n * sty - st * sy) / (n * stt - st * st);
    return {(sy - slope * st) / n, slope};
  }
  return {std::nan(""), std::nan("")};
}

/// What the model says of a state at the beginning of a recording.
physics::Parameter initial_of(const Model& model, const std::string& state) {
  const auto* given = model.find(state + ".initial");
  return given != nullptr ? *given : physics::Parameter{state + ".initial", "", 0.0, {}, {}};
}

/// What the outputs say of a state at a row: itself, or the rate of one whose rate it is; else what the free run has.
double guess_of(const Case& data, const Recording& recording, const physics::Outputs& free, std::size_t state,
                std::size_t row) {
  const auto& equations = data.model.equations;
  if (equations.states.empty()) {  // an axis: position, velocity
    const auto [position, velocity] = measured_at(recording, 0, row);
    const double value = state == 0 ? position : velocity;
    return std::isfinite(value) ? value : 0.0;
  }
  for (const auto& output : equations.outputs) {
    const auto o = static_cast<std::size_t>(&output - equations.outputs.data());
    if (output.expression == equations.states[state].name) {
      if (const double value = measured_at(recording, o, row).first; std::isfinite(value)) return value;
    }
    for (const auto& other : equations.states)
      if (output.expression == other.name && other.derivative == equations.states[state].name)
        if (const double slope = measured_at(recording, o, row).second; std::isfinite(slope)) return slope;
  }
  const double value = free[state][row];
  return std::isfinite(value) && std::abs(value) < 1e6
             ? value
             : data.model.value(equations.states[state].name + ".initial");
}

/// The model from where the recording begins: a pendulum that hangs at rest forgets what one that goes over the top does not.
Model begun_as_recorded(const Case& data, const Model& near, const Recording& recording) {
  Model model = near;
  if (!starts_elsewhere(data, recording)) return model;
  const auto& states = model.equations.states;
  physics::Outputs free(states.size());
  const auto shown = showing_states(model);
  physics::prepare(shown, recording.inputs)->run(shown, free);
  for (std::size_t i = 0; i < states.size(); ++i)
    for (auto& parameter : model.parameters)
      if (parameter.name == states[i].name + ".initial" && parameter.sigma.value_or(1.0) > 0.0)
        parameter.value = guess_of(data, recording, free, i, 0);
  return model;
}

/// How much farther a small steady push on any state has carried an output by the end of a recording than by its middle. A
/// model that forgets is as far as it goes; one that integrates goes on. 0: nothing moves, or it forgets the push once that
/// is over: then it goes farther for another reason, as a vessel does whose flow has ebbed.
double goes_on(const Case& data, const Model& near, const Recording& recording) {
  const auto model = begun_as_recorded(data, near, recording);
  physics::Outputs at;
  recording.simulation->run(model, at);
  double most = 0.0;
  for (const auto& state : model.equations.states) {
    const auto* start = model.find(state.name + ".initial");
    double size = std::max(std::abs(start->value), start->sigma.value_or(0.0));
    for (const auto& output : at) size = std::max(size, std::min(1e6, reach(output, 0.0, 1.0)));
    const double duration = recording.inputs.time.back() - recording.inputs.time.front();
    const auto changes = [&](double share) {  // of the recording that the push lasts
      auto pushed = model;
      for (auto& one : pushed.equations.states)
        if (one.name == state.name) {
          std::ostringstream by;
          by.precision(17);
          by << "(" << one.derivative << ") + if(t < " << recording.inputs.time.front() + share * duration
             << ", " << 1e-6 * std::max(size, 1e-9) / duration << ", 0)";
          one.derivative = by.str();
        }
      physics::Outputs moved;
      physics::prepare(pushed, recording.inputs)->run(pushed, moved);
      for (std::size_t o = 0; o < at.size(); ++o)
        for (std::size_t i = 0; i < at[o].size(); ++i) moved[o][i] -= at[o][i];
      return moved;
    };
    const auto steady = changes(2.0);
    physics::Outputs brief;  // where it is asked for
    for (std::size_t o = 0; o < at.size(); ++o) {
      const double early = reach(steady[o], 0.25, 0.5), late = reach(steady[o], 0.75, 1.0);
      if (!(late > 1e-9 * size) || late / std::max(early, 1e-12 * size) <= most) continue;
      if (late > still_going * early) {
        if (brief.empty()) brief = changes(0.25);
        constexpr double forgotten = 0.02;
        if (reach(brief[o], 0.75, 1.0) < forgotten * reach(brief[o], 0.0, 0.5)) continue;
      }
      most = late / std::max(early, 1e-12 * size);
    }
  }
  return most;
}

/// Does a spring that the model has already bring an axis back within a small part of the recording?
bool is_held(const Case& data) {
  const auto& terms = data.model.terms;
  const auto spring = std::find_if(terms.begin(), terms.end(), [](const physics::Term& term) {
    return term.info->is_spring && term.values[term.info->index_of("stiffness")] > 0.0;
  });
  if (spring == terms.end()) return false;
  constexpr double soon = 0.05;
  const double mass = data.model.value("mass"), damping = data.model.value("viscous_damping"),
               stiffness = spring->values[spring->info->index_of("stiffness")];
  const double half = 0.5 * damping / mass, square = half * half - stiffness / mass;
  const double slowest = half - std::sqrt(std::max(0.0, square));  // [1/s], of m s^2 + c s + k = 0
  return slowest * soon * longest(data) > 1.0;
}

using StartRows = std::vector<std::vector<std::size_t>>;  // by recording

enum class Past { kept, forgotten };

/// The case with states of their own from these rows on. Where the model forgets, its run says how wide they go.
Case with_starts(const Case& whole, const StartRows& rows, Past past) {
  Case data = whole;
  const auto states = physics::states_of(whole.model);
  std::size_t next = 0;
  std::vector<double> sizes(states.size(), 0.0);
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    auto& recording = data.recordings[r];
    physics::Outputs free(states.size());
    if (!whole.model.equations.states.empty()) {
      const auto shown = showing_states(whole.model);
      physics::prepare(shown, recording.inputs)->run(shown, free);
    }
    recording.inputs.first_restart = next;
    recording.inputs.restarts = rows[r];
    for (std::size_t k = 0; k < rows[r].size(); ++k, ++next)
      for (std::size_t i = 0; i < states.size(); ++i) {
        const auto initial = initial_of(whole.model, states[i]);
        const double value = guess_of(whole, recording, free, i, rows[r][k]);
        sizes[i] =
            std::max({sizes[i], std::abs(value), initial.sigma.value_or(0.0), std::abs(initial.value), 1e-9});
        if (const double far = reach(free[i], 0.0, 1.0); past == Past::forgotten && far < 1e6)
          sizes[i] = std::max(sizes[i], far);
        data.model.parameters.push_back(
            {states[i] + ".start" + std::to_string(next), initial.unit, value, 1.0, initial.bounds});
      }
  }
  const std::size_t first = whole.model.parameters.size();
  for (std::size_t p = first; p < data.model.parameters.size(); ++p)
    data.model.parameters[p].sigma = sizes[(p - first) % states.size()];
  for (auto& recording : data.recordings)
    recording.simulation = physics::prepare(data.model, recording.inputs);
  return data;
}

/// The case in windows of about so many rows, and from these rows on; a window that would begin near one of them is none.
Case in_windows(const Case& whole, std::size_t rows, const StartRows& anew) {
  StartRows all = anew;
  Case::Windows windows = whole.windows;
  for (std::size_t r = 0; r < all.size(); ++r) {
    const auto& inputs = whole.recordings[r].inputs;
    const std::size_t n = inputs.rows(), count = std::max<std::size_t>(1, n / rows);
    windows.count += count;
    windows.length =
        std::max(windows.length, (inputs.time.back() - inputs.time.front()) / static_cast<double>(count));
    for (std::size_t k = 1; k < count; ++k) {
      const std::size_t row = k * n / count;
      if (std::none_of(anew[r].begin(), anew[r].end(), [&](std::size_t other) {
            return 2 * std::max(row, other) < 2 * std::min(row, other) + rows;
          }))
        all[r].push_back(row);
    }
    std::sort(all[r].begin(), all[r].end());
  }
  auto data = with_starts(whole, all, Past::kept);
  data.windows = windows;
  return data;
}

/// By how much a disturbance of the states at the beginning of a window has grown at its end, the median of all windows.
double growth_over_windows(const Case& data) {
  const auto at = simulate(data, data.model);
  std::vector<double> all;
  for (const auto& state : physics::states_of(data.model)) {
    auto moved = data.model;
    for (auto& p : moved.parameters)
      if (is_start(p) && p.name.starts_with(state + ".start")) p.value += 1e-5 * *p.sigma;
    const auto to = simulate_once(data, moved);
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& restarts = data.recordings[r].inputs.restarts;
      for (std::size_t k = 0; k < restarts.size(); ++k) {
        const std::size_t end = k + 1 < restarts.size() ? restarts[k + 1] : data.recordings[r].inputs.rows();
        const std::size_t early = restarts[k] + (end - restarts[k]) / 5;
        for (std::size_t o = 0; o < data.outputs.size(); ++o) {
          double first = 0.0, last = 0.0;
          for (std::size_t row = restarts[k]; row < end; ++row) {
            const double change = std::abs(to[r][o][row] - at[r][o][row]);
            auto& most = row < early ? first : last;
            most = std::isfinite(change) ? std::max(most, change) : 1e300;
          }
          if (first > 0.0) all.push_back(last / first);
        }
      }
    }
  }
  return all.empty() ? 0.0 : median(all);
}

}  // namespace

void estimate_starts(Case& data) {
  auto fixed = data.model;
  for (auto& parameter : fixed.parameters)
    if (!is_start(parameter)) parameter.sigma = 0.0;
  for (auto& term : fixed.terms) term.sigmas.fill(0.0);
  for (int again = 0; again < 2; ++again) {
    const auto plain = weigh(data, simulate(data, data.model), Colour::white);
    data.model.parameters = [&] {
      auto found = fit(data, plain, data.model, fixed, Effort::follow(8)).model.parameters;
      for (std::size_t p = 0; p < found.size(); ++p) found[p].sigma = data.model.parameters[p].sigma;
      return found;
    }();
  }
}

void cut_into_windows(Case& data) { cut_into_windows(data, data.model); }

void cut_into_windows(Case& data, const Model& near) {
  const auto states = physics::states_of(data.model).size();
  const bool is_axis = data.model.plant == physics::Plant::axis;
  if (states == 0 || (data.model.plant != physics::Plant::equations && !is_axis)) return;
  const auto anew =
      is_axis ? axis_begun_anew(data) : begun_anew(data, most_starts / std::max<std::size_t>(1, states));
  std::size_t rows = 0, all_rows = 0;
  bool goes = false;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto& recording = data.recordings[r];
    data.windows.anew += is_axis ? 0 : anew[r].size();
    all_rows += recording.inputs.rows();
    rows = is_axis ? all_rows : std::max(rows, recording.inputs.rows());
    if (recording.inputs.rows() >= 4 * fewest_rows_of_window && data.model.equations.controlled_input.empty())
      goes = goes || (is_axis ? !is_held(data) : goes_on(data, near, recording) > still_going);
  }
  if (!goes) {
    if (std::all_of(anew.begin(), anew.end(), [](const auto& rows_anew) { return rows_anew.empty(); }))
      return;
    data = with_starts(data, anew, Past::forgotten);
    estimate_starts(data);
    return;
  }
  const std::size_t shortest =
      std::max({fewest_rows_of_window, rows * states / most_starts, all_rows * states / (2 * most_starts)});
  std::size_t window = data.windows.are_long ? std::max(shortest, rows / long_windows) : shortest;
  auto cut = in_windows(data, window, anew);
  estimate_starts(cut);
  double growth = growth_over_windows(cut);
  while (growth > sum_growth && window > shortest) {
    window = std::max(shortest, window / 2);
    cut = in_windows(data, window, anew);
    estimate_starts(cut);
    growth = growth_over_windows(cut);
  }
  while (growth > most_growth && window > fewest_rows_of_window / 4 &&
         2 * cut.windows.count * states <= 2 * most_starts) {
    window /= 2;
    cut = in_windows(data, window, anew);
    estimate_starts(cut);
    growth = growth_over_windows(cut);
    cut.windows.grows = true;
  }
  data = std::move(cut);
}

std::optional<InWindows> in_short_windows(const Case& data) {
  const auto states = states_of(data.model).size();
  if (data.model.plant != physics::Plant::equations || states == 0 || data.windows.count > 0 ||
      data.windows.anew > 0 || !data.model.equations.controlled_input.empty())
    return std::nullopt;
  std::size_t rows = 0;
  for (const auto& recording : data.recordings) rows = std::max(rows, recording.inputs.rows());
  const std::size_t window = std::max(fewest_rows_of_window, rows * states / most_starts_of_a_hint);
  if (rows < 4 * window) return std::nullopt;
  auto cut = in_windows(data, window, StartRows(data.recordings.size()));
  estimate_starts(cut);
  const auto plain = weigh(cut, simulate(cut, cut.model), Colour::white);
  auto near = fit(cut, plain, cut.model, cut.model, Effort::follow(12));
  return InWindows{std::move(cut), std::move(near)};
}

std::optional<Model> begun_in_windows(const Case& data) {
  auto cut = in_short_windows(data);
  if (!cut) return std::nullopt;
  auto near = std::move(cut->fit.model);
  std::erase_if(near.parameters, is_start);
  return near;
}

bool has_longer_windows(const Case& data) {
  return data.model.plant == physics::Plant::equations && !data.windows.grows && !data.windows.are_long &&
         data.windows.count >= 2 * long_windows * data.recordings.size();
}

std::string how_windowed(const Case& data) {
  const auto& windows = data.windows;
  std::ostringstream text;
  text.precision(3);
  if (windows.count > 0)
    text << "judged over " << windows.count << " windows of " << windows.length
         << " s, each from states of its own, because the model "
         << (windows.grows ? "runs away from a disturbance" : "integrates");
  if (windows.anew > 0)
    text << (text.str().empty() ? "" : "; ") << "begun at states of their own: " << windows.anew
         << (windows.anew == 1 ? " stretch" : " stretches")
         << " behind gaps in an input or in further recordings";
  if (windows.forgetting > 0)
    text << (text.str().empty() ? "" : "; ") << "not compared: " << windows.forgetting
         << " rows in and behind gaps in an input";
  return text.str();
}

}  // namespace invar::diagnosis

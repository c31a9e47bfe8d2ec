#include "core/diagnosis/candidates/equation_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/locate/fine_periods.hpp"
#include "core/diagnosis/locate/what_looks_at_what.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

namespace {

using physics::Plant;
using physics::Term;

/// The frequencies that stand out of what the fitted model leaves, strongest first.
std::vector<double> residual_periods(const Case& data, const physics::Model& fitted, std::size_t most) {
  std::vector<std::pair<double, double>> peaks;  // power, period
  const auto simulated = simulate(data, fitted);
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      const auto& time = data.recordings[r].inputs.time;
      const double duration = time.back() - time.front();
      const std::size_t every = std::max<std::size_t>(1, time.size() / 2000);
      std::vector<double> power;
      const auto count = std::min<std::size_t>(300, time.size() / every / 3);
      for (std::size_t k = 2; k <= count; ++k) {  // half cycles over the recording
        double sine = 0.0, cosine = 0.0;
        for (std::size_t i = 0; i < time.size(); i += every) {
          const double e = data.recordings[r].measured[o][i] - simulated[r][o][i];
          if (!std::isfinite(e)) continue;
          const double angle =
              std::numbers::pi * static_cast<double>(k) * (time[i] - time.front()) / duration;
          sine += e * std::sin(angle), cosine += e * std::cos(angle);
        }
        power.push_back(sine * sine + cosine * cosine);
      }
      for (std::size_t i = 1; i + 1 < power.size(); ++i)
        if (power[i] > power[i - 1] && power[i] > power[i + 1])
          peaks.emplace_back(power[i], 2.0 * duration / static_cast<double>(i + 2));
    }
  std::sort(peaks.rbegin(), peaks.rend());
  std::vector<double> periods;
  for (std::size_t i = 0; i < std::min(most, peaks.size()); ++i) periods.push_back(peaks[i].second);
  return periods;
}

class Candidates {
 public:
  Candidates(const Case& data, const physics::Model& fitted)
      : data_{data},
        model_{fitted},
        equations_{data.model.equations},
        states_{states_of_machine(equations_)},
        spans_{data, fitted} {}

  std::vector<Start> all() {
    const double step = spans_.duration / static_cast<double>(spans_.rows);
    for (const auto& state : states_) {
      add_felt(state.name, step);
      if (is_kinematic(equations_, state)) continue;
      add_rates(state.name);
      add_stores(state.name);
    }
    for (const auto& input : equations_.inputs) {
      if (!is_used(equations_, input.symbol)) continue;
      const auto& span = spans_.of(input.symbol);
      add_late(input.symbol, step);
      add("hidden_state", input.symbol, "", 0.1, store_times());
      add_dead_zone(input.symbol, span);
      add_limits(input.symbol, span);
    }
    for (const auto& output : equations_.outputs) {
      const auto place = physics::place_of_output(equations_, output.name);
      add_late(place, step);
      add("hidden_state", place, "", 0.1, store_times());
      const auto& span = spans_.of(place);
      if (is_static(equations_)) add_readings(place, 1e-3 * span.width());
      add_limits(place, span);
      constexpr double plainly = 0.05;  // noise alone takes a reading to the other side
      if (std::min(-span.low, span.high) > plainly * span.width()) add_dead_zone(place, span);
    }
    return std::move(starts_);
  }

 private:
  /// Starts of a term with its amplitude (0: it has none) at `size`, once for each of `shapes`.
  void add(const char* name, const std::string& on, const std::string& with, double size,
           const std::vector<double>& shapes = {}) {
    Term term;
    term.info = physics::find_term(Plant::equations, name);
    term.on = on;
    term.with = with;
    for (std::size_t t = 0; t < model_.terms.size(); ++t) {
      const auto& used = model_.terms[t];
      if (used.info == term.info && used.on == on && used.with == with) return;
      if (t >= data_.model.terms.size() && same_law(used, term)) return;
    }
    if (size > 0.0) {
      term.values[0] = size;
      term.given[0] = true;
    }
    add_starts(starts_, term, shapes);
  }

  /// Whatever may be added to a state's rate: over itself, the other states, inputs and time.
  void add_rates(const std::string& state) {
    const auto& own = spans_.of(state);
    const double rate = 1e-3 * std::max(own.rate, own.size() / spans_.duration);
    const auto asked = rate_asked_for(data_, model_, state, rate);
    for (const auto& other : states_) {
      const bool itself = other.name == state;
      const double s = spans_.of(other.name).size();
      const std::string with = itself ? "" : other.name;
      add(itself ? "linear" : "coupling", state, with, rate / s);
      add("quadratic", state, with, rate / (s * s));
      add("cubic", state, with, rate / (s * s * s));
      add("periodic", state, other.name, rate, periods_of(spans_.of(other.name)));
      if (const auto fine = fine_periods(data_, model_, asked, other.name, 3); !fine.empty())
        add("periodic", state, other.name, rate, fine);
    }
    for (const auto& input : equations_.inputs)
      add("coupling", state, input.symbol, rate / spans_.of(input.symbol).size());
    add("constant", state, "", rate);
    if (own.low < 0.0 && own.high > 0.0) add("dry_friction", state, "", rate);  // else it is a constant
    if (!is_speed(equations_, state) && own.turns()) add("dry_friction", state, state, rate);
    add("periodic", state, "t", rate, residual_periods(data_, model_, 6));
  }

  /// Whatever may be added to an output of equations in which nothing moves: over the inputs and time.
  void add_readings(const std::string& place, double size) {
    for (const auto& input : equations_.inputs) {
      const auto& span = spans_.of(input.symbol);
      const double s = span.size();
      add("coupling", place, input.symbol, size / s);
      add("quadratic", place, input.symbol, size / (s * s));
      add("cubic", place, input.symbol, size / (s * s * s));
      add("periodic", place, input.symbol, size, periods_of(span));
      if (span.low < 0.0 && span.high > 0.0) add("dry_friction", place, input.symbol, size);
    }
    add("constant", place, "", size);
    add("periodic", place, "t", size, residual_periods(data_, model_, 6));
  }

  /// From half a period to some sixteen over the way that the variable goes.
  static std::vector<double> periods_of(const Span& span) {
    std::vector<double> periods;
    if (!(span.width() > 1e-9 * span.size())) return {};
    for (double k = 0.5; k < 4.0; k += 0.5) periods.push_back(span.width() / k);
    for (double k = 4.0; k < 16.0; k *= 1.09) periods.push_back(span.width() / k);
    return periods;
  }

  /// What bounds a state, and what stores behind it.
  void add_stores(const std::string& state) {
    add("hidden_state", state, "", 0.02 / spans_.duration, store_times());
    const auto& span = spans_.of(state);
    add_limits(state, span);
    for (const double share :
         {0.97, 0.9, 0.8, 0.7, 0.55})  // what runs over to nowhere is held by an upper limit
      for (const auto& other : states_)
        if (other.name != state) add("overflow", state, other.name, 0.0, {span.low + share * span.width()});
  }

  [[nodiscard]] std::vector<double> store_times() const {
    std::vector<double> times;
    for (double share = 0.002; share < 0.6; share *= 4.0) times.push_back(share * spans_.duration);
    return times;
  }

  /// What the rates see of a state, all of them or all but its own.
  void add_felt(const std::string& state, double step) {
    const auto& span = spans_.of(state);
    for (const char* by : {"", "others"}) {
      if (*by != '\0' && !is_felt_by_both(state)) continue;
      for (const double steps : {0.5, 6.0}) {
        add("delay", state, by, steps * step);
        add("lag", state, by, steps * step);
      }
      if (span.low < 0.0 && span.high > 0.0) add_dead_zone(state, span, by);
    }
  }

  /// Does a state's own rate look at it, and another's too?
  [[nodiscard]] bool is_felt_by_both(const std::string& state) const {
    bool own = false, other = false;
    for (const auto& one : states_)
      if (mentions(one.derivative, state)) (one.name == state ? own : other) = true;
    return own && other;
  }

  void add_dead_zone(const std::string& on, const Span& span, const std::string& with = "") {
    for (const double share : {0.02, 0.1}) add("dead_zone", on, with, share * span.width());
  }

  void add_limits(const std::string& on, const Span& span) {
    if (!(span.width() > 0.0)) return;
    for (const double share : {0.97, 0.9, 0.8, 0.7, 0.55}) {
      add("upper_limit", on, "", 0.0, {span.low + share * span.width()});
      add("lower_limit", on, "", 0.0, {span.high - share * span.width()});
    }
  }

  void add_late(const std::string& on, double step) {
    for (const double steps : {0.5, 3.0, 12.0}) {
      add("delay", on, "", steps * step);
      add("lag", on, "", steps * step);
    }
  }

  const Case& data_;
  const physics::Model& model_;
  const physics::Equations& equations_;
  const std::vector<physics::Equations::State> states_;
  Spans spans_;
  std::vector<Start> starts_;
};

void lay_knots(Start& start, const Span& span, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) {
    start.term.curve.knots.push_back(span.low +
                                     span.width() * static_cast<double>(k) / static_cast<double>(count - 1));
    start.term.curve.values.push_back(0.0);
    start.directions.push_back({physics::most_parameters, k, false});
  }
}

}  // namespace

std::vector<Start> equation_curves(const Case& data, const physics::Model& fitted, Curves curves) {
  const bool products = curves == Curves::times_a_variable;
  const Spans spans{data, fitted};
  const std::size_t most = products ? 6 : 8, knots = std::clamp<std::size_t>(spans.rows / 20, 4, most);
  const auto& equations = data.model.equations;
  const auto states = states_of_machine(equations);
  std::vector<std::string> symbols;
  for (const auto& state : states) symbols.push_back(state.name);
  for (const auto& input : equations.inputs) symbols.push_back(input.symbol);
  const auto factors = products ? symbols : std::vector<std::string>{""};
  symbols.emplace_back("t");
  std::vector<Start> starts;
  // Of a machine of many states there are too many to be tried.
  constexpr std::size_t most_curves = 250;
  if (states.size() * symbols.size() * factors.size() > most_curves) return starts;
  for (const auto& state : states) {
    if (is_kinematic(equations, state)) continue;
    const auto& own = spans.of(state.name);
    for (const auto& symbol : symbols)
      for (const auto& factor : factors) {
        const auto& span = spans.of(symbol);
        // What goes with itself is a curve of its own shape.
        if (!(span.width() > 1e-9 * span.size()) || symbol == factor) continue;
        if (products && !(spans.of(factor).width() > 0.0))
          continue;  // in proportion to what stays: the curve itself
        Start start;
        start.term.info = physics::unmodelled(Plant::equations, "state");
        start.term.on = state.name;
        start.term.with = factor;
        start.term.curve.over = symbol;
        start.step = 1e-3 * std::max(own.rate, own.size() / spans.duration);
        if (products) start.step /= spans.of(factor).size();
        lay_knots(start, span, knots);
        starts.push_back(std::move(start));
      }
  }
  if (products) return starts;
  // What an instrument reads wrong: more and more, or by what it reads.
  for (const auto& output : data.outputs) {
    const auto place = physics::place_of_output(equations, output);
    std::vector<std::string> variables{"t", place};
    for (const auto& input :
         equations.inputs)  // where nothing moves, what is left goes with what was recorded
      if (is_static(equations)) variables.push_back(input.symbol);
    for (const auto& symbol : variables) {
      const auto& span = spans.of(symbol);
      if (!(span.width() > 1e-9 * span.size())) continue;
      auto& start = starts.emplace_back();
      start.term.info = physics::unmodelled(Plant::equations, "output");
      start.term.on = place;
      start.term.curve.over = symbol;
      start.step = 1e-3 * std::max(spans.of(place).width(), 1e-12);
      lay_knots(start, span, knots);
    }
  }
  return starts;
}

std::vector<Start> equation_memories(const Case& data, const physics::Model& fitted) {
  const Spans spans{data, fitted};
  const auto& equations = data.model.equations;
  const auto states = states_of_machine(equations);
  std::vector<Start> starts;
  for (const auto& state : states)
    for (const auto& other : states)
      for (const auto memory : {physics::Curve::Memory::stop, physics::Curve::Memory::relaxation}) {
        const auto &own = spans.of(state.name), &span = spans.of(other.name);
        if (is_kinematic(equations, state) || !(span.width() > 1e-9 * span.size())) continue;
        auto& start = starts.emplace_back();
        start.term.info = physics::unmodelled(Plant::equations, "state");
        start.term.on = state.name;
        start.term.curve.over = other.name;
        start.term.curve.memory = memory;
        const bool is_stop = memory == physics::Curve::Memory::stop;
        lay_memory(start, is_stop ? 7 : 6, span.width(), spans.duration);
        start.step = 1e-3 * std::max(own.rate, own.size() / spans.duration) / (is_stop ? 1.0 : span.width());
      }
  return starts;
}

bool same_law(const Term& one, const Term& other) {
  return one.info->power > 0 && other.info->power > 0 && one.on == other.on && one.with == other.with;
}

std::vector<Start> equation_starts(const Case& data, const physics::Model& fitted) {
  return Candidates{data, fitted}.all();
}

}  // namespace invar::diagnosis

// EquationsMachine: a model in the user's own equations with its terms, advanced from row to row for several sets of
// numbers at once.
#pragma once

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "core/physics/compiled_equations.hpp"
#include "core/physics/curve_memory.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/static_plants.hpp"

namespace invar::physics {

/// The equations with the numbers of `lanes` models that have the same terms at the same places.
template <std::size_t lanes>
class EquationsMachine {
 public:
  static constexpr std::size_t most_states = 16;
  using Lane = std::array<double, lanes>;
  using State = std::array<Lane, most_states>;
  using Models = std::array<const Model*, lanes>;

  EquationsMachine(const CompiledEquations& compiled, const Models& models)
      : compiled_{compiled},
        states_{models[0]->equations.states.size()},
        controlled_{compiled.place(models[0]->equations.controlled_input)},
        slots_(compiled.formulas->slots() * lanes) {
    const auto& start = compiled.formulas->start();
    for (std::size_t s = 0; s < start.size(); ++s)
      for (std::size_t l = 0; l < lanes; ++l) slot(s)[l] = start[s];
    for (std::size_t i = 0; i < compiled.parameters.size(); ++i)
      for (std::size_t l = 0; l < lanes; ++l)
        slot(compiled.variables() + i)[l] = models[l]->parameters[compiled.parameters[i]].value;
    compiled.formulas->template run<lanes>(Expressions::fixed, slots_.data());
    for (std::size_t t = 0; t < models[0]->terms.size(); ++t) add(models, t);
  }

  [[nodiscard]] std::size_t states() const { return states_; }
  [[nodiscard]] std::size_t all_states() const { return states_ + hidden_.size() + lags_.size(); }
  [[nodiscard]] std::size_t controlled() const { return controlled_; }

  void set_input(std::size_t i, std::size_t lane, double value) { slot(states_ + i)[lane] = value; }
  /// From `time` on it goes so, until it is set or left.
  void set_input(std::size_t i, std::size_t lane, const InputCourse& course, double time) {
    if (courses_.size() <= i) courses_.resize(i + 1);
    courses_[i].of[lane] = course, courses_[i].runs[lane] = true;
    courses_[i].time = time;
  }
  /// All inputs stay where they are.
  void hold_inputs() {
    for (auto& course : courses_) course.runs.fill(false);
  }

  void show(const State& s, double t) {
    for (std::size_t i = 0; i < courses_.size(); ++i)
      for (std::size_t l = 0; l < lanes; ++l)
        if (courses_[i].runs[l]) slot(states_ + i)[l] = value_of(courses_[i].of[l], t - courses_[i].time);
    for (std::size_t i = 0; i < states_; ++i) std::copy_n(s[i].begin(), lanes, slot(i));
    std::fill_n(slot(compiled_.variables() - 1), lanes, t);
  }

  /// The rates here, held by limits and friction.
  State slope(const State& s, double t) {
    State d = free_slope(s, t);
    for (std::size_t l = 0; l < lanes; ++l) {
      for (const auto& rub : frictions_) {
        double& rate = d[rub.use.on][l];
        rate = rub.stuck[l] ? 0.0 : rate - rub.direction[l] * rub.use.p[l][0];
      }
      for (const auto& term : sticking_) {
        double& rate = d[term.on][l];
        rate -= std::clamp(rate, -term.p[l][0], term.p[l][0]);
      }
      for (const auto& term : overflows_) {
        double& rate = d[term.on][l];
        if (!(s[term.on][l] >= term.p[l][0] && rate > 0.0)) continue;
        if (term.with < states_ && term.with != term.on) d[term.with][l] += term.p[l][1] * rate;
        rate = 0.0;
      }
      for (const auto& term : uppers_)
        if (s[term.on][l] >= term.p[l][0] && d[term.on][l] > 0.0) d[term.on][l] = 0.0;
      for (const auto& term : lowers_)
        if (s[term.on][l] <= term.p[l][0] && d[term.on][l] < 0.0) d[term.on][l] = 0.0;
    }
    return d;
  }

  void advance(State& s, double t, double h, int parts) {
    h /= parts;
    step_ = h;
    turned_ = 0.0;
    for (auto& late : delays_) late.before = late.past.size();
    for (auto& course : curves_) course.before = course.memory, course.at_before = course.at;
    for (int part = 0; part < parts; ++part, t += h) {
      for (auto& late : delays_) late.past.emplace_back(t, s[late.use.on]);
      if (frictions_.empty())
        s = moved(s, t, h);
      else
        slide(s, t, h);
      for (std::size_t l = 0; l < lanes; ++l) {
        for (const auto& term : uppers_) s[term.on][l] = std::min(s[term.on][l], term.p[l][0]);
        for (const auto& term : lowers_) s[term.on][l] = std::max(s[term.on][l], term.p[l][0]);
        for (const auto& term : overflows_) {  // what ran over within the step
          const double surplus = std::max(0.0, s[term.on][l] - term.p[l][0]);
          s[term.on][l] -= surplus;
          if (term.with < states_ && term.with != term.on) s[term.with][l] += term.p[l][1] * surplus;
        }
      }
      for (auto& course : curves_) course.remember(s, t + h);
    }
    step_ = 0.0;
    for (auto& rub : frictions_) rub.direction.fill(0.0), rub.stuck.fill(false);
  }

  /// [rad] How far the fastest that moved in the last advance turned in one of its steps: what the slopes within a step
  /// tell of it. A jump turns as far in a step of half the size.
  [[nodiscard]] double turned() const { return turned_; }
  /// Forgets the last advance, to take it again in other steps.
  void take_back() {
    for (auto& late : delays_) late.past.resize(late.before);
    for (auto& course : curves_) course.memory = course.before, course.at = course.at_before;
  }

  /// Works out all outputs of the shown states.
  void work_out_outputs() {
    compiled_.formulas->template run<lanes>(Expressions::outputs, slots_.data());
    for (std::size_t i = 0; i < shown_.size(); ++i)
      std::copy_n(slot(compiled_.outputs[i]), lanes, shown_[i].begin());
    for (const auto& [output, over, use, curve] : added_)
      for (std::size_t l = 0; l < lanes; ++l) {
        const double s = slot(over)[l];
        shown_[output][l] += curve[l] != nullptr         ? (*curve[l])(s)
                             : use.kind->rate != nullptr ? use.kind->rate(s, use.p[l])
                                                         : use.p[l][0] * sign_of(s);
      }
  }
  [[nodiscard]] const double* output(std::size_t i) {
    return shown_.empty() ? slot(compiled_.outputs[i]) : shown_[i].data();
  }
  const double* law() {
    compiled_.formulas->template run<lanes>(Expressions::law, slots_.data());
    return slot(compiled_.law);
  }

  /// How fast anything of any lane changes.
  struct Rates {
    double radius = 0.0;  // [1/s]: the spectral radius of the Jacobian
    /// [1/s], with what dies away counted half: what swings carries its error on, what is damped forgets it.
    double swing = 0.0;
  };
  /// Fastest rates of all states, or of the user's own alone, here. A jump (the sign of a speed that is zero) has no rate of
  /// change: it would only make steps short.
  Rates fastest(const State& s, double t, bool own) {
    if (all_states() == 0) return {};
    auto fine = jacobian(s, t, 1e-6);
    const auto coarse = jacobian(s, t, 1e-4);
    const auto n = static_cast<Eigen::Index>(own ? states_ : all_states());
    Rates most;
    for (std::size_t l = 0; l < lanes; ++l) {
      for (Eigen::Index k = 0; k < fine[l].size(); ++k)
        if (std::abs(fine[l](k)) > 30.0 * std::abs(coarse[l](k))) fine[l](k) = coarse[l](k);
      if (!fine[l].allFinite()) continue;
      // Lanes of nearly the same numbers are as fast as the first: what turns is most of what a look costs.
      constexpr double alike = 1e-3;
      if (l > 0 && (fine[l] - fine[0]).norm() <= alike * fine[0].norm()) continue;
      for (const auto& rate : fine[l].topLeftCorner(n, n).eigenvalues()) {
        most.radius = std::max(most.radius, std::abs(rate));
        most.swing = std::max(most.swing,
                              std::hypot(rate.real() < 0.0 ? 0.5 * rate.real() : rate.real(), rate.imag()));
      }
    }
    return most;
  }
  [[nodiscard]] bool has_added_states() const { return !hidden_.empty() || !lags_.empty(); }
  /// [s] Stores and lags that are faster are blended out: they would only make steps short.
  void set_shortest(double time_constant) { shortest_ = time_constant; }
  /// Steps are longer than an explicit rule bears.
  void set_stiff(bool stiff) { stiff_ = stiff; }

  /// The states go on from other values; what is bent stays bent.
  void go_on_from(const State& s, double t) {
    for (auto& course : curves_)
      for (std::size_t l = 0; l < lanes && course.remembers(); ++l)
        course.memory[l].go_on_from(s[course.over][l]), course.at = t;
  }
  /// Initial values that the model does not state: stores in balance, nothing bent.
  void balance_hidden(State& s, double t) {
    for (auto& course : curves_)
      for (std::size_t l = 0; l < lanes && course.remembers(); ++l)
        course.memory[l].start(*course.curve[l], s[course.over][l]), course.at = t;
    for (std::size_t h = 0; h < hidden_.size(); ++h) s[states_ + h] = s[hidden_[h].on];
    for (std::size_t k = 0; k < lags_.size(); ++k) s[first_lag() + k] = s[lags_[k].on];
  }

 private:
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most_states, most_states>;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most_states, 1>;

  struct Use {
    const EquationsTermKind* kind;
    std::size_t on, with;
    std::array<const double*, lanes> p;
    bool by_others_alone = false;
  };
  struct Course {
    std::size_t on = 0, over = 0;
    std::array<const Curve*, lanes> curve{};
    std::optional<std::size_t>
        with;  // what the curve is of is in proportion to this; nothing: a rate by itself
    std::array<CurveMemory, lanes> memory{}, before{};
    double at = 0.0, at_before = 0.0;  // [s] when it was advanced

    [[nodiscard]] bool remembers() const { return curve[0]->memory != Curve::Memory::none; }
    void remember(const State& s, double t) {
      for (std::size_t l = 0; l < lanes && remembers(); ++l) memory[l].advance(*curve[l], s[over][l], t - at);
      at = t;
    }
  };
  /// To the value of an output.
  struct Added {
    std::size_t output, over;
    Use use;
    std::array<const Curve*, lanes> curve;  // null: a term without one
  };
  struct Courses {
    std::array<InputCourse, lanes> of{};
    std::array<bool, lanes> runs{};
    double time = 0.0;
  };
  struct Friction {
    Use use;
    Lane direction{};
    std::array<bool, lanes> stuck{};
  };
  struct Delay {
    Use use;
    std::vector<std::pair<double, Lane>> past;  // time, value
    std::size_t before = 0;                     // as many before the last advance
  };

  /// An input that decays within one integration step is replaced, at the nodes of the rule, by its exact mean over the step.
  [[nodiscard]] double value_of(const InputCourse& course, double since) const {
    const double straight = course.value + course.rate * since;
    if (course.fading == 0.0) return straight;
    const double x = step_ / course.time_constant;
    double share = 1.0;
    if (x > 1e-3) {
      const double looked = stiff_ ? 0.5 * (1.0 + std::exp(-x))  // trapezoid, Simpson
                                   : (1.0 + 4.0 * std::exp(-0.5 * x) + std::exp(-x)) / 6.0;
      share = -std::expm1(-x) / (x * looked);
    }
    return straight + share * course.fading * std::exp(-since / course.time_constant);
  }
  [[nodiscard]] double* slot(std::size_t s) { return slots_.data() + s * lanes; }
  [[nodiscard]] std::size_t first_lag() const { return states_ + hidden_.size(); }
  /// Never so short that a step could not follow; what is shorter is blended out.
  [[nodiscard]] double time_constant(double wanted) const { return std::max(wanted, shortest_); }

  /// The rates as they would be without friction and limits: those jump, and what jumps has no rate of change.
  State free_slope(const State& s, double t) {
    State d;
    for (const std::size_t own : spared_) {  // its rate feels it as it is
      show(s, t);
      bend_states(s, t, own);
      compiled_.formulas->template run<lanes>(Expressions::rates, slots_.data());
      std::copy_n(slot(compiled_.rates[own]), lanes, d[own].begin());
    }
    show(s, t);
    bend_states(s, t, states_);
    compiled_.formulas->template run<lanes>(Expressions::rates, slots_.data());
    for (std::size_t i = 0; i < states_; ++i)
      if (std::find(spared_.begin(), spared_.end(), i) == spared_.end())
        std::copy_n(slot(compiled_.rates[i]), lanes, d[i].begin());
    for (const auto& term : rate_terms_)
      for (std::size_t l = 0; l < lanes; ++l) d[term.on][l] += term.kind->rate(slot(term.with)[l], term.p[l]);
    for (const auto& course : curves_)
      for (std::size_t l = 0; l < lanes; ++l) {
        const double x = slot(course.over)[l];
        d[course.on][l] += course.remembers()
                               ? course.memory[l].value(*course.curve[l], s[course.over][l], t - course.at)
                               : (*course.curve[l])(x) * (course.with ? slot(*course.with)[l] : 1.0);
      }
    for (std::size_t h = 0; h < hidden_.size(); ++h) {
      const auto& term = hidden_[h];
      for (std::size_t l = 0; l < lanes; ++l) {
        const double difference = s[states_ + h][l] - s[term.on][l], time = time_constant(term.p[l][1]);
        d[term.on][l] += term.p[l][0] * term.p[l][1] / time * difference;  // holds as much
        d[states_ + h][l] = -difference / time;
      }
    }
    for (std::size_t k = 0; k < lags_.size(); ++k)
      for (std::size_t l = 0; l < lanes; ++l)
        d[first_lag() + k][l] = (s[lags_[k].on][l] - s[first_lag() + k][l]) / time_constant(lags_[k].p[l][0]);
    return d;
  }

  /// Values of states behind a dead zone, a lag or a delay, for the rates; outputs show the state itself. `own`: the state whose
  /// rate is asked for, where some are felt by the others alone.
  void bend_states(const State& s, double t, std::size_t own) {
    const auto is_as_it_is = [own](const Use& use) { return use.by_others_alone && use.on == own; };
    for (const auto& zone : dead_zones_)
      for (std::size_t l = 0; l < lanes && !is_as_it_is(zone); ++l) {
        double& seen = slot(zone.on)[l];
        seen -= std::clamp(seen, -zone.p[l][0], zone.p[l][0]);
      }
    for (std::size_t k = 0; k < lags_.size(); ++k)
      for (std::size_t l = 0; l < lanes && !is_as_it_is(lags_[k]); ++l)
        slot(lags_[k].on)[l] -=
            lags_[k].p[l][0] / time_constant(lags_[k].p[l][0]) * (s[lags_[k].on][l] - s[first_lag() + k][l]);
    for (const auto& late : delays_)
      for (std::size_t l = 0; l < lanes && !is_as_it_is(late.use); ++l) {
        const double by = late.use.p[l][0], when = t - by;
        const auto& past = late.past;
        if (past.empty() || !(by > 0.0)) continue;
        const auto after = std::upper_bound(past.begin(), past.end(), when,
                                            [](double time, const auto& one) { return time < one.first; });
        double& seen = slot(late.use.on)[l];
        if (after == past.begin()) {
          seen = past.front().second[l];
          continue;
        }
        const double t0 = (after - 1)->first, s0 = (after - 1)->second[l];
        const double t1 = after == past.end() ? t : after->first,
                     s1 = after == past.end() ? seen : after->second[l];
        seen = t1 > t0 ? s0 + (s1 - s0) * (when - t0) / (t1 - t0) : s1;
      }
  }

  /// Jacobian of the rates of all states here, as far as they do not jump, lane by lane; from steps of `share` of each state.
  std::array<Matrix, lanes> jacobian(const State& s, double t, double share);
  /// One step of Rosenbrock's rule of second order, L-stable: what is far faster than the step is at its balance after it.
  State eased(const State& s, double t, double h);
  /// One step of the classical Runge-Kutta rule.
  State moved(const State& s, double t, double h);
  /// Two slopes at one instant, and how far apart the states are that they were taken at: the rate at which these part.
  void note_turn(const State& s, const State& a, const State& b, const State& c, double h);

  static double sign_of(double x) { return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : 0.0); }

  /// Which way each friction acts from here; at rest it holds up to its level. One lane alone.
  void turn(const State& s, double t);
  /// A step under dry friction: reversals are found, so that what comes out is smooth in every number. One lane alone: each
  /// has its reversals at a time of its own.
  void slide(State& s, double t, double h);

  void add(const Models& models, std::size_t t);
  /// `with`: the slot of the variable that a term without a curve goes over.
  void add_to_output(const Models& models, std::size_t t, std::size_t with);

  const CompiledEquations& compiled_;
  std::size_t states_, controlled_;
  std::vector<double> slots_;  // slot by slot, the lanes of one beside one another
  std::vector<Friction> frictions_;
  std::vector<Delay> delays_;
  std::vector<Course> curves_;
  std::vector<Added> added_;
  std::vector<Lane> shown_;  // values of the outputs with what is added; empty: nothing is
  std::vector<Courses> courses_;
  std::vector<std::size_t> spared_;  // states of which something is felt by the others alone
  std::vector<Use> rate_terms_, uppers_, lowers_, overflows_, hidden_, lags_, dead_zones_, sticking_;
  double shortest_ = 0.0;
  double step_ = 0.0;  // [s] that is being taken; 0: none
  double turned_ = 0.0;
  State largest_{};
  bool stiff_ = false;
};

}  // namespace invar::physics

// Models in the user's own equations: expressions parsed by muParser, integrated between the rows.
#include <muParser.h>

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <numbers>

#include "core/base/fault.hpp"
#include "core/physics/simulate_plants.hpp"
#include "core/physics/static_plants.hpp"

namespace invar::physics {

namespace {

double root_of(double x) { return x > 0.0 ? std::sqrt(x) : 0.0; }  // an empty tank does not run
double logarithm(double x) { return std::log(std::max(x, std::numeric_limits<double>::min())); }
double sign_of(double x) { return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : 0.0); }

/// The expressions, parsed once: reading them takes a hundred times as long as a step. Parsers hold pointers into it.
class Compiled {
 public:
  explicit Compiled(const Model& model) {
    const auto& equations = model.equations;
    for (const auto& state : equations.states) names_.push_back(state.name);
    for (const auto& input : equations.inputs) names_.push_back(input.symbol);
    names_.emplace_back("t");
    for (std::size_t i = 0; i < model.parameters.size(); ++i)
      if (model.parameters[i].name.find('.') == std::string::npos) parameters_.push_back(i);
    symbols.resize(names_.size(), 0.0);
    values_.resize(parameters_.size(), 0.0);
    show_parameters(model);
    for (const auto& state : equations.states)
      rates.push_back(parser(model, state.derivative, "states." + state.name));
    for (const auto& output : equations.outputs)
      outputs.push_back(parser(model, output.expression, "outputs." + output.name));
    if (!equations.controlled_input.empty())
      law.push_back(parser(model, equations.control_law, "controller.expression"));
  }
  Compiled(const Compiled&) = delete;
  Compiled& operator=(const Compiled&) = delete;

  void show_parameters(const Model& model) {
    for (std::size_t i = 0; i < parameters_.size(); ++i) values_[i] = model.parameters[parameters_[i]].value;
  }
  /// The place of a symbol; symbols.size() where there is none of it.
  [[nodiscard]] std::size_t place(const std::string& symbol) const {
    return static_cast<std::size_t>(std::find(names_.begin(), names_.end(), symbol) - names_.begin());
  }

  std::vector<double> symbols;  // states, inputs, t
  std::vector<mu::Parser> rates, outputs, law;

 private:
  mu::Parser parser(const Model& model, const std::string& expression, const std::string& where) {
    mu::Parser made;
    made.DefineConst("pi", std::numbers::pi);
    made.DefineFun("sqrt", root_of);
    made.DefineFun("log", logarithm);
    made.DefineFun("sign", sign_of);
    for (std::size_t i = 0; i < parameters_.size(); ++i)
      made.DefineVar(model.parameters[parameters_[i]].name, &values_[i]);
    for (std::size_t i = 0; i < names_.size(); ++i) made.DefineVar(names_[i], &symbols[i]);
    made.SetExpr(expression);
    try {
      (void)made.Eval();
    } catch (const mu::Parser::exception_type& error) {
      throw InputError{where, "`" + expression + "`: " + error.GetMsg(),
                       "use states, inputs, parameters, t, pi and the functions of the contract"};
    }
    return made;
  }

  std::vector<std::string> names_;
  std::vector<std::size_t> parameters_;  // places in the model
  std::vector<double> values_;
};

/// The equations with the numbers and terms of one model.
class Machine {
 public:
  Machine(Compiled& compiled, const Model& model)
      : compiled_{compiled},
        states_{model.equations.states.size()},
        controlled_{compiled.place(model.equations.controlled_input)} {
    compiled.show_parameters(model);
    for (const auto& term : model.terms) add(term);
  }

  [[nodiscard]] std::size_t states() const { return states_; }
  [[nodiscard]] std::size_t all_states() const { return states_ + hidden_.size() + lags_.size(); }

  static constexpr std::size_t most_states = 16;
  using State = std::array<double, most_states>;

  void set_input(std::size_t i, double value) { compiled_.symbols[states_ + i] = value; }
  [[nodiscard]] std::size_t controlled() const { return controlled_; }

  void show(const State& s, double t) {
    std::copy_n(s.begin(), states_, compiled_.symbols.begin());
    compiled_.symbols.back() = t;
  }

  /// The rates here, held by limits.
  State slope(const State& s, double t) {
    State d = free_slope(s, t);
    for (const auto& rub : frictions_)
      d[rub.use.on] = rub.stuck ? 0.0 : d[rub.use.on] - rub.direction * rub.use.p[0];
    for (const auto& term : overflows_)
      if (s[term.on] >= term.p[0] && d[term.on] > 0.0) {
        if (term.with < states_ && term.with != term.on) d[term.with] += term.p[1] * d[term.on];
        d[term.on] = 0.0;
      }
    for (const auto& term : uppers_)
      if (s[term.on] >= term.p[0] && d[term.on] > 0.0) d[term.on] = 0.0;
    for (const auto& term : lowers_)
      if (s[term.on] <= term.p[0] && d[term.on] < 0.0) d[term.on] = 0.0;
    return d;
  }

  /// The rates as they would be without friction and limits: those jump, and what jumps has no rate of change.
  State free_slope(const State& s, double t) {
    show(s, t);
    bend_states(s, t);
    State d{};
    for (std::size_t i = 0; i < states_; ++i) d[i] = compiled_.rates[i].Eval();
    for (const auto& term : rate_terms_) d[term.on] += term.kind->rate(compiled_.symbols[term.with], term.p);
    for (const auto& [on, with, curve] : curves_) d[on] += (*curve)(compiled_.symbols[with]);
    for (std::size_t h = 0; h < hidden_.size(); ++h) {
      const auto& term = hidden_[h];
      const double difference = s[states_ + h] - s[term.on];
      d[term.on] += term.p[0] * difference;
      d[states_ + h] = -difference / term.p[1];
    }
    for (std::size_t k = 0; k < lags_.size(); ++k)
      d[first_lag() + k] = (s[lags_[k].on] - s[first_lag() + k]) / time_constant(lags_[k]);
    return d;
  }

  void advance(State& s, double t, double h, int parts) {
    h /= parts;
    shortest_lag_ = h / 2.5;
    for (int part = 0; part < parts; ++part, t += h) {
      for (auto& late : delays_) late.past.emplace_back(t, s[late.use.on]);
      frictions_.empty() ? void(s = moved(s, t, h)) : slide(s, t, h);
      for (const auto& term : uppers_) s[term.on] = std::min(s[term.on], term.p[0]);
      for (const auto& term : lowers_) s[term.on] = std::max(s[term.on], term.p[0]);
      for (const auto& term : overflows_) {  // what ran over within the step
        const double surplus = std::max(0.0, s[term.on] - term.p[0]);
        s[term.on] -= surplus;
        if (term.with < states_ && term.with != term.on) s[term.with] += term.p[1] * surplus;
      }
    }
    for (auto& rub : frictions_)
      rub.direction = 0.0, rub.stuck = false;  // elsewhere the rates are those without it
  }

  double output(std::size_t i) { return compiled_.outputs[i].Eval(); }
  double law() { return compiled_.law.front().Eval(); }

  /// Of the rates of all states here, as far as they do not jump.
  Eigen::MatrixXd jacobian(const State& s, double t) {
    const auto n = static_cast<Eigen::Index>(all_states());
    Eigen::MatrixXd all(n, n);
    for (Eigen::Index j = 0; j < n; ++j) {
      State up = s, down = s;
      const auto at = static_cast<std::size_t>(j);
      const double by = 1e-6 * std::max(1e-3, std::abs(s[at]));
      up[at] += by, down[at] -= by;
      const State a = free_slope(up, t), b = free_slope(down, t);
      for (Eigen::Index i = 0; i < n; ++i)
        all(i, j) = (a[static_cast<std::size_t>(i)] - b[static_cast<std::size_t>(i)]) / (2.0 * by);
    }
    return all;
  }

  /// The largest rate of change of anything [1/s]: the spectral radius of the Jacobian here.
  double fastest(const State& s, double t) {
    const auto rates = jacobian(s, t);
    return rates.allFinite() ? rates.eigenvalues().cwiseAbs().maxCoeff() : 0.0;
  }
  /// Steps are longer than an explicit rule bears.
  void set_stiff(bool stiff) { stiff_ = stiff; }

  void balance_hidden(State& s) const {
    for (std::size_t h = 0; h < hidden_.size(); ++h) s[states_ + h] = s[hidden_[h].on];
    for (std::size_t k = 0; k < lags_.size(); ++k) s[first_lag() + k] = s[lags_[k].on];
  }

 private:
  struct Use {
    const EquationsTermKind* kind;
    std::size_t on, with;
    const double* p;
  };
  struct Course {
    std::size_t on, with;
    const Curve* curve;
  };
  struct Friction {
    Use use;
    double direction = 0.0;
    bool stuck = false;
  };
  struct Delay {
    Use use;
    std::vector<std::pair<double, double>> past;  // time, value
  };

  [[nodiscard]] std::size_t first_lag() const { return states_ + hidden_.size(); }
  /// Never so short that a step could not follow; what is shorter is blended out.
  [[nodiscard]] double time_constant(const Use& lag) const { return std::max(lag.p[0], shortest_lag_); }

  /// What the rates see of a state behind a dead zone, a lag or a delay; outputs show the state itself.
  void bend_states(const State& s, double t) {
    for (const auto& zone : dead_zones_) {
      double& seen = compiled_.symbols[zone.on];
      seen -= std::clamp(seen, -zone.p[0], zone.p[0]);
    }
    for (std::size_t k = 0; k < lags_.size(); ++k)
      compiled_.symbols[lags_[k].on] -=
          lags_[k].p[0] / time_constant(lags_[k]) * (s[lags_[k].on] - s[first_lag() + k]);
    for (const auto& late : delays_) {
      const double when = t - late.use.p[0];
      const auto& past = late.past;
      const auto after = std::upper_bound(past.begin(), past.end(), when,
                                          [](double time, const auto& one) { return time < one.first; });
      double& seen = compiled_.symbols[late.use.on];
      if (past.empty() || !(late.use.p[0] > 0.0)) continue;
      if (after == past.begin()) {
        seen = past.front().second;
        continue;
      }
      const auto& [t0, s0] = *(after - 1);
      const double t1 = after == past.end() ? t : after->first,
                   s1 = after == past.end() ? seen : after->second;
      seen = t1 > t0 ? s0 + (s1 - s0) * (when - t0) / (t1 - t0) : s1;
    }
  }

  /// One step of Rosenbrock's rule of second order, L-stable: what is far faster than the step is at its balance after it.
  State eased(const State& s, double t, double h) {
    constexpr double gamma = 1.0 - 0.5 * std::numbers::sqrt2;
    const auto n = static_cast<Eigen::Index>(all_states());
    const auto column = [n](const State& state) {
      return Eigen::Map<const Eigen::VectorXd>(state.data(), n);
    };
    const Eigen::MatrixXd eye = Eigen::MatrixXd::Identity(n, n);
    const auto matrix = (eye - gamma * h * jacobian(s, t)).eval().partialPivLu();
    const State here = slope(s, t);
    const Eigen::VectorXd first = matrix.solve(column(here));
    State next = s;
    Eigen::Map<Eigen::VectorXd>(next.data(), n) += h * first;
    const State there = slope(next, t + h);
    const Eigen::VectorXd second = matrix.solve(column(there) - 2.0 * first);
    next = s;
    Eigen::Map<Eigen::VectorXd>(next.data(), n) += h * (1.5 * first + 0.5 * second);
    return next;
  }

  /// One step of the classical Runge-Kutta rule.
  State moved(const State& s, double t, double h) {
    if (stiff_) return eased(s, t, h);
    const std::size_t n = all_states();
    const auto by = [&](const State& rate, double share) {
      State next = s;
      for (std::size_t i = 0; i < n; ++i) next[i] += share * rate[i];
      return next;
    };
    const State a = slope(s, t), b = slope(by(a, 0.5 * h), t + 0.5 * h),
                c = slope(by(b, 0.5 * h), t + 0.5 * h), d = slope(by(c, h), t + h);
    State next = s;
    for (std::size_t i = 0; i < n; ++i) next[i] += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
    return next;
  }

  /// Which way each friction acts from here; at rest it holds up to its level.
  void turn(const State& s, double t) {
    for (auto& rub : frictions_) {
      const double speed = s[rub.use.on];
      rub.direction = sign_of(speed);
      rub.stuck = false;
      if (speed != 0.0) continue;
      const double push = slope(s, t)[rub.use.on];
      rub.stuck = std::abs(push) <= rub.use.p[0];
      rub.direction = rub.stuck ? 0.0 : sign_of(push);
    }
  }

  /// A step under dry friction: reversals are found, so that what comes out is smooth in every number.
  void slide(State& s, double t, double h) {
    for (int events = 0; events < 8 && h > 0.0; ++events) {
      turn(s, t);
      State next = moved(s, t, h);
      double taken = h;
      for (auto& rub : frictions_) {
        const std::size_t on = rub.use.on;
        if (rub.stuck || !(next[on] * rub.direction < 0.0)) continue;
        if (s[on] == 0.0) {  // would slide back at once: it stays
          rub.stuck = true;
          next = moved(s, t, taken);
          continue;
        }
        double low = 0.0, low_speed = s[on], high = taken, high_speed = next[on];
        for (int i = 0; i < 6 && std::abs(next[on]) > 1e-13 * std::abs(s[on]); ++i) {  // regula falsi
          taken = low + (high - low) * low_speed / (low_speed - high_speed);
          next = moved(s, t, taken);
          (next[on] * rub.direction > 0.0 ? low : high) = taken;
          (next[on] * rub.direction > 0.0 ? low_speed : high_speed) = next[on];
        }
        next[on] = 0.0;
      }
      s = next;
      t += taken;
      h -= taken;
    }
  }

  void add(const Term& term) {
    const auto* kind = equations_kind(*term.info);
    const std::size_t on = compiled_.place(term.on),
                      with = term.with.empty() ? on : compiled_.place(term.with);
    if (on >= states_) return;  // at an input or output: the simulation bends those
    if (!term.curve.knots.empty()) {
      curves_.push_back(
          {on, std::min(compiled_.place(term.curve.over), compiled_.symbols.size() - 1), &term.curve});
      return;
    }
    const Use use{kind, on, std::min(with, compiled_.symbols.size() - 1), term.values.data()};
    if (kind->rate != nullptr) rate_terms_.push_back(use);
    switch (kind->memory) {
      case EquationsMemory::dry_friction:
        frictions_.push_back({use});
        break;
      case EquationsMemory::upper_limit:
        uppers_.push_back(use);
        break;
      case EquationsMemory::lower_limit:
        lowers_.push_back(use);
        break;
      case EquationsMemory::overflow:
        overflows_.push_back(use);
        break;
      case EquationsMemory::hidden_state:
        if (all_states() < most_states) hidden_.push_back(use);
        break;
      case EquationsMemory::lag:
        if (all_states() < most_states) lags_.push_back(use);
        break;
      case EquationsMemory::delay:
        delays_.push_back({use, {}});
        break;
      case EquationsMemory::dead_zone:
        dead_zones_.push_back(use);
        break;
      default:
        break;
    }
  }

  Compiled& compiled_;
  std::size_t states_, controlled_;
  std::vector<Friction> frictions_;
  std::vector<Delay> delays_;
  std::vector<Course> curves_;
  std::vector<Use> rate_terms_, uppers_, lowers_, overflows_, hidden_, lags_, dead_zones_;
  double shortest_lag_ = 0.0;
  bool stiff_ = false;
};

/// Of each value a share arrives by way of a first-order store, in balance at the start. What is held from row to row
/// counts with the mean over its row's step, as a machine feels it; what is smooth goes straight from row to row.
void follow(const std::vector<double>& time, std::vector<double>& values, double time_constant, double share,
            bool held) {
  double z = values.front(), last = values.front();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double now = values[i];
    const std::size_t end = held ? std::min(i + 1, values.size() - 1) : i;
    const double h = end > 0 ? time[end] - time[end - 1] : 0.0, kept = std::exp(-h / time_constant);
    double felt = z;
    if (held) {
      felt = h > 0.0 ? now + (z - now) * (1.0 - kept) * time_constant / h : z;
      z = now + (z - now) * kept;
    } else if (h > 0.0) {
      const double behind = (now - last) / h * time_constant;
      felt = z = now - behind + (z - last + behind) * kept;
    }
    last = now;
    values[i] = now + share * (felt - now);
  }
}

/// What passes a limit of one column goes, in part, to another.
void run_over(const Model& model, const std::vector<std::string>& names,
              std::vector<std::vector<double>>& columns) {
  const auto place = [&](const std::string& name) {
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  };
  for (const auto& term : model.terms) {
    if (equations_kind(*term.info)->memory != EquationsMemory::overflow) continue;
    const std::size_t on = place(term.on), to = place(term.with);
    if (on >= names.size()) continue;
    for (std::size_t i = 0; i < columns[on].size(); ++i) {
      const double surplus = std::max(0.0, columns[on][i] - term.values[0]);
      columns[on][i] -= surplus;
      if (to < names.size() && to != on) columns[to][i] += term.values[1] * surplus;
    }
  }
}

/// What terms at inputs and outputs do to a whole column.
void bend(const Model& model, const std::string& on, const std::vector<double>& time,
          std::vector<double>& values, bool held) {
  for (const auto& term : model.terms) {
    if (term.on != on) continue;
    const double p = term.values[0];
    switch (equations_kind(*term.info)->memory) {
      case EquationsMemory::upper_limit:
        for (double& v : values) v = std::min(v, p);
        break;
      case EquationsMemory::lower_limit:
        for (double& v : values) v = std::max(v, p);
        break;
      case EquationsMemory::dead_zone:
        for (double& v : values) v -= std::clamp(v, -p, p);
        break;
      case EquationsMemory::lag:
        if (p > 0.0) follow(time, values, p, 1.0, held);
        break;
      case EquationsMemory::hidden_state:
        follow(time, values, term.values[1], p, held);
        break;
      case EquationsMemory::delay: {
        if (!(p > 0.0)) break;
        const auto before = values;
        std::size_t a = 0;
        for (std::size_t i = 0; i < values.size(); ++i) {
          const double when = time[i] - p;
          while (a + 1 < before.size() && time[a + 1] <= when) ++a;
          const std::size_t b = std::min(a + 1, before.size() - 1);
          const double h = time[b] - time[a];
          const double share = h > 0.0 ? std::clamp((when - time[a]) / h, 0.0, 1.0) : 0.0;
          values[i] = before[a] + share * (before[b] - before[a]);
        }
        break;
      }
      default:
        break;
    }
  }
}

class OwnEquations final : public Simulation {
 public:
  OwnEquations(const Model& structure, const Record& inputs) : time_{inputs.time} {
    if (structure.equations.states.size() > 12)
      throw InputError{"states", "are more than 12", "split the model"};
    for (const auto& input : structure.equations.inputs) {
      const auto* values = inputs.find(input.signal);
      inputs_.push_back(values == nullptr ? std::vector<double>(time_.size(), 0.0) : bridged(time_, *values));
    }
    for (const auto& output : structure.equations.outputs) {
      const auto* values = inputs.find(output.name);
      first_.push_back(values == nullptr || values->empty() ? std::nan("") : values->front());
    }
    compiled_.push_back(std::make_unique<Compiled>(structure));  // finds what is wrong before anything runs
  }

  void run(const Model& model, Outputs& outputs) const override {
    auto compiled = borrow(model);
    Machine machine{*compiled, model};
    const auto& equations = model.equations;
    const std::size_t n = time_.size();
    auto inputs = inputs_;
    std::vector<std::string> input_names, output_names;
    for (const auto& input : equations.inputs) input_names.push_back(input.symbol);
    for (const auto& output : equations.outputs) output_names.push_back(output.name);
    for (std::size_t i = 0; i < inputs.size(); ++i)
      bend(model, input_names[i], time_, inputs[i], !equations.inputs[i].linear);
    run_over(model, input_names, inputs);
    outputs.resize(equations.outputs.size());
    for (auto& output : outputs) output.assign(n, 0.0);
    Machine::State s{};
    for (std::size_t i = 0; i < machine.states(); ++i)
      s[i] = model.value(equations.states[i].name + ".initial");
    for (std::size_t o = 0; o < first_.size(); ++o)  // an output that is a state, given in the first row
      for (std::size_t i = 0; i < machine.states(); ++i)
        if (std::isfinite(first_[o]) && equations.outputs[o].expression == equations.states[i].name)
          s[i] = first_[o];
    machine.balance_hidden(s);
    double fastest = 0.0;
    for (std::size_t row = 0; row < n; ++row) {
      for (std::size_t i = 0; i < inputs.size(); ++i) machine.set_input(i, inputs[i][row]);
      machine.show(s, time_[row]);
      if (!equations.controlled_input.empty() && machine.controlled() >= machine.states())
        machine.set_input(machine.controlled() - machine.states(), machine.law());
      if (row % std::max<std::size_t>(1, n / 32) == 0) {
        const double now = machine.fastest(s, time_[row]);
        fastest = std::max(now, 0.5 * fastest);  // where it was fast, it may soon be again
      }
      machine.show(s, time_[row]);
      for (std::size_t o = 0; o < outputs.size(); ++o) outputs[o][row] = machine.output(o);
      if (row + 1 == n) break;
      const double h = time_[row + 1] - time_[row];
      if (!(h > 0.0)) continue;
      const int parts = static_cast<int>(std::clamp(std::ceil(h * fastest / 0.25), 1.0, 60.0));
      machine.set_stiff(h * fastest > 1.5 * parts);
      bool linear = false;
      for (const auto& input : equations.inputs) linear = linear || input.linear;
      if (!linear) {
        machine.advance(s, time_[row], h, parts);
        continue;
      }
      for (int part = 0; part < parts; ++part) {
        const double middle = (part + 0.5) / parts;
        for (std::size_t i = 0; i < inputs.size(); ++i)
          if (equations.inputs[i].linear)
            machine.set_input(i, inputs[i][row] + middle * (inputs[i][row + 1] - inputs[i][row]));
        machine.advance(s, time_[row] + h * part / parts, h / parts, 1);
      }
    }
    run_over(model, output_names, outputs);
    for (std::size_t o = 0; o < outputs.size(); ++o) {
      const auto& output = equations.outputs[o];
      bend(model, output.name, time_, outputs[o], false);
      for (double& value : outputs[o]) value = output.limits.clamp(value);
    }
    const std::scoped_lock lock{mutex_};
    compiled_.push_back(std::move(compiled));
  }

 private:
  std::unique_ptr<Compiled> borrow(const Model& model) const {
    {
      const std::scoped_lock lock{mutex_};
      if (!compiled_.empty()) {
        auto one = std::move(compiled_.back());
        compiled_.pop_back();
        return one;
      }
    }
    return std::make_unique<Compiled>(model);
  }

  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<Compiled>> compiled_;  // one a thread that runs
  std::vector<double> time_;
  std::vector<std::vector<double>> inputs_;
  std::vector<double> first_;
};

}  // namespace

std::unique_ptr<Simulation> prepare_equations(const Model& structure, const Record& inputs) {
  return std::make_unique<OwnEquations>(structure, inputs);
}

}  // namespace invar::physics

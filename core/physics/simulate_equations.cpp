// Models in the user's own equations: integrated between the rows.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/base/fault.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/equations_machine_steps.hpp"
#include "core/physics/equations_machine_terms.hpp"
#include "core/physics/simulate_plants.hpp"

namespace invar::physics {

namespace {

class OwnEquations final : public Simulation {
 public:
  OwnEquations(const Model& structure, const Record& inputs)
      : time_{inputs.time}, turn_{inputs.turn}, compiled_{structure} {
    if (structure.equations.states.size() > 12)
      throw InputError{"states", "are more than 12", "split the model"};
    for (const auto& input : structure.equations.inputs) {
      const auto* values = inputs.find(input.signal);
      inputs_.push_back(values == nullptr ? std::vector<double>(time_.size(), 0.0) : bridged(time_, *values));
    }
    restarts_ = restarts_of(structure, inputs);
    for (const auto& output : structure.equations.outputs) {
      const auto* values = inputs.find(output.name);
      first_.push_back(values == nullptr || values->empty() ? std::nan("") : values->front());
    }
  }

  void run(const Model& model, Outputs& outputs) const override { run_lanes<1>({&model}, {&outputs}); }

  void run_all(const std::vector<const Model*>& models, std::vector<Outputs>& outputs) const override {
    constexpr std::size_t most = 8;
    outputs.resize(models.size());
    for (std::size_t begin = 0; begin < models.size();) {
      std::size_t count = 1;
      while (begin + count < models.size() && count < most && !has_reversals(*models[begin]) &&
             are_alike(*models[begin], *models[begin + count]))
        ++count;
      if (count < 2)
        run(*models[begin], outputs[begin]), begin += 1;
      else if (count <= 4)
        run_some<4>(models, outputs, begin, count), begin += count;
      else
        run_some<8>(models, outputs, begin, count), begin += count;
    }
  }

 private:
  /// Reversals under dry friction come at a time of their own in each model.
  static bool has_reversals(const Model& model) {
    const auto& states = model.equations.states;
    return std::any_of(model.terms.begin(), model.terms.end(), [&](const Term& t) {
      return equations_kind(*t.info)->memory == EquationsMemory::dry_friction && !sticks(t) &&
             std::any_of(states.begin(), states.end(), [&](const auto& state) { return state.name == t.on; });
    });
  }
  /// Do they differ in numbers alone?
  static bool are_alike(const Model& a, const Model& b) {
    return std::equal(a.terms.begin(), a.terms.end(), b.terms.begin(), b.terms.end(),
                      [](const Term& one, const Term& other) {
                        return one.info == other.info && one.on == other.on && one.with == other.with &&
                               one.curve.over == other.curve.over &&
                               one.curve.knots.empty() == other.curve.knots.empty();
                      });
  }

  /// Lanes without a model of their own repeat the last one.
  template <std::size_t lanes>
  void run_some(const std::vector<const Model*>& models, std::vector<Outputs>& outputs, std::size_t begin,
                std::size_t count) const {
    std::array<const Model*, lanes> some{};
    std::array<Outputs*, lanes> into{};
    for (std::size_t l = 0; l < lanes; ++l) {
      some[l] = models[begin + std::min(l, count - 1)];
      into[l] = l < count ? &outputs[begin + l] : nullptr;
    }
    run_lanes<lanes>(some, into);
  }

  /// The rows, and between them the instants at which inputs that come late change, or bend.
  struct Grid {
    std::vector<double> time;
    std::vector<std::vector<double>> inputs;
    std::vector<bool> is_row;
  };

  /// Nothing where no input comes late by a part of the time between two rows.
  template <std::size_t lanes>
  [[nodiscard]] std::optional<Grid> changes_between_rows(
      const std::array<const Model*, lanes>& models) const {
    const auto& equations = models[0]->equations;
    std::vector<double> between;
    for (const auto* model : models)
      for (const auto& term : model->terms) {
        if (equations_kind(*term.info)->memory != EquationsMemory::delay || !(term.values[0] > 0.0) ||
            term.on == equations.controlled_input)
          continue;
        const bool alone = std::count_if(model->terms.begin(), model->terms.end(),
                                         [&](const Term& other) { return other.on == term.on; }) == 1;
        for (std::size_t i = 0; i < inputs_.size(); ++i) {
          if (equations.inputs[i].symbol != term.on) continue;
          for (std::size_t row = 1; row < time_.size(); ++row)
            if (!alone || equations.inputs[i].linear || inputs_[i][row] != inputs_[i][row - 1])
              between.push_back(time_[row] + term.values[0]);
        }
      }
    if (between.empty()) return std::nullopt;
    std::sort(between.begin(), between.end());
    Grid grid;
    grid.inputs.resize(inputs_.size());
    const auto add = [&](double time, std::size_t row, bool is_row) {
      grid.time.push_back(time);
      grid.is_row.push_back(is_row);
      const double h = row + 1 < time_.size() ? time_[row + 1] - time_[row] : 0.0;
      const double share = h > 0.0 ? (time - time_[row]) / h : 0.0;
      for (std::size_t i = 0; i < inputs_.size(); ++i) {
        const double held = inputs_[i][row];
        grid.inputs[i].push_back(
            equations.inputs[i].linear && !is_row ? held + share * (inputs_[i][row + 1] - held) : held);
      }
    };
    auto next = between.begin();
    for (std::size_t row = 0; row < time_.size(); ++row) {
      add(time_[row], row, true);
      if (row + 1 == time_.size()) break;
      for (; next != between.end() && *next < time_[row + 1]; ++next)
        if (*next > grid.time.back()) add(*next, row, false);
    }
    return grid;
  }

  /// Inputs as the terms of one model bend them: their columns, none where nothing bends any, and by row what those do
  /// until the next that pass a store.
  struct Bent {
    std::vector<std::vector<double>> columns;
    std::vector<std::vector<InputCourse>> courses;
  };
  [[nodiscard]] Bent bent_inputs(const Model& model, const std::vector<double>& time,
                                 const std::vector<std::vector<double>>& as_recorded) const {
    const auto& equations = model.equations;
    std::vector<std::string> names;
    for (const auto& input : equations.inputs) names.push_back(input.symbol);
    if (std::none_of(model.terms.begin(), model.terms.end(), [&](const Term& term) {
          return std::find(names.begin(), names.end(), term.on) != names.end();
        }))
      return {};
    Bent bent{as_recorded, {}};
    for (std::size_t i = 0; i < names.size(); ++i) {
      const bool held = !equations.inputs[i].linear;
      bent.courses.push_back(bend_by_store(model, names[i], time, bent.columns[i], held));
      if (bent.courses.back().empty()) bend(model, names[i], time, bent.columns[i], held);
    }
    run_over(model, names, bent.columns);
    return bent;
  }

  /// What the outputs were between the rows: at either end of each piece of the way, and by how much they lie halfway above the
  /// straight line. Where a held input jumps an output has two values at one instant.
  template <std::size_t lanes>
  struct Between {
    struct Course {
      std::vector<double> values, arches;
      double halfway = std::nan("");
    };
    std::vector<std::array<Course, lanes>> of;  // by output
    std::vector<double> time;
    std::vector<std::size_t> rows;  // where each row stands in these

    void add(EquationsMachine<lanes>& machine, double now) {
      const bool goes = !time.empty() && now > time.back();
      for (std::size_t o = 0; o < of.size(); ++o)
        for (std::size_t l = 0; l < lanes; ++l) {
          auto& [values, arches, halfway] = of[o][l];
          const double value = machine.output(o)[l];
          arches.push_back(goes && std::isfinite(halfway) ? halfway - 0.5 * (values.back() + value) : 0.0);
          values.push_back(value);
        }
      time.push_back(now);
    }
    void add_halfway(EquationsMachine<lanes>& machine) {
      for (std::size_t o = 0; o < of.size(); ++o)
        for (std::size_t l = 0; l < lanes; ++l) of[o][l].halfway = machine.output(o)[l];
    }
  };
  /// A parabola is near what fades within two time constants.
  static int pieces_for(double turn) {
    constexpr double bears = 1.0, most = 8.0;
    return static_cast<int>(std::clamp(std::ceil(turn / bears), 1.0, most));
  }

  template <std::size_t lanes>
  void run_lanes(const std::array<const Model*, lanes>& models,
                 const std::array<Outputs*, lanes>& outputs) const {
    EquationsMachine<lanes> machine{compiled_, models};
    const auto& equations = models[0]->equations;
    const auto grid = changes_between_rows<lanes>(models);
    const auto& time = grid ? grid->time : time_;
    const auto& recorded = grid ? grid->inputs : inputs_;
    const std::size_t n = time.size(), count = equations.outputs.size();
    std::array<Bent, lanes> bent;
    std::array<const std::vector<std::vector<double>>*, lanes> inputs;
    typename EquationsMachine<lanes>::State s{};
    std::vector<std::vector<double*>> out(count, std::vector<double*>(lanes, nullptr));
    for (std::size_t l = 0; l < lanes; ++l) {
      const Model& model = *models[l];
      bent[l] = bent_inputs(model, time, recorded);
      inputs[l] = bent[l].columns.empty() ? &recorded : &bent[l].columns;
      for (std::size_t i = 0; i < machine.states(); ++i)
        s[i][l] = model.value(equations.states[i].name + ".initial");
      for (std::size_t o = 0; o < first_.size(); ++o)  // an output that is a state, given in the first row
        for (std::size_t i = 0; i < machine.states(); ++i)
          if (std::isfinite(first_[o]) && equations.outputs[o].expression == equations.states[i].name)
            s[i][l] = first_[o];
      if (outputs[l] == nullptr) continue;
      outputs[l]->assign(count, std::vector<double>(time_.size(), 0.0));
      for (std::size_t o = 0; o < count; ++o) out[o][l] = (*outputs[l])[o].data();
    }
    machine.balance_hidden(s, time.empty() ? 0.0 : time.front());
    const bool back = looks_back(*models[0]);
    Between<lanes> between;
    between.of.resize(back ? count : 0);
    const bool closed = !equations.controlled_input.empty() && machine.controlled() >= machine.states();
    std::array<std::vector<Bending>, lanes> way;  // from the controller to the machine
    if (closed)
      for (std::size_t l = 0; l < lanes; ++l) {
        way[l] = bendings(*models[l], equations.controlled_input, true, false);
        if (!way[l].empty() && way[l].back().is_store()) way[l].back().give_rows();
      }
    std::array<InputCourse, lanes> commanded_course{};
    double commanded_at = 0.0;
    typename EquationsMachine<lanes>::Rates own, fastest;
    auto restart = restarts_.begin();
    for (std::size_t at = 0, row = 0; at < n; ++at) {
      const bool is_row = !grid || grid->is_row[at];
      if (is_row && restart != restarts_.end() && restart->row == row) {
        for (std::size_t i = 0; i < machine.states(); ++i)
          for (std::size_t l = 0; l < lanes; ++l)
            s[i][l] = models[l]->parameters[restart->parameters[i]].value;
        if (row == 0)
          machine.balance_hidden(s, time[at]);
        else
          machine.go_on_from(s, time[at]);
        ++restart;
      }
      const std::size_t commanded_input = closed ? machine.controlled() - machine.states() : inputs_.size();
      for (std::size_t i = 0; i < inputs_.size(); ++i)
        for (std::size_t l = 0; (is_row || i != commanded_input) && l < lanes; ++l)
          machine.set_input(i, l, (*inputs[l])[i][at]);
      machine.show(s, time[at]);
      if (closed && is_row) {
        const double* commanded = machine.law();
        for (std::size_t l = 0; l < lanes; ++l) {
          double felt = commanded[l], before = felt;
          for (auto& bending : way[l])
            before = felt, felt = bending(time_[row], step_about(time_, row, true), felt);
          machine.set_input(commanded_input, l, felt);
          if (!way[l].empty() && way[l].back().is_store())
            commanded_course[l] = way[l].back().course(before, 0.0, felt), commanded_at = time_[row];
        }
      }
      if (is_row && row % std::max<std::size_t>(1, time_.size() / 32) == 0) {
        const auto renew = [&](auto& rates, bool of_own) {  // where it was fast, it may soon be again
          const auto now = machine.fastest(s, time[at], of_own);
          rates.radius = std::max(now.radius, 0.5 * rates.radius);
          rates.swing = std::max(now.swing, 0.5 * rates.swing);
        };
        if (machine.has_added_states()) {
          renew(own, true);
          const double usual = (time_.back() - time_.front()) / static_cast<double>(time_.size());
          machine.set_shortest(usual / parts_for(usual * own.swing) / 2.5);
        }
        renew(fastest, false);
      }
      machine.show(s, time[at]);
      if (is_row || back) machine.work_out_outputs();
      if (back) between.add(machine, time[at]);
      if (is_row) {
        if (back) between.rows.push_back(between.time.size() - 1);
        for (std::size_t o = 0; o < count; ++o)
          for (std::size_t l = 0; l < lanes; ++l)
            if (out[o][l] != nullptr) out[o][l][row] = machine.output(o)[l];
        ++row;
      }
      if (at + 1 == n) break;
      const double h = time[at + 1] - time[at];
      if (!(h > 0.0)) continue;
      // What is faster than the shortest explicit steps bear is at its balance after an implicit one; the rest needs few.
      constexpr double stiff_parts = 15.0;
      const int pieces = back ? 2 * pieces_for(h * fastest.radius) : 1;
      const double step = h / pieces;
      const bool stiff = step * fastest.radius > 1.5 * most_parts;
      int parts = static_cast<int>(stiff ? stiff_parts : parts_for(step * fastest.swing));
      machine.set_stiff(stiff);
      const auto follow = [&](std::size_t input, std::size_t lane, const InputCourse& course, double from) {
        machine.set_input(input, lane, course, from);
        parts = std::max(parts, parts_for_fading(course, step));
      };
      for (std::size_t i = 0; i < inputs_.size(); ++i)
        for (std::size_t l = 0; l < lanes; ++l) {
          const auto& values = (*inputs[l])[i];
          if (i == commanded_input) {
            if (!way[l].empty() && way[l].back().is_store()) follow(i, l, commanded_course[l], commanded_at);
            continue;
          }
          if (!bent[l].courses.empty() && !bent[l].courses[i].empty())
            follow(i, l, bent[l].courses[i][at], time[at]);
          else if (equations.inputs[i].linear)
            machine.set_input(i, l, {values[at], (values[at + 1] - values[at]) / h}, time[at]);
        }
      for (int piece = 0; piece < pieces; ++piece) {
        const double t = time[at] + piece * step;
        fastest.swing = std::max(fastest.swing, finely(machine, s, t, step, parts, stiff));
        if (!back) continue;
        const double end = piece + 1 == pieces ? time[at + 1] : t + step;
        machine.show(s, end);
        machine.work_out_outputs();
        piece % 2 == 0 ? between.add_halfway(machine) : between.add(machine, end);
      }
      machine.hold_inputs();
    }
    std::vector<std::string> names;
    for (const auto& output : equations.outputs) names.push_back(place_of_output(equations, output.name));
    for (std::size_t l = 0; l < lanes; ++l) {
      if (outputs[l] == nullptr) continue;
      run_over(*models[l], names, *outputs[l]);
      for (std::size_t o = 0; o < count; ++o) {
        auto& column = (*outputs[l])[o];
        if (back) {
          auto& all = between.of[o][l];
          bend(*models[l], names[o], between.time, all.values, false, all.arches);
          for (std::size_t row = 0; row < column.size(); ++row) column[row] = all.values[between.rows[row]];
        } else {
          bend(*models[l], names[o], time_, column, false);
        }
        for (double& value : (*outputs[l])[o]) value = equations.outputs[o].limits.clamp(value);
      }
    }
  }

  /// Advances in so many steps, or in more where what moves turns farther in one than the rule of a step bears: rates are
  /// looked at in a few rows alone, and between two of them a store may run empty. [1/s] what it took for.
  template <std::size_t lanes>
  double finely(EquationsMachine<lanes>& machine, typename EquationsMachine<lanes>::State& s, double t,
                double h, int parts, bool stiff) const {
    constexpr double bears = 2.5;
    constexpr double is_jump = 0.8;
    const auto before = s;
    machine.advance(s, t, h, parts);
    double turned = machine.turned(), swing = 0.0;
    while (!stiff && turned > bears && 2 * parts <= static_cast<int>(most_parts)) {
      machine.take_back();
      s = before;
      machine.advance(s, t, h, 2 * parts);
      if (!(machine.turned() < is_jump * turned)) break;
      parts *= 2, turned = machine.turned(), swing = parts * turn_ / h;
    }
    return swing;
  }

  /// What fades far within a step acts at its beginning, and only so finely is that known.
  static int parts_for_fading(const InputCourse& course, double h) {
    constexpr double trifle = 1e-3, most = 4.0;
    if (!(std::abs(course.fading) > trifle * std::abs(course.value))) return 1;
    return static_cast<int>(std::clamp(std::ceil(h / course.time_constant), 1.0, most));
  }

  static constexpr double most_parts = 60.0;
  /// Steps of the classical Runge-Kutta rule over a time in which the fastest turns so far [rad].
  [[nodiscard]] double parts_for(double turn) const {
    return std::clamp(std::ceil(turn / turn_), 1.0, most_parts);
  }

  std::vector<double> time_;
  double turn_;
  std::vector<Restart> restarts_;
  CompiledEquations compiled_;
  std::vector<std::vector<double>> inputs_;
  std::vector<double> first_;
};

}  // namespace

std::unique_ptr<Simulation> prepare_equations(const Model& structure, const Record& inputs) {
  return std::make_unique<OwnEquations>(structure, inputs);
}

}  // namespace invar::physics

#include "core/physics/equations_columns.hpp"

#include <algorithm>
#include <cmath>

#include "core/physics/static_plants.hpp"

namespace invar::physics {

Bending::Bending(const Term& term, bool held, bool has_changes)
    : kind_{equations_kind(*term.info)->memory},
      course_{term.curve.knots.empty() ? nullptr : &term.curve},
      goes_with_time_{term.curve.over == "t"},
      first_{term.values[0]},
      second_{term.values[1]},
      held_{held},
      has_changes_{has_changes} {}

double Bending::through_store(double step, double value, double arch) {
  if (!begun_) store_ = last_ = value;
  const double kept = std::exp(-step / time_constant());
  double felt = store_;
  if (held_) {
    if (step > 0.0 && !at_rows_) felt = value + (store_ - value) * (1.0 - kept) * time_constant() / step;
    store_ = value + (store_ - value) * kept;
  } else if (begun_ && step > 0.0) {
    // Of last + (rise + 4 arch) s - 4 arch s^2, with s from 0 to 1 over the step, and the store's first-order equation.
    const double times = time_constant() / step, bow = 4.0 * arch,
                 behind = times * (value - last_ + bow + 2.0 * times * bow);
    felt = store_ = value - behind + 2.0 * times * bow + (store_ - last_ + behind) * kept;
  }
  last_ = value;
  return value + share() * (felt - value);
}

double Bending::late(double now, double value, double arch) {
  times_.push_back(now);
  values_.push_back(value);
  arches_.push_back(arch);
  const double when = now - first_, rounding = has_changes_ ? 1e-12 * std::abs(now) : 0.0;
  while (place_ + 1 < times_.size() && times_[place_ + 1] <= when + rounding) ++place_;
  if (has_changes_) return values_[place_];
  const std::size_t next = std::min(place_ + 1, times_.size() - 1);
  const double h = times_[next] - times_[place_];
  const double share = h > 0.0 ? std::clamp((when - times_[place_]) / h, 0.0, 1.0) : 0.0;
  return values_[place_] + share * (values_[next] - values_[place_]) +
         4.0 * arches_[next] * share * (1.0 - share);
}

double Bending::operator()(double now, double step, double value, double arch) {
  if (course_ != nullptr) return value + (*course_)(goes_with_time_ ? now : value);
  double bent = value;
  switch (kind_) {
    case EquationsMemory::upper_limit:
      bent = std::min(value, first_);
      break;
    case EquationsMemory::lower_limit:
      bent = std::max(value, first_);
      break;
    case EquationsMemory::dead_zone:
      bent = value - std::clamp(value, -first_, first_);
      break;
    case EquationsMemory::lag:
    case EquationsMemory::hidden_state:
      if (time_constant() > 0.0) bent = through_store(step, value, arch);
      break;
    case EquationsMemory::delay:
      if (first_ > 0.0) bent = late(now, value, arch);
      break;
    default:
      break;
  }
  begun_ = true;
  return bent;
}

std::vector<Bending> bendings(const Model& model, const std::string& on, bool held, bool has_changes) {
  std::vector<Bending> all;
  for (const auto& term : model.terms)
    if (term.on == on && !is_added(term)) all.emplace_back(term, held, has_changes);
  return all;
}

double step_about(const std::vector<double>& time, std::size_t row, bool held) {
  const std::size_t end = held ? std::min(row + 1, time.size() - 1) : row;
  return end > 0 ? time[end] - time[end - 1] : 0.0;
}

std::string place_of_output(const Equations& equations, const std::string& output) {
  const bool is_state = std::any_of(equations.states.begin(), equations.states.end(),
                                    [&](const auto& state) { return state.name == output; });
  return is_state ? "output." + output : output;
}

bool sticks(const Term& term) {
  return equations_kind(*term.info)->memory == EquationsMemory::dry_friction && term.with == term.on;
}

bool is_felt_otherwise(const Term& term) {
  const auto* kind = equations_kind(*term.info);
  return kind != nullptr && (kind->memory == EquationsMemory::delay || kind->memory == EquationsMemory::lag ||
                             kind->memory == EquationsMemory::dead_zone);
}

bool is_felt_by_others_alone(const Term& term) { return term.with == "others" && is_felt_otherwise(term); }

bool is_added(const Term& term) {
  const auto* kind = equations_kind(*term.info);
  if (!term.curve.knots.empty()) return term.curve.over != "t" && term.curve.over != term.on;
  return kind != nullptr && (kind->rate != nullptr || kind->memory == EquationsMemory::dry_friction);
}

const std::string& goes_over(const Term& term) {
  return term.with.empty() || is_felt_by_others_alone(term) ? term.on : term.with;
}

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

void bend(const Model& model, const std::string& on, const std::vector<double>& time,
          std::vector<double>& values, bool held, const std::vector<double>& arches) {
  bool is_as_given = !arches.empty();
  for (auto& bending : bendings(model, on, held, held)) {
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = bending(time[i], step_about(time, i, held), values[i], is_as_given ? arches[i] : 0.0);
    is_as_given = false;
  }
}

bool looks_back(const Model& model) {
  const auto& outputs = model.equations.outputs;
  if (std::any_of(model.terms.begin(), model.terms.end(), [&](const Term& term) {
        return equations_kind(*term.info)->memory == EquationsMemory::overflow &&
               std::any_of(outputs.begin(), outputs.end(), [&](const auto& output) {
                 return term.on == place_of_output(model.equations, output.name);
               });
      }))
    return false;  // what runs over from one output to another is only known at the rows
  return std::any_of(outputs.begin(), outputs.end(), [&](const auto& output) {
    const auto all = bendings(model, place_of_output(model.equations, output.name), false, false);
    return !all.empty() && all.front().looks_back();
  });
}

std::vector<InputCourse> bend_by_store(const Model& model, const std::string& on,
                                       const std::vector<double>& time, std::vector<double>& values,
                                       bool held) {
  auto all = bendings(model, on, held, held);
  const bool overflows = std::any_of(model.terms.begin(), model.terms.end(), [](const Term& term) {
    return equations_kind(*term.info)->memory == EquationsMemory::overflow;
  });
  if (all.empty() || !all.back().is_store() || overflows) return {};
  all.back().give_rows();
  std::vector<double> before(values.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (k + 1 == all.size()) before = values;
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = all[k](time[i], step_about(time, i, held), values[i]);
  }
  std::vector<InputCourse> courses;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double h = i + 1 < values.size() ? time[i + 1] - time[i] : 0.0;
    courses.push_back(
        all.back().course(before[i], !held && h > 0.0 ? (before[i + 1] - before[i]) / h : 0.0, values[i]));
  }
  return courses;
}

}  // namespace invar::physics

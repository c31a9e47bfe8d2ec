#include "core/model/record_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/base/unit.hpp"
#include "core/model/own_expressions.hpp"
#include "core/physics/counted_units.hpp"

namespace invar::model {

namespace {

/// What SI counts in, and with it every unit that is none of its own.
constexpr std::array si_units{"m", "kg", "s", "A", "K", "rad"};

/// Does one of the model's numbers stand in this unit, alone (`cm`) or in another (`cm/s`, `cm3`)?
bool speaks_in(const physics::Model& model, const std::string& unit) {
  const auto is_letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; };
  return std::any_of(model.parameters.begin(), model.parameters.end(), [&](const physics::Parameter& p) {
    for (auto at = p.unit.find(unit); at != std::string::npos; at = p.unit.find(unit, at + 1)) {
      const auto end = at + unit.size();
      if ((at == 0 || !is_letter(p.unit[at - 1])) && (end == p.unit.size() || !is_letter(p.unit[end])))
        return true;
    }
    return false;
  });
}

/// Do they stand in the parts of this unit (`mg/s` beside `mg/l`), and in none of those that SI would put in their place?
bool speaks_in_parts(const physics::Model& model, const std::string& unit) {
  bool any = false;
  for (std::size_t at = 0; at < unit.size();) {
    const auto is_name = [&](std::size_t i) {
      return std::isalpha(static_cast<unsigned char>(unit[i])) != 0;
    };
    if (!is_name(at)) {
      ++at;
      continue;
    }
    auto end = at;
    while (end < unit.size() && is_name(end)) ++end;
    const auto part = unit.substr(at, end - at);
    at = end;
    const auto size = parse_unit(part);
    if (!size || std::abs(size->factor - 1.0) < 1e-12) continue;
    const bool speaks_si = std::any_of(si_units.begin(), si_units.end(), [&](const char* si) {
      return parse_unit(si)->dimension == size->dimension && speaks_in(model, si);
    });
    if (speaks_si || !speaks_in(model, part)) return false;
    any = true;
  }
  return any;
}

/// A state that is an output as it stands, and the unit of its numbers; nothing of both where it is none or says no unit.
struct OwnState {
  std::string name, unit;
};
OwnState state_of(const physics::Signal& signal, const physics::Model& model) {
  for (const auto& output : model.equations.outputs) {
    if (output.name != signal.name) continue;
    auto name = output.expression;
    std::erase(name, ' ');
    const auto* initial = model.find(name + ".initial");
    if (initial != nullptr && initial->unit != "1") return {name, initial->unit};
  }
  return {};
}

/// What a header may say of it: the state's unit, where it is one.
std::string known_unit(const OwnState& state) { return parse_unit(state.unit) ? state.unit : std::string{}; }

/// Throws where a column says that it measures something else than the state that it is compared with.
void check_own_unit(const recording::Column& column, const OwnState& state, const std::string& where) {
  if (state.unit.empty() || column.unit == state.unit) return;
  const auto of_column = parse_unit(column.unit), of_state = parse_unit(state.unit);
  const bool is_label = !of_state && of_column;  // the model's unit is a name of the user's own
  if (is_label || column.unit == "1" || column.unit == "-") return;
  if (of_column && of_column->same_quantity(*of_state)) return;
  throw InputError{where + ": column `" + column.name + "`",
                   "is in `" + column.unit + "`, the model's `" + state.name + "` in `" + state.unit + "`",
                   of_column ? "name the right column, or mend one of the two units"
                             : "write a unit that is known, or the model's own, into the header"};
}

/// [rad/s] of a turn a minute.
constexpr double radians_per_rpm = 2.0 * std::numbers::pi / 60.0;

/// The factor of turns a minute where the model's numbers are angles; nothing where they are not.
std::optional<double> of_turns(const OwnState& state, const physics::Model& model) {
  constexpr std::size_t radian = 5;
  if (const auto unit = parse_unit(state.unit); unit && !state.unit.empty())
    return unit->dimension[radian] == 1.0 ? std::optional{radians_per_rpm / unit->factor} : std::nullopt;
  if (speaks_in(model, "rad") && !speaks_in(model, "Hz")) return radians_per_rpm;
  return std::nullopt;
}

/// The factor where a column counts turns (Hz, rpm) and its state angles, or the other way round; nothing elsewhere.
std::optional<double> turns_to_angles(const std::string& column, const std::string& state) {
  constexpr std::size_t radian = 5;
  const auto is_angle = [](const std::string& text) {
    const auto unit = parse_unit(text);
    return unit && unit->dimension[radian] == 1.0;
  };
  const auto counts_turns = [&](const std::string& text) {
    return parse_unit(text) && !is_angle(text) &&
           (text.find("Hz") != std::string::npos || text.find("rpm") != std::string::npos);
  };
  if (!(counts_turns(column) && is_angle(state)) && !(is_angle(column) && counts_turns(state)))
    return std::nullopt;
  const auto to = conversion(column, state);
  return to ? std::optional{to->factor} : std::nullopt;
}

/// Is a temperature of the model's states counted in this unit, `K` or `degC`?
bool has_states_in(const physics::Model& model, const std::string& unit) {
  const auto wanted = parse_unit(unit);
  return std::any_of(model.equations.states.begin(), model.equations.states.end(), [&](const auto& state) {
    const auto* initial = model.find(state.name + ".initial");
    const auto own = initial != nullptr ? parse_unit(initial->unit) : std::nullopt;
    return own && own->dimension == wanted->dimension && own->factor == wanted->factor &&
           own->offset == wanted->offset;
  });
}

/// A temperature from zero or from freezing, where all the states' count from the other; nothing where that is open.
std::optional<ColumnUnit> to_the_states_zero(const recording::Column& column, const physics::Model& model) {
  constexpr const char* celsius = "degC";
  const auto unit = parse_unit(column.unit);
  const auto to = conversion(column.unit, celsius);
  if (!unit || !to || unit->dimension != parse_unit(celsius)->dimension) return std::nullopt;
  const bool absolute = column.unit == "K";
  const bool in_celsius = has_states_in(model, celsius), in_kelvin = has_states_in(model, "K");
  if (absolute && in_celsius && !in_kelvin) return ColumnUnit{column.unit, to->factor, to->offset};
  if (!absolute && in_kelvin && !in_celsius)
    return ColumnUnit{column.unit, to->factor, to->offset - parse_unit("K")->offset};
  return std::nullopt;
}

/// A model in the user's own expressions takes a column in SI, but as it stands where his numbers are in that unit too,
/// where it is absolute (K) and no state says otherwise, or where the unit is a name of his own; turns a minute in rad/s where his numbers are angles.
ColumnUnit unit_of_expression(const recording::Column& column, const physics::Signal& signal,
                              const physics::Model& model, const std::string& where) {
  const auto state = state_of(signal, model);
  check_own_unit(column, state, where);
  const auto unit = parse_unit(column.unit);
  if (const auto zero = to_the_states_zero(column, model)) return *zero;
  if (const auto factor = turns_to_angles(column.unit, state.unit)) return {column.unit, *factor, 0.0};
  if (!unit || column.unit == "K" || speaks_in(model, column.unit) || speaks_in_parts(model, column.unit))
    return {column.unit, 1.0, 0.0};
  if (column.unit == "rpm")
    if (const auto factor = of_turns(state, model)) return {column.unit, *factor, 0.0};
  return {column.unit, unit->factor, unit->offset};
}

/// A header's `C` and `F` beside a temperature are degrees; elsewhere they stand for charge and capacity.
recording::Column with_degrees(recording::Column column, const physics::Signal& signal,
                               const physics::Model& model) {
  if (column.unit != "C" && column.unit != "F") return column;
  const auto is_temperature = [](const std::string& unit) {
    const auto parsed = parse_unit(unit);
    return parsed && parsed->dimension == parse_unit("degC")->dimension;
  };
  const auto state = state_of(signal, model);
  const auto& compared = !signal.unit.empty() ? signal.unit : state.unit;
  const bool is_known = !compared.empty() && compared != "1";
  if (is_known ? is_temperature(compared) : has_states_in(model, "degC") || has_states_in(model, "K"))
    column.unit = "deg" + column.unit;
  return column;
}

bool commands_heater(const physics::Model& model, const physics::Signal& signal) {
  const auto& heaters = model.thermal.heaters;
  return std::any_of(heaters.begin(), heaters.end(),
                     [&](const auto& heater) { return heater.name == signal.name; });
}

/// A heater's column that is no power, where its gain is a pure number (`W`) or per something of the user's own: in SI, or as
/// it stands. A temperature commands no heater.
std::optional<ColumnUnit> as_commanded(const std::string& column, const std::string& per) {
  const auto unit = parse_unit(column);
  if (!parse_unit(per)) {
    const bool says_none = column == "1" || column == "-" || column == per;
    return says_none ? std::optional{ColumnUnit{column, 1.0, 0.0}} : std::nullopt;
  }
  if (per != "W" || (unit && unit->dimension == parse_unit("K")->dimension)) return std::nullopt;
  return unit ? ColumnUnit{column, unit->factor, unit->offset} : ColumnUnit{column, 1.0, 0.0};
}

ColumnUnit unit_of(recording::Column column, const physics::Signal& signal, const physics::Model& model,
                   const std::string& where) {
  column = with_degrees(std::move(column), signal, model);
  const auto& si = signal.unit;
  if (column.unit.empty()) return {si, 1.0, 0.0};
  if (si.empty()) return unit_of_expression(column, signal, model, where);
  const auto to = conversion(column.unit, si);
  if (!to && commands_heater(model, signal)) {
    if (const auto unit = as_commanded(column.unit, si)) return *unit;
  }
  if (!to)
    throw InputError{where + ": column `" + column.name + "`",
                     "is in `" + column.unit + "`, which is no " + si, "give it in a unit like " + si};
  return {column.unit, to->factor, to->offset};
}

}  // namespace

namespace {

/// What the model's own controller decides needs no column.
bool is_controlled(const physics::Model& model, const physics::Signal& signal) {
  const auto& inputs = model.equations.inputs;
  return std::any_of(inputs.begin(), inputs.end(), [&](const auto& input) {
    return input.signal == signal.name && input.symbol == model.equations.controlled_input;
  });
}

/// In which units the model's expressions count the columns.
physics::UnitsOfNames counted(const physics::Model& model, const RecordFile& file) {
  physics::UnitsOfNames units;
  for (const auto& signal : model.signals) {
    const auto at = file.units.find(signal.name);
    if (at == file.units.end()) continue;
    const auto& text = signal.unit.empty() ? at->second.unit : signal.unit;
    if (const auto state = state_of(signal, model);
        signal.unit.empty() && turns_to_angles(text, state.unit)) {
      units[signal.name] = {text + ", taken in " + state.unit, *parse_unit(state.unit)};
      continue;
    }
    auto unit = parse_unit(text);
    if (!unit || text.empty() || text == "1" || text == "-") continue;
    const bool converted = signal.unit.empty() && (at->second.factor != 1.0 || at->second.offset != 0.0);
    // Turns a minute may be taken in angles.
    const bool turns = text == "rpm" && at->second.factor != unit->factor;
    if (converted) unit->factor = (turns ? radians_per_rpm : unit->factor) / at->second.factor;
    units[signal.name] = {converted ? text + ", taken in SI" : text, *unit};
  }
  return units;
}

}  // namespace

namespace {

/// A sensor whose model does not say which it measures, lengths or angles, and whose columns say angles.
bool measures_angles(const recording::Table& table, const physics::Model& model) {
  const auto* signal = model.signal("true_position");
  if (model.plant != physics::Plant::sensor || signal == nullptr || model.find("resolution") != nullptr)
    return false;
  const auto* column = table.find(signal->column);
  const auto unit = column != nullptr ? parse_unit(column->unit) : std::nullopt;
  return unit && unit->dimension == parse_unit("rad")->dimension;
}

}  // namespace

RecordFile to_record(const recording::Table& table, const physics::Model& model, bool outputs_needed) {
  if (measures_angles(table, model) && !physics::is_rotary(model)) {
    auto turning = model;
    physics::count_in_angles(turning);
    return to_record(table, turning, outputs_needed);
  }
  RecordFile result;
  std::vector<Fault> faults;
  for (const auto& signal : model.signals) {
    if (signal.name == "time" && model.row_rate) {
      for (std::size_t row = 0; row < table.rows(); ++row)
        result.record.time.push_back(static_cast<double>(row) / *model.row_rate);
      continue;
    }
    const auto* column = table.find(signal.column);
    if (column == nullptr) {
      if (signal.is_output ? outputs_needed : !is_controlled(model, signal))
        faults.push_back({table.file.string(),
                          "has no column `" + signal.column + "` for `" + signal.name + "`",
                          (table.has_header ? "add it, or name the right one in the model (there are: "
                                            : "the file has no header: name columns by number (there are: ") +
                              table.names() + ")"});
      continue;
    }
    const auto unit = unit_of({column->name, column->unit, {}, {}}, signal, model, table.file.string());
    std::vector<double> values = column->values;
    for (double& value : values) value = unit.factor * value + unit.offset;
    result.units[signal.name] = unit;
    if (signal.unit == "W" && commands_heater(model, signal) && !unit.unit.empty() &&
        !conversion(unit.unit, signal.unit))
      result.doubts.push_back("column `" + signal.column + "` is in " + unit.unit + ", so the gain of `" +
                              signal.name + "` is taken in W per " +
                              (parse_unit(unit.unit) && si_unit(*parse_unit(unit.unit)).empty()
                                   ? std::string{"1"}
                               : parse_unit(unit.unit) ? si_unit(*parse_unit(unit.unit))
                                                       : unit.unit));
    if (signal.name == "time")
      result.record.time = std::move(values);
    else
      result.record.signals[signal.name] = std::move(values);
  }
  for (const auto& clash : model.plant == physics::Plant::equations && faults.empty()
                               ? clashes_of_units(model, counted(model, result))
                               : std::vector<FormulaClash>{})
    if (clash.is_size)
      faults.push_back({table.file.string(), clash.what, mend_of_clash});
    else
      result.doubts.push_back(clash.what);
  if (!faults.empty()) throw InputError{faults};
  return result;
}

void check_order(const physics::Model& model, const physics::Record& record,
                 const std::filesystem::path& file) {
  if (model.plant == physics::Plant::droplet) return;  // each on its own
  for (std::size_t row = 0; row < record.rows(); ++row) {
    const double now = record.time[row];
    if (!std::isfinite(now) || (row > 0 && now < record.time[row - 1]))
      throw InputError{file.string() + ":" + std::to_string(row + 2),
                       std::isfinite(now) ? "time goes back" : "the time is missing",
                       "put the rows in order of time"};
  }
}

recording::Table to_table(const physics::Model& model, const RecordFile& inputs,
                          const physics::Outputs& outputs) {
  recording::Table table;
  const auto add = [&](const physics::Signal& signal, std::vector<double> values) {
    ColumnUnit unit{signal.unit.empty() ? known_unit(state_of(signal, model)) : signal.unit, 1.0, 0.0};
    if (const auto driven = inputs.units.find("true_position"); driven != inputs.units.end())
      if (const auto given = parse_unit(driven->second.unit);
          given && given->dimension == parse_unit("rad")->dimension)
        unit.unit = physics::rotary_unit(unit.unit);
    if (const auto at = inputs.units.find(signal.name); at != inputs.units.end()) unit = at->second;
    for (double& value : values) value = (value - unit.offset) / unit.factor;
    table.add(signal.column, unit.unit, std::move(values));
  };
  if (const auto* time = model.signal("time")) add(*time, inputs.record.time);
  std::size_t at = 0;
  for (const auto& signal : model.signals)
    if (signal.is_output) add(signal, outputs[at++]);
  return table;
}

}  // namespace invar::model

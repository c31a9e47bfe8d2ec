#include "tools/diagnose/data.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>

#include "core/base/unit.hpp"
#include "core/model/recording_file.hpp"
#include "core/physics/approach.hpp"
#include "core/physics/counted_units.hpp"
#include "tools/diagnose/clock.hpp"
#include "tools/diagnose/even_rows.hpp"
#include "tools/diagnose/hiccups.hpp"
#include "tools/diagnose/lone_inputs.hpp"
#include "tools/diagnose/misrecorded.hpp"
#include "tools/diagnose/shorten.hpp"
#include "tools/diagnose/statistics.hpp"
#include "tools/report/page.hpp"

namespace invar::diagnose {

namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// Rows in order of time, one a time stamp. Column by column: an hour at 1 kHz is not held twice.
void put_in_order(physics::Record& record, DataCount& count) {
  const auto& time = record.time;
  std::vector<std::size_t> order;
  order.reserve(time.size());
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (std::isfinite(time[i]))
      order.push_back(i);
    else
      ++count.missing;
  }
  std::size_t out_of_order = 0;
  for (std::size_t i = 1; i < order.size(); ++i)
    if (time[order[i]] < time[order[i - 1]]) ++out_of_order;
  if (out_of_order > 0)
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return time[a] < time[b]; });
  count.out_of_order += out_of_order;
  const auto twice =
      std::unique(order.begin(), order.end(), [&](auto a, auto b) { return time[a] >= time[b]; });
  count.duplicates += static_cast<std::size_t>(order.end() - twice);
  order.erase(twice, order.end());
  std::vector<double> column;
  const auto reorder = [&](std::vector<double>& values) {
    column.clear();
    for (const auto i : order) column.push_back(values[i]);
    column.swap(values);
  };
  for (auto& [name, values] : record.signals) reorder(values);
  reorder(record.time);  // last: the order is by it
}

/// How many rows on a reading has usually moved by no more than a small part of the way that it goes: forty rows of a swing.
std::size_t rows_alike(const std::vector<double>& values) {
  constexpr double small = 0.05;
  std::vector<double> known, steps;
  for (const double v : values)
    if (std::isfinite(v)) known.push_back(v);
  if (known.size() < 8) return values.size();  // a start value
  const auto [low, high] = std::minmax_element(known.begin(), known.end());
  const double bears = small * (*high - *low);
  std::size_t alike = 1;
  for (std::size_t every = 2; every < known.size() / 8; ++every) {
    steps.clear();
    for (std::size_t i = every; i < known.size(); i += every)
      steps.push_back(std::abs(known[i] - known[i - every]));
    if (!(median(steps) <= bears)) break;
    alike = every;
  }
  return alike;
}

/// A model without inputs loses nothing by rows that lie closer than its motion: no more rows than these in one file, and where
/// the motion allows it no more in all files together.
void thin(physics::Record& record, const std::vector<std::string>& outputs, std::size_t files) {
  constexpr std::size_t most = 6000;
  const auto parted = [&](std::size_t rows) { return (rows + most - 1) / most; };
  std::size_t alike = record.rows();
  for (const auto& output : outputs)
    if (const auto* values = record.find(output); values != nullptr && files > 1)
      alike = std::min(alike, rows_alike(*values));
  const std::size_t every =
      std::max(parted(record.rows()), files > 1 ? std::min(alike, parted(files * record.rows())) : 1);
  if (every < 2) return;
  const auto thinned = [every](std::vector<double>& values) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < values.size(); i += every) values[kept++] = values[i];
    values.resize(kept);
  };
  thinned(record.time);
  for (auto& [name, values] : record.signals) thinned(values);
}

double median_step(const std::vector<double>& time) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.size(); ++i) steps.push_back(time[i] - time[i - 1]);
  return steps.empty() ? 1.0 : median(steps);
}

/// Heat is slow: the straight line through the first rows (Theil and Sen's: one slip among them moves it little), at the first
/// of them, and what of the noise of one row is left in it. Nothing where too few were read.
std::optional<std::pair<double, double>> line_at_first(const std::vector<double>& time,
                                                       const std::vector<double>& values) {
  constexpr std::size_t most = 8, enough = 5;
  std::vector<std::pair<double, double>> rows;
  for (std::size_t i = 0; i < std::min(most, values.size()); ++i)
    if (std::isfinite(values[i])) rows.emplace_back(time[i] - time[0], values[i]);
  if (rows.size() < enough) return std::nullopt;
  std::vector<double> slopes, levels;
  double t = 0.0, tt = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    t += rows[i].first, tt += rows[i].first * rows[i].first;
    for (std::size_t k = 0; k < i; ++k)
      slopes.push_back((rows[i].second - rows[k].second) / (rows[i].first - rows[k].first));
  }
  const double slope = median(slopes);
  for (const auto& [after, value] : rows) levels.push_back(value - slope * after);
  const double n = static_cast<double>(rows.size());
  return std::pair{median(levels), std::sqrt(tt / (n * tt - t * t))};
}

/// What a reading is from the first row on while the reference rests, where that is off what is expected by less than one
/// reading tells. Nothing where too few rows were read before the reference moves, or where it goes elsewhere.
std::optional<double> rests_beside(double expected, const std::vector<double>& reference,
                                   const std::vector<double>& values) {
  constexpr std::size_t enough = 50, first = 10;    // rows
  constexpr double plainly_off = 4.0, alike = 2.5;  // standard errors
  double sum = 0.0, sum_of_first = 0.0, count = 0.0, count_of_first = 0.0;
  std::size_t rows = 0;
  for (; rows < values.size() && reference[rows] == reference[0]; ++rows) {
    if (!std::isfinite(values[rows])) continue;
    sum += values[rows], ++count;
    if (rows < first) sum_of_first += values[rows], ++count_of_first;
  }
  if (rows < enough || count < 0.5 * static_cast<double>(rows) || count_of_first == 0.0) return std::nullopt;
  const double mean = sum / count, spread = spread_of_differences(
                                       {values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rows)});
  const bool is_off = std::abs(mean - expected) > plainly_off * spread / std::sqrt(count),
             from_the_first_on =
                 std::abs(sum_of_first / count_of_first - mean) < alike * spread / std::sqrt(count_of_first);
  return is_off && from_the_first_on ? std::optional{mean} : std::nullopt;
}

/// An initial state is a column whose first row alone is filled.
void give_first(physics::Record& inputs, const std::string& signal, double value) {
  auto& column = inputs.signals[signal];
  column.assign(inputs.rows(), nothing);
  column.front() = value;
}

/// A loop that stands still and yet commands: its sum is not zero, the first command says how much it holds.
void give_start_of_sum(const Case& data, Recording& recording) {
  auto& inputs = recording.inputs;
  const auto* reference = inputs.find("reference");
  const auto* forward = inputs.find("feedforward");
  if (!data.model.controller || reference == nullptr || inputs.rows() < 8) return;
  const auto& position = recording.measured[0];
  const auto& current = recording.measured[1];
  if ((*reference)[5] != (*reference)[0] || !std::isfinite(position[0]) || !std::isfinite(current[0])) return;
  physics::AxisController fresh{*data.model.controller};
  const double expected =
      fresh.step((*reference)[0], position[0]) + (forward != nullptr ? forward->front() : 0.0);
  if (!(std::abs(current[0] - expected) > 6.0 * spread_of_differences(current))) return;
  give_first(inputs, "current", rests_beside(expected, *reference, current).value_or(current[0]));
}

/// [m/s] The steady speed at which a carriage comes into the recording; nothing where it rests, or begins to move.
std::optional<double> comes_at(const std::vector<double>& time, const std::vector<double>& position) {
  constexpr std::size_t rows = 8;
  constexpr double alike = 0.2, plainly = 10.0;
  if (position.size() < rows ||
      !std::all_of(position.begin(), position.begin() + rows, [](double v) { return std::isfinite(v); }))
    return std::nullopt;
  const auto speed = [&](std::size_t from, std::size_t to) {
    return (position[to] - position[from]) / (time[to] - time[from]);
  };
  const double v = speed(0, rows - 1), early = speed(0, rows / 2 - 1), late = speed(rows / 2, rows - 1);
  const double noise = spread_of_differences(position) / (time[rows / 2 - 1] - time[0]);
  if (!(std::abs(v) > plainly * noise) || std::abs(early - late) > alike * std::abs(v) + 3.0 * noise)
    return std::nullopt;
  return early - 0.375 * (late - early);  // at the first row, 1.5 rows before the middle of the early half
}

/// The initial state, where the first rows contradict the one that the model starts from.
void give_start(Case& data, Recording& recording) {
  using physics::Plant;
  auto& inputs = recording.inputs;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto& name = data.outputs[o];
    // The very first value alone: a few rows later the machine may be on its way.
    double begin = nothing;
    for (std::size_t i = 0; i < std::min<std::size_t>(2, inputs.rows()) && !std::isfinite(begin); ++i)
      begin = recording.measured[o][i];
    double spread = 1.5 * spread_of_differences(recording.measured[o]);
    double expected = nothing, doubt = 0.0;
    if (data.model.plant == Plant::thermal) {
      const auto* ambient = inputs.find("ambient");
      expected = ambient != nullptr ? ambient->front() : data.model.value("ambient", 20.0);
      if (ambient == nullptr && data.model.find("ambient")->sigma) doubt = *data.model.find("ambient")->sigma;
      if (ambient != nullptr) doubt = 1.5 * spread_of_differences(*ambient);
      if (const auto line = line_at_first(inputs.time, recording.measured[o])) {
        begin = line->first;
        spread *= line->second;
      }
    } else if (data.model.plant == Plant::axis && name == "position") {
      const auto* reference = inputs.find("reference");
      expected = data.model.controller && reference != nullptr ? reference->front() : 0.0;
      doubt = 1e-6;
      if (reference != nullptr && reference->size() > 5) doubt += std::abs((*reference)[5] - (*reference)[0]);
    }
    if (const auto* reference = inputs.find("reference");
        data.model.controller && reference != nullptr && name == "position")
      if (const auto at = rests_beside(reference->front(), *reference, recording.measured[o]))
        begin = *at, spread = doubt = 0.0;
    // A loop without a sum may have been on its way: its first rows say how it came.
    const bool has_no_sum = name == "position" && data.model.controller &&
                            data.model.controller->kind == physics::AxisControllerSettings::Kind::cascade;
    const auto speed = has_no_sum ? comes_at(inputs.time, recording.measured[o]) : std::nullopt;
    if (speed) doubt = 1e-6;
    if (!std::isfinite(begin) || !std::isfinite(expected) ||
        !(std::abs(begin - expected) > 4.0 * std::hypot(spread, doubt)))
      continue;
    give_first(inputs, name, begin);
    if (speed) give_first(inputs, "velocity", *speed);
  }
}

/// The reference at `t` by the cubic through the values and slopes on both sides of the gap before row `i`.
double across(const physics::Record& inputs, const std::vector<double>& values, std::size_t i, double t) {
  const auto& time = inputs.time;
  const double h = time[i] - time[i - 1], s = (t - time[i - 1]) / h;
  const double before = i > 1 ? (values[i - 1] - values[i - 2]) / (time[i - 1] - time[i - 2]) * h : 0.0;
  const double after =
      i + 1 < values.size() ? (values[i + 1] - values[i]) / (time[i + 1] - time[i]) * h : 0.0;
  const double d = values[i] - values[i - 1];
  return values[i - 1] + s * (before + s * (3.0 * d - 2.0 * before - after + s * (before + after - 2.0 * d)));
}

/// In a gap nobody knows what the reference did, and the loop goes on to feel it for a while. What its bridge by a cubic
/// and by a straight line make different in the simulation shows where: there nothing is compared.
void bridge_gaps(const physics::Model& model, Recording& recording, double step) {
  constexpr double longest_bridge = 500.0, until_forgotten = 300.0;  // rows
  auto& inputs = recording.inputs;
  const auto reference = physics::bridged(inputs.time, inputs.signals.at("reference"));
  physics::Record whole;
  std::vector<std::size_t> place;  // of each row among those of `whole`
  for (std::size_t i = 0; i < inputs.rows(); ++i) {
    const double gap = i > 0 ? inputs.time[i] - inputs.time[i - 1] : 0.0;
    if (gap > longest_bridge * step)  // a pause: the loop starts anew behind it
      for (std::size_t k = i; k < inputs.rows() && inputs.time[k] < inputs.time[i] + until_forgotten * step;
           ++k)
        for (auto& values : recording.measured) values[k] = nothing;
    else if (gap > 2.5 * step)
      for (double t = inputs.time[i - 1] + step; t < inputs.time[i] - 0.5 * step; t += step) {
        whole.time.push_back(t);
        whole.signals["reference"].push_back(across(inputs, reference, i, t));
      }
    place.push_back(whole.time.size());
    whole.time.push_back(inputs.time[i]);
    whole.signals["reference"].push_back(reference[i]);
  }
  if (whole.time.size() == inputs.rows()) return;
  const auto spread_out = [&](const std::vector<double>& values) {
    std::vector<double> all(whole.time.size(), nothing);
    for (std::size_t i = 0; i < place.size(); ++i) all[place[i]] = values[i];
    return all;
  };
  for (const auto& [name, values] : inputs.signals)
    if (name != "reference") whole.signals[name] = spread_out(values);
  std::vector<std::vector<double>> measured;
  for (const auto& values : recording.measured) measured.push_back(spread_out(values));
  std::shared_ptr<const physics::Simulation> by_cubic = physics::prepare(model, whole);
  physics::Outputs straight, cubic;
  recording.simulation->run(model, straight);
  by_cubic->run(model, cubic);
  for (std::size_t o = 0; o < measured.size(); ++o) {
    // The cubic is nearer than the line by far; a fifth of what parts them is a fair bound of its own error.
    const double noise = spread_of_differences(recording.measured[o]);
    for (std::size_t i = 0; i < place.size(); ++i)
      if (!(0.2 * std::abs(cubic[o][place[i]] - straight[o][i]) < 0.3 * noise))
        for (auto& values : measured) values[place[i]] = nothing;
  }
  recording.inputs = std::move(whole);
  recording.measured = std::move(measured);
  recording.simulation = std::move(by_cubic);
}

Case empty_case(const physics::Model& model) {
  Case data;
  data.model = model;
  data.outputs = model.outputs();
  data.given_noise.assign(data.outputs.size(), nothing);
  data.is_time_series = model.plant != physics::Plant::droplet;
  // Rounding to the resolution is noise to a fit, not a step.
  for (auto& parameter : data.model.parameters)
    if (model.plant == physics::Plant::sensor && parameter.name == "resolution")
      data.resolution = parameter.value, parameter.value = 0.0, parameter.sigma = 0.0;
  return data;
}

void add(Case& data, const physics::Model& model, const std::string& name, physics::Record inputs,
         std::size_t forget) {
  Recording recording;
  recording.name = name;
  recording.inputs = std::move(inputs);
  for (const auto& output : data.outputs) {
    recording.measured.push_back(recording.inputs.signals.at(output));
    recording.inputs.signals.erase(output);
    for (const double v : recording.measured.back())
      if (!std::isfinite(v)) ++data.count.missing;
  }
  const double step = median_step(recording.inputs.time);
  for (std::size_t i = 1; i < recording.inputs.rows(); ++i)
    data.count.gaps +=
        data.is_time_series && recording.inputs.time[i] - recording.inputs.time[i - 1] > 2.5 * step ? 1U : 0U;
  give_start(data, recording);
  if (model.plant == physics::Plant::axis) give_start_of_sum(data, recording);
  for (auto& column : recording.measured)
    std::fill_n(column.begin(), std::min(forget, column.size()), nothing);
  recording.simulation = physics::prepare(model, recording.inputs);
  if (model.plant == physics::Plant::axis && model.controller) bridge_gaps(model, recording, step);
  data.recordings.push_back(std::move(recording));
}

/// What is so large is no reading, and squares of it are no numbers.
void drop_absurd(physics::Record& record) {
  for (auto& [name, values] : record.signals)
    for (double& v : values)
      if (!(std::abs(v) < 1e100)) v = nothing;
}

/// Throws where there is nothing to compare, or nothing that drives the model.
void check_filled(const physics::Model& model, const physics::Record& record,
                  const std::filesystem::path& file) {
  const auto filled = [&](const std::string& signal) {
    const auto& values = record.signals.at(signal);
    return std::count_if(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
  };
  std::ptrdiff_t readings = 0;
  std::string columns;
  for (const auto& signal : model.signals) {
    if (signal.is_output) {
      readings += filled(signal.name);
      columns += (columns.empty() ? "`" : ", `") + signal.column + "`";
    }
    const bool drives =
        signal.name == "reference" || signal.name == "true_position" ||
        std::any_of(model.equations.inputs.begin(), model.equations.inputs.end(),
                    [&](const auto& one) {
                      return one.signal == signal.name && one.symbol != model.equations.controlled_input;
                    }) ||
        std::any_of(model.thermal.heaters.begin(), model.thermal.heaters.end(),
                    [&](const auto& one) { return one.name == signal.name; });
    if (drives && filled(signal.name) == 0)
      throw InputError{file.string() + ": column `" + signal.column + "`", "has no number",
                       "record it, or name another column for `" + signal.name + "`"};
  }
  if (readings < 8)
    throw InputError{file.string() + ": column " + columns,
                     readings == 0 ? "has no number" : "has only " + std::to_string(readings) + " numbers",
                     "record what the model is to be compared with"};
}

/// One file among `files`: it has its share of the rows that a diagnosis runs through.
void add(Case& data, const physics::Model& model, recording::Table table, std::size_t files) {
  auto content = model::to_record(table, model, true);
  if (data.recordings.empty())  // they are of the same model and units each time
    for (const auto& doubt : content.doubts) data.doubts.push_back("units: " + doubt);
  data.count.before_standstill += table.before, data.count.behind_rest += table.behind;
  if (model.plant == physics::Plant::sensor && !physics::is_rotary(data.model)) {
    const auto unit = parse_unit(content.units.at("true_position").unit);
    if (unit && unit->dimension == parse_unit("rad")->dimension) physics::count_in_angles(data.model);
  }
  table.columns.clear();
  for (auto& signal : data.model.signals) {  // the user's own expressions are in the units of his columns
    const auto unit = content.units.find(signal.name);
    if (unit == content.units.end() || !signal.unit.empty()) continue;
    if (unit->second.factor == 1.0 && unit->second.offset == 0.0) signal.unit = unit->second.unit;
    if (unit->second.factor == 1.0) continue;
    if (std::none_of(data.taken_in_si.begin(), data.taken_in_si.end(),
                     [&](const TakenInSi& one) { return one.signal == signal.name; }))
      data.taken_in_si.push_back(
          {signal.name, signal.column, unit->second.unit, unit->second.factor, unit->second.offset});
  }
  data.count.rows += content.record.rows();
  for (const auto& name : data.outputs)
    if (const auto noise = model.noise.find(name); noise != model.noise.end() && noise->second > 0.0)
      data.given_noise[static_cast<std::size_t>(&name - data.outputs.data())] =
          noise->second * content.units.at(name).factor;
  auto record = std::move(content.record);
  drop_absurd(record);
  check_filled(model, record, table.file);
  const std::size_t before = data.count.out_of_order, rows = record.rows();
  put_in_order(record, data.count);
  if (model.plant == physics::Plant::error_map && record.find("direction") == nullptr)
    record.signals["direction"] =
        physics::directions_of_approach(physics::bridged(record.time, record.signals.at("position")));
  // Points of a map and drops may stand in any order.
  const bool is_course = model.plant != physics::Plant::error_map && model.plant != physics::Plant::droplet;
  if (is_course && 2 * (data.count.out_of_order - before) > rows)
    throw InputError{table.file.string() + ": column `" + model.signal("time")->column + "`",
                     "goes back at most of its rows", "name the column of the time, and sort the rows by it"};
  even_out(model, record, table.file.filename().string(), data.doubts);
  leave_out_hiccups(model, record, table.file.filename().string(), data.doubts);
  leave_out_what_died(model, record, table.file.filename().string(), data.doubts);
  if (model.plant == physics::Plant::equations && model.equations.inputs.empty())
    thin(record, data.outputs, files);
  if (record.rows() < 8)
    throw InputError{table.file.string(), "has fewer than 8 usable rows", "record for longer"};
  check_ticks(model, record.time, table.file);
  data.count.lone_inputs += drop_lone_inputs(model, record);
  const std::size_t ordered = record.rows();
  std::size_t looked_at = 0;
  auto parts = without_pauses(model, std::move(record));
  data.count.gaps += parts.size() - 1;
  for (auto& part : parts) {
    const std::size_t share = std::max<std::size_t>(1, most_rows / files * part.record.rows() / ordered);
    for (auto& stretch : shortened(model, std::move(part.record), share)) {
      looked_at += stretch.record.rows();
      add(data, model, table.file.filename().string(), std::move(stretch.record),
          std::max(part.forget, stretch.forget));
    }
  }
  data.count.shortened += ordered - looked_at;
}

/// What was taken in SI is reported in it.
void name_si_units(Case& data) {
  for (const auto& one : data.taken_in_si)
    for (auto& signal : data.model.signals)
      if (const auto unit = parse_unit(one.unit); unit && signal.name == one.signal)
        signal.unit = one.factor == unit->factor  ? si_unit(*unit)
                      : unit->dimension[5] == 0.0 ? "rad/s"
                                                  : "Hz";
}

}  // namespace

void check_runs(const Case& data, const physics::Model& model, double most,
                const std::filesystem::path& file) {
  if (model.plant != physics::Plant::equations) return;  // elsewhere a missing input makes a missing output
  for (const auto& recording : data.recordings) {
    physics::Outputs outputs;
    recording.simulation->run(model, outputs);
    for (std::size_t o = 0; o < outputs.size(); ++o) {
      const std::size_t from = physics::ran_away_at(outputs[o]);
      const std::size_t lost = outputs[o].size() - from;
      if (static_cast<double>(lost) <= most * static_cast<double>(outputs[o].size())) continue;
      std::ostringstream when;
      when << recording.inputs.time[from];
      throw InputError{
          file.string(),
          "simulated on " + recording.name + ", output `" + data.outputs[o] +
              "` is no number from t = " + when.str() + " s on",
          "look for a division by zero, or begin with values with which the model does not run away"};
    }
  }
}

Case load_case(const physics::Model& model, const std::vector<std::filesystem::path>& files) {
  auto data = empty_case(model);
  for (const auto& file : files)
    for (auto& table : model::read_recording(file, model)) add(data, model, std::move(table), files.size());
  name_si_units(data);
  leave_out_dead(data, files.front());
  return data;
}

Case make_case(const physics::Model& model, const std::vector<recording::Table>& tables) {
  auto data = empty_case(model);
  for (const auto& table : tables) add(data, model, table, tables.size());
  name_si_units(data);
  leave_out_dead(data, tables.front().file);
  return data;
}

std::optional<Range> covered(const Case& data, std::string_view signal) {
  std::optional<Range> range;
  for (const auto& recording : data.recordings)
    if (const auto* values = recording.inputs.find(signal); values != nullptr)
      for (const double v : *values)
        if (std::isfinite(v))
          range = range ? Range{std::min(range->lower, v), std::max(range->upper, v)} : Range{v, v};
  return range;
}

double longest(const Case& data) {
  double lasts = 0.0;
  for (const auto& recording : data.recordings)
    lasts = std::max(lasts, recording.inputs.time.back() - recording.inputs.time.front());
  return lasts;
}

double highest_power(const Case& data, std::string_view node) {
  double top = 0.0;
  for (const auto& heater : data.model.thermal.heaters)
    if (heater.node == node)
      if (const auto given = covered(data, heater.name)) top = std::max(top, given->upper);
  return top;
}

}  // namespace invar::diagnose

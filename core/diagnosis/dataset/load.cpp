#include "core/diagnosis/dataset/load.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "core/base/quantity.hpp"
#include "core/base/unit.hpp"
#include "core/diagnosis/dataset/dead_channels.hpp"
#include "core/diagnosis/dataset/even_rows.hpp"
#include "core/diagnosis/dataset/gap_bridging.hpp"
#include "core/diagnosis/dataset/hiccups.hpp"
#include "core/diagnosis/dataset/initial_state.hpp"
#include "core/diagnosis/dataset/lone_inputs.hpp"
#include "core/diagnosis/dataset/row_order.hpp"
#include "core/diagnosis/dataset/shorten.hpp"
#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/dataset/ticks.hpp"
#include "core/model/recording_file.hpp"
#include "core/physics/approach.hpp"
#include "core/physics/counted_units.hpp"

namespace invar::diagnosis {

namespace {

double median_step(const std::vector<double>& time) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.size(); ++i) steps.push_back(time[i] - time[i - 1]);
  return steps.empty() ? 1.0 : median(steps);
}

Case empty_case(const physics::Model& model) {
  Case data;
  data.model = model;
  data.outputs = model.outputs();
  data.given_noise.assign(data.outputs.size(), no_reading);
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
    std::fill_n(column.begin(), std::min(forget, column.size()), no_reading);
  recording.simulation = physics::prepare(model, recording.inputs);
  if (model.plant == physics::Plant::axis && model.controller) bridge_gaps(model, recording, step);
  data.recordings.push_back(std::move(recording));
}

/// What is so large is no reading, and squares of it are no numbers.
void drop_absurd(physics::Record& record) {
  for (auto& [name, values] : record.signals)
    for (double& v : values)
      if (!(std::abs(v) < 1e100)) v = no_reading;
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

/// Notes the units of the columns, and the noise that the user gave, in SI.
void take_units(Case& data, const physics::Model& model, const model::RecordFile& content) {
  if (data.recordings.empty())  // they are of the same model and units each time
    for (const auto& doubt : content.doubts) data.doubts.push_back("units: " + doubt);
  if (model.plant == physics::Plant::sensor && !physics::is_rotary(data.model)) {
    const auto unit = parse_unit(content.units.at("true_position").unit);
    if (unit && unit->dimension == parse_unit("rad")->dimension) physics::count_in_angles(data.model);
  }
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
  for (const auto& name : data.outputs)
    if (const auto noise = model.noise.find(name); noise != model.noise.end() && noise->second > 0.0)
      data.given_noise[static_cast<std::size_t>(&name - data.outputs.data())] =
          noise->second * content.units.at(name).factor;
}

/// Sorts the rows by time; points of a map and drops may stand in any order.
void order_rows(Case& data, const physics::Model& model, const std::filesystem::path& file,
                physics::Record& record) {
  const std::size_t before = data.count.out_of_order, rows = record.rows();
  put_in_order(record, data.count);
  if (model.plant == physics::Plant::error_map && record.find("direction") == nullptr)
    record.signals["direction"] =
        physics::directions_of_approach(physics::bridged(record.time, record.signals.at("position")));
  const bool is_course = model.plant != physics::Plant::error_map && model.plant != physics::Plant::droplet;
  if (is_course && 2 * (data.count.out_of_order - before) > rows)
    throw InputError{file.string() + ": column `" + model.signal("time")->column + "`",
                     "goes back at most of its rows", "name the column of the time, and sort the rows by it"};
}

/// Parted at its pauses, and shortened to its share of the rows that a diagnosis runs through.
void add_parts(Case& data, const physics::Model& model, const std::string& name, physics::Record record,
               std::size_t files) {
  const std::size_t ordered = record.rows();
  std::size_t looked_at = 0;
  auto parts = without_pauses(model, std::move(record));
  data.count.gaps += parts.size() - 1;
  for (auto& part : parts) {
    const std::size_t share = std::max<std::size_t>(1, most_rows / files * part.record.rows() / ordered);
    for (auto& stretch : shortened(model, std::move(part.record), share)) {
      looked_at += stretch.record.rows();
      add(data, model, name, std::move(stretch.record), std::max(part.forget, stretch.forget));
    }
  }
  data.count.shortened += ordered - looked_at;
}

/// One file among `files`: it has its share of the rows that a diagnosis runs through.
void add(Case& data, const physics::Model& model, recording::Table table, std::size_t files) {
  auto content = model::to_record(table, model, true);
  data.count.before_standstill += table.before, data.count.behind_rest += table.behind;
  take_units(data, model, content);
  table.columns.clear();
  data.count.rows += content.record.rows();
  auto record = std::move(content.record);
  drop_absurd(record);
  check_filled(model, record, table.file);
  order_rows(data, model, table.file, record);
  even_out(model, record, table.file.filename().string(), data.doubts);
  leave_out_hiccups(model, record, table.file.filename().string(), data.doubts);
  leave_out_what_died(model, record, table.file.filename().string(), data.doubts);
  if (model.plant == physics::Plant::equations && model.equations.inputs.empty())
    thin(record, data.outputs, files);
  if (record.rows() < 8)
    throw InputError{table.file.string(), "has fewer than 8 usable rows", "record for longer"};
  check_ticks(model, record.time, table.file);
  data.count.lone_inputs += drop_lone_inputs(model, record);
  add_parts(data, model, table.file.filename().string(), std::move(record), files);
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

}  // namespace invar::diagnosis

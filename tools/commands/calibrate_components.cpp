// `invar calibrate components`: error motions that were measured one by one, at several states of the machine.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "core/compensation/component_file.hpp"
#include "core/machine/machine_file.hpp"
#include "core/metrology/geometric_field.hpp"
#include "tools/commands/calibrate.hpp"
#include "tools/commands/calibration_result.hpp"
#include "tools/geometric/components_page.hpp"
#include "tools/geometric/field_points.hpp"

namespace invar::tools {

namespace {

using metrology::component_count;
using metrology::ComponentReadings;
using metrology::is_rotation;
using report::number;
using report::si;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

constexpr double most_translation = 0.1;  // m or rad
constexpr std::size_t least_places = 4;

struct Options {
  std::filesystem::path machine;
  std::filesystem::path readings;
  std::filesystem::path out;
};

std::string unit_of_state(const std::string& name) { return name == "heating_rate" ? "K/s" : "degC"; }

bool is_state(const std::string& name) {
  return name == "temperature" || name == "heating_rate" || name.starts_with("temperature_");
}

struct Rows {
  std::vector<double> position, value;
  std::vector<std::vector<double>> state;
};

/// Reads the file row by row into the readings of each component and squareness.
class Reader {
 public:
  Reader(const std::filesystem::path& file, const metrology::Machine& machine)
      : table_{recording::Table::read(file, {"component"})}, machine_{machine} {
    if (table_.find("component") == nullptr) (void)table_.in("component", "1");  // says what is missing
    position_ = table_.in("position", "m");
    if (!table_.has("translation") && !table_.has("rotation")) (void)table_.in("translation", "m");
    translation_ = table_.optionally_in("translation", "m");
    rotation_ = table_.optionally_in("rotation", "rad");
    for (const auto& column : table_.columns) {
      if (!is_state(column.name)) continue;
      names_.push_back(column.name);
      states_.push_back(table_.in(column.name, unit_of_state(column.name)));
      expect_finite(file, column.name, states_.back(), 1e4);
      const auto [low, high] = std::minmax_element(states_.back().begin(), states_.back().end());
      ranges_.push_back({*low, *high});
    }
  }

  void read(ComponentsResult& result) {
    const recording::Column& names = *table_.find("component");
    result.rows = table_.rows();
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string name = names.texts.empty() ? "" : names.texts[row];
      int pair = 0;
      while (pair < metrology::squareness_count && metrology::squareness_iso_name(pair) != name) ++pair;
      if (pair < metrology::squareness_count)
        squareness(row, pair);
      else
        component(row, name);
    }
    for (std::size_t s = 0; s < names_.size(); ++s) result.model.states.push_back({names_[s], ranges_[s]});
    for (int c = 0; c < component_count; ++c)
      if (!rows_[index(c)].position.empty()) result.readings[index(c)] = readings_of(c);
    for (int pair = 0; pair < metrology::squareness_count; ++pair) mean_of(pair, result.model);
  }

 private:
  [[noreturn]] void refuse(const std::string& column, std::size_t row, const std::string& what,
                           const std::string& mend) const {
    throw InputError{table_.file.string() + ": column `" + column + "`, row " + std::to_string(row + 1), what,
                     mend};
  }

  [[nodiscard]] double value(std::size_t row, bool rotation) const {
    const auto& own = rotation ? rotation_ : translation_;
    const auto& other = rotation ? translation_ : rotation_;
    const char* name = rotation ? "rotation" : "translation";
    if (!own || !std::isfinite((*own)[row]))
      refuse(name, row, own ? "is empty" : "there is no such column",
             std::string{"give "} + (rotation ? "a rotation in rad" : "a translation in m"));
    if (other && std::isfinite((*other)[row]))
      refuse(rotation ? "translation" : "rotation", row, "has a value where the component is the other kind",
             "leave the cell empty");
    if (std::abs((*own)[row]) > most_translation)
      refuse(name, row, number((*own)[row], 4) + " is out of range", "check the value and its unit");
    return (*own)[row];
  }

  void squareness(std::size_t row, int pair) { squareness_[index(pair)].push_back(value(row, true)); }

  void component(std::size_t row, const std::string& name) {
    const auto found = metrology::component_named(name);
    if (!found)
      refuse("component", row, "`" + name + "` is no error motion",
             "write ISO 230-1: EXX, EYX .. ECZ, or EC0Y, EB0Z, EA0Z");
    const int axis = metrology::axis_of(*found);
    if (!machine_.chain.has(axis))
      refuse("component", row, "`" + name + "` is of an axis that the machine lacks",
             "add the axis to the machine's chain, or leave the rows out");
    const Range travel = machine_.travel[index(axis)];
    if (!std::isfinite(position_[row]))
      refuse("position", row, "is empty", "give every reading its position");
    if (position_[row] < travel.lower - 0.1 * travel.width() ||
        position_[row] > travel.upper + 0.1 * travel.width())
      refuse("position", row, number(position_[row], 6) + " m is outside the travel of the axis",
             "check the unit, or the travel in the machine file");
    Rows& rows = rows_[index(*found)];
    rows.position.push_back(position_[row]);
    rows.value.push_back(value(row, is_rotation(*found)));
    rows.state.emplace_back();
    for (const auto& state : states_) rows.state.back().push_back(state[row]);
  }

  [[nodiscard]] ComponentReadings readings_of(int component) const {
    const Rows& rows = rows_[index(component)];
    const std::set<long> places = [&] {
      std::set<long> cells;
      for (const double position : rows.position) cells.insert(std::lround(position * 1e6));
      return cells;
    }();
    const std::string what =
        table_.file.string() + ": component " + std::string{metrology::iso_name(component)};
    if (rows.position.size() < static_cast<std::size_t>(metrology::least_component_readings))
      throw InputError{what,
                       "has too few readings (" + std::to_string(rows.position.size()) + "; 8 at least)",
                       "measure more points, or leave the component out"};
    if (places.size() < least_places)
      throw InputError{what, "was measured at " + std::to_string(places.size()) + " places (4 at least)",
                       "measure along the travel"};
    ComponentReadings readings;
    readings.position = vector_of(rows.position);
    readings.value = vector_of(rows.value);
    readings.state.resize(static_cast<Eigen::Index>(states_.size()), readings.position.size());
    for (std::size_t i = 0; i < rows.state.size(); ++i)
      readings.state.col(static_cast<Eigen::Index>(i)) = vector_of(rows.state[i]);
    return readings;
  }

  void mean_of(int pair, metrology::ComponentNetworks& model) const {
    const auto& angles = squareness_[index(pair)];
    if (angles.empty()) return;
    if (angles.size() < 2)
      throw InputError{
          table_.file.string() + ": component " + std::string{metrology::squareness_iso_name(pair)},
          "has one reading, which tells nothing of its noise", "measure it twice at least"};
    const Eigen::VectorXd all = vector_of(angles);
    const auto n = static_cast<double>(angles.size());
    model.squareness[index(pair)] = metrology::squareness_cosine_from_angle(pair, all.mean());
    const double spread = std::sqrt((all.array() - all.mean()).square().sum() / (n - 1.0));
    model.squareness_sigma[index(pair)] = std::max(spread / std::sqrt(n), 1e-9);
  }

  recording::Table table_;
  const metrology::Machine& machine_;
  std::vector<double> position_;
  std::optional<std::vector<double>> translation_, rotation_;
  std::vector<std::string> names_;
  std::vector<std::vector<double>> states_;
  std::vector<Range> ranges_;
  std::array<Rows, component_count> rows_;
  std::array<std::vector<double>, metrology::squareness_count> squareness_;
};

/// What is missing, and what the whole field amounts to.
void evaluate(ComponentsResult& result) {
  const auto& model = result.model;
  for (int c = 0; c < component_count; ++c) {
    if (!model.chain.has(metrology::axis_of(c))) continue;
    const std::string name{metrology::iso_name(c)};
    if (!result.fits[index(c)]) {
      result.unidentified.push_back(name);
      continue;
    }
    const Range travel = model.travel[index(metrology::axis_of(c))];
    const Range known = result.fits[index(c)]->component.network.range[0];
    if (known.width() < 0.9 * travel.width())
      result.notes.push_back(name + " was measured from " + si(known.lower, "m") + " to " +
                             si(known.upper, "m") + " only: its end values are held beyond");
  }
  for (int a = 0; a < 3; ++a)
    for (int b = a + 1; b < 3; ++b)
      if (model.chain.has(a) && model.chain.has(b) &&
          model.squareness_sigma[index(metrology::squareness_of(a, b))] <= 0.0)
        result.unidentified.emplace_back(metrology::squareness_iso_name(metrology::squareness_of(a, b)));
  std::vector<double> usual;
  for (const auto& state : model.states) usual.push_back(state.usual());
  const auto grid = metrology::volume_grid(model.chain, model.travel, 9);
  for (const auto& point : grid) {
    result.field_rms +=
        model.error(point, model.tool, usual).squaredNorm() / static_cast<double>(grid.size());
    result.field_sigma +=
        model.sigma_at(point, model.tool, usual).squaredNorm() / static_cast<double>(grid.size());
  }
  result.field_rms = std::sqrt(result.field_rms);
  result.field_sigma = std::sqrt(result.field_sigma);
}

nlohmann::json report_of(const ComponentsResult& result) {
  nlohmann::json report;
  report["kind"] = "components";
  report["readings"] = result.rows;
  report["field_rms_m"] = result.field_rms;
  report["field_sigma_m"] = result.field_sigma;
  report["unidentified"] = result.unidentified;
  report["notes"] = result.notes;
  report["components"] = nlohmann::json::array();
  for (int c = 0; c < component_count; ++c) {
    if (!result.fits[index(c)]) continue;
    const auto& fit = *result.fits[index(c)];
    nlohmann::json depends = nlohmann::json::array();
    for (const std::size_t state : fit.component.states) depends.push_back(result.model.states[state].name);
    report["components"].push_back({{"name", metrology::iso_name(c)},
                                    {"unit", is_rotation(c) ? "rad" : "m"},
                                    {"depends_on", depends},
                                    {"readings", fit.kept.size()},
                                    {"rejected", fit.rejected},
                                    {"left_out_rms", fit.left_out},
                                    {"left_out_rms_position_alone", fit.over_position},
                                    {"sigma", fit.component.sigma}});
  }
  return report;
}

void calibrate(const Options& options) {
  const metrology::Machine machine = machine::load_machine(options.machine);
  ComponentsResult result;
  result.machine_file = options.machine;
  result.readings_file = options.readings;
  result.model.chain = machine.chain;
  result.model.travel = machine.travel;
  result.model.tool = machine.tool;
  Reader{options.readings, machine}.read(result);
  {
    const Progress progress{"fitting the error motions"};
    for (int c = 0; c < component_count; ++c) {
      if (!result.readings[index(c)]) continue;
      result.fits[index(c)] = metrology::identify_component(*result.readings[index(c)]);
      result.model.components[index(c)] = result.fits[index(c)]->component;
    }
  }
  evaluate(result);
  compensation::ModelText text{"components", {options.machine, options.readings}};
  compensation::write_components(text, result.model);
  write_calibration(options.out, text, report_of(result), components_page(result));

  for (int c = 0; c < component_count; ++c) {
    if (!result.fits[index(c)]) continue;
    const auto& fit = *result.fits[index(c)];
    const char* unit = is_rotation(c) ? "rad" : "m";
    std::cout << metrology::iso_name(c) << ": " << fit.kept.size() << " readings, " << fit.rejected
              << " rejected; by " << result.depends_on(c) << "; readings left out met to "
              << si(fit.left_out, unit) << '\n';
  }
  std::cout << "error over the travels " << si(result.field_rms, "m") << " RMS, known to "
            << si(result.field_sigma, "m") << '\n';
  for (const auto& note : result.notes) std::cout << "note: " << note << '\n';
  std::string missing;
  for (const auto& what : result.unidentified) missing += (missing.empty() ? "" : ", ") + what;
  if (!missing.empty()) std::cout << "not measured, taken as zero: " << missing << '\n';
  std::cout << "report: " << (options.out / "report.html").string() << '\n';
}

}  // namespace

void add_calibrate_components(CLI::App& group) {
  auto* command =
      group.add_subcommand("components", "Error motions measured one by one, over position and temperature");
  command->footer(
      "Example: invar calibrate components --machine machine.yaml --readings components.csv --out result\n"
      "Rows: component (EXX .. ECZ, or EC0Y, EB0Z, EA0Z without a position), position [m] of its axis, "
      "translation [m]\n"
      "or rotation [rad], and what it may depend on: temperature [degC], heating_rate [K/s], "
      "temperature_<zone> [degC].\n"
      "From displacement lines alone: invar calibrate geometric.");
  auto options = std::make_shared<Options>();
  command->add_option("--machine", options->machine, "machine.yaml: chain, travel, tool")->required();
  command
      ->add_option("--readings", options->readings,
                   "readings of an angular interferometer, level or straightedge, .csv or .csv.gz")
      ->required();
  command->add_option("--out", options->out, "folder for compensation.yaml, report.json, report.html")
      ->required();
  command->callback([options] { calibrate(*options); });
}

recording::Table predict_components(const config::Yaml& file, const recording::Table& inputs) {
  compensation::check_seal(file);
  const auto model = compensation::read_components(file.root());
  file.finish();
  const FieldPoints points = read_points(inputs, model.tool);
  std::vector<std::vector<double>> columns;
  for (const auto& state : model.states) columns.push_back(inputs.in(state.name, unit_of_state(state.name)));
  std::vector<FieldValue> values;
  std::size_t outside = 0;
  for (std::size_t i = 0; i < points.positions.size(); ++i) {
    std::vector<double> state;
    for (const auto& column : columns) state.push_back(column[i]);
    const bool known = points.positions[i].allFinite() && points.tools[i].allFinite() &&
                       std::all_of(state.begin(), state.end(), [](double s) { return std::isfinite(s); });
    outside += known && !model.knows(state) ? 1U : 0U;
    values.push_back(known ? FieldValue{model.error(points.positions[i], points.tools[i], state),
                                        model.sigma_at(points.positions[i], points.tools[i], state)}
                           : unknown_value());
  }
  if (outside > 0)
    std::cerr << "warning: " << outside << " of " << values.size()
              << " points lie outside what was calibrated; the value at the end of the range is held there\n";
  return field_table(values);
}

}  // namespace invar::tools

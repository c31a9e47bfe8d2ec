#include "tools/geometric/components_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include "core/base/fault.hpp"
#include "core/base/index.hpp"
#include "core/recording/table.hpp"
#include "tools/calibration/calibration_result.hpp"

namespace invar::tools {

using metrology::error_motion_count;
using metrology::ErrorMotionReadings;
using metrology::is_rotation;
using report::number;

namespace {

constexpr double most_translation = 0.1;  // m or rad
constexpr std::size_t least_places = 4;

bool is_state(const std::string& name) {
  return name == "temperature" || name == "heating_rate" || name.starts_with("temperature_");
}

struct Rows {
  std::vector<double> position, value;
  std::vector<int> direction;
  std::vector<std::vector<double>> state;
};

/// Reads the file row by row into the readings of each component and squareness.
class Reader {
 public:
  Reader(const std::filesystem::path& file, const metrology::Machine& machine)
      : table_{recording::Table::read(file, {"component", "line"})}, machine_{machine} {
    if (table_.find("component") == nullptr) (void)table_.in("component", "1");  // says what is missing
    position_ = table_.in("position", "m");
    if (!table_.has("translation") && !table_.has("rotation")) (void)table_.in("translation", "m");
    translation_ = table_.optionally_in("translation", "m");
    rotation_ = table_.optionally_in("rotation", "rad");
    direction_ = table_.optionally_in("direction", "1");
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
    for (int c = 0; c < error_motion_count; ++c)
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
    const auto found = metrology::error_motion_named(name);
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
    if (direction_) {
      if (!std::isfinite((*direction_)[row]) || (*direction_)[row] == 0.0)
        refuse("direction", row, "is neither +1 nor -1", "give every reading the sense of its motion");
      rows.direction.push_back((*direction_)[row] > 0.0 ? 1 : -1);
    }
    rows.state.emplace_back();
    for (const auto& state : states_) rows.state.back().push_back(state[row]);
  }

  [[nodiscard]] ErrorMotionReadings readings_of(int component) const {
    const Rows& rows = rows_[index(component)];
    const std::set<long> places = [&] {
      std::set<long> cells;
      for (const double position : rows.position) cells.insert(std::lround(position * 1e6));
      return cells;
    }();
    const std::string what =
        table_.file.string() + ": component " + std::string{metrology::iso_name(component)};
    if (rows.position.size() < static_cast<std::size_t>(metrology::least_error_motion_readings))
      throw InputError{what,
                       "has too few readings (" + std::to_string(rows.position.size()) + "; 8 at least)",
                       "measure more points, or leave the component out"};
    if (places.size() < least_places)
      throw InputError{what, "was measured at " + std::to_string(places.size()) + " places (4 at least)",
                       "measure along the travel"};
    ErrorMotionReadings readings;
    readings.position = vector_of(rows.position);
    readings.value = vector_of(rows.value);
    readings.direction = rows.direction;
    readings.state.resize(static_cast<Eigen::Index>(states_.size()), readings.position.size());
    for (std::size_t i = 0; i < rows.state.size(); ++i)
      readings.state.col(static_cast<Eigen::Index>(i)) = vector_of(rows.state[i]);
    return readings;
  }

  void mean_of(int pair, metrology::ErrorMotionNetworks& model) const {
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
  std::optional<std::vector<double>> translation_, rotation_, direction_;
  std::vector<std::string> names_;
  std::vector<std::vector<double>> states_;
  std::vector<Range> ranges_;
  std::array<Rows, error_motion_count> rows_;
  std::array<std::vector<double>, metrology::squareness_count> squareness_;
};

}  // namespace

std::string unit_of_state(const std::string& name) { return name == "heating_rate" ? "K/s" : "degC"; }

void read_components_file(const std::filesystem::path& file, const metrology::Machine& machine,
                          ComponentsResult& result) {
  Reader{file, machine}.read(result);
}

}  // namespace invar::tools

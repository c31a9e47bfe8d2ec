#include "components/calibration/thermal_calibration.hpp"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "components/calibration/identify.hpp"
#include "core/base/new_file.hpp"
#include "core/job/wait.hpp"

namespace invar::calibration {

namespace {

constexpr double set_each = 1.0;         // s, between two setpoints of a trace
constexpr int left_out_each = 4;         // each so many passes one is kept from the fit
constexpr double history_spacing = 2.0;  // s, of the temperatures that a lag is worked out from
constexpr std::size_t most_history = 20'000;
constexpr const char* models[] = {"room temperature", "position and temperature"};

double square_mean(const recording::Table& table, const char* model) {
  double squares = 0.0;
  double count = 0.0;
  const auto& names = table.columns[0].texts;
  const auto error = table.in("error", "m");
  for (std::size_t i = 0; i < table.rows(); ++i) {
    if (names[i] != model) continue;
    squares += error[i] * error[i];
    count += 1.0;
  }
  return count > 0.0 ? squares / count : 0.0;
}

/// One line each: what was tried, how it meets passes that were not fitted, and why it was or was not taken.
void write_models_tried(const metrology::ThermalFit& fit, const std::filesystem::path& file) {
  std::ofstream out = new_stream(file);
  for (const auto& tried : fit.candidates) {
    std::array<char, 60> lag{};
    if (tried.lag > 0.0) std::snprintf(lag.data(), lag.size(), " by %.3g s", tried.lag);
    out << (tried.chosen ? "* " : "  ") << tried.name << lag.data() << ": " << tried.verdict << '\n';
  }
  if (!out.flush()) throw std::runtime_error{file.string() + " cannot be written"};
}

}  // namespace

ThermalCalibration::ThermalCalibration(Component& owner, job::JobHost& host, LineLaser& laser,
                                       ModelTransaction& models, const std::vector<std::string>& zones)
    : owner_{owner},
      host_{host},
      laser_{laser},
      models_{models},
      zone_names_{zones},
      temperature_{owner, "temperature", {.optional = true, .profile = "state"}},
      heater_{owner, "heater", "command"} {
  for (const std::string& zone : zones)
    zones_.push_back(std::make_unique<Input<thermal::NodeTemperature>>(
        owner, "temperature_" + zone, InputOptions{.optional = true, .profile = "state"}));
}

/// Columns of thermal.csv (docs/reference/calibration-files.md#thermalcsv); with the model that was in use for those of
/// a comparison.
recording::Table ThermalCalibration::heat_table(bool with_models) const {
  recording::Table table;
  if (with_models) table.add_texts("model", {});
  table.add("t", "s", {});
  table.add("x", "m", {});
  table.add("temperature", "degC", {});
  table.add("heating_rate", "K/s", {});
  for (const std::string& zone : zone_names_) table.add("temperature_" + zone, "degC", {});
  table.add("error", "m", {});
  table.add("direction", "", {});
  table.add("cycle", "", {});
  return table;
}

void ThermalCalibration::set_heater(double setpoint) {
  thermal::ThermalCommand command;
  owner_.stamp(command);
  command.id(host_.next_id());
  command.setpoint(setpoint);
  command.enabled(true);
  heater_.write(command);
  set_at_ = owner_.now();
}

/// For a body that lags; the oldest quarter goes where there is too much of it.
void ThermalCalibration::remember(double at, double temperature) {
  if (history_.time.empty() || at - history_.time.back() >= history_spacing) {
    history_.time.push_back(at);
    history_.temperature.push_back(temperature);
  }
  if (history_.time.size() <= most_history) return;
  const auto quarter = static_cast<std::ptrdiff_t>(most_history / 4);
  history_.time.erase(history_.time.begin(), history_.time.begin() + quarter);
  history_.temperature.erase(history_.temperature.begin(), history_.temperature.begin() + quarter);
}

void ThermalCalibration::follow() {
  if (const auto* sample = temperature_.latest(); sample != nullptr && !sample->stale()) {
    const double at = static_cast<double>(sample->at().time_ns()) * 1e-9;
    heat_.add(at, sample->temperature());
    remember(at, sample->temperature());
  }
  if (trace_ != nullptr && owner_.now() - set_at_ >= Duration::seconds(set_each))
    set_heater(trace_->at((owner_.now() - trace_start_).in_seconds()));
}

void ThermalCalibration::make_safe() {
  trace_ = nullptr;
  if (setpoint_before_) set_heater(*setpoint_before_);
  setpoint_before_.reset();
}

void ThermalCalibration::forget() {
  heat_.forget();
  history_ = {};
}

/// Holds a temperature until it has stood there for the soak.
job::Task ThermalCalibration::reach(const ThermalJob& job, double temperature) {
  trace_ = nullptr;
  set_heater(temperature);
  const Instant began = owner_.now();
  Instant away = owner_.now();
  while (owner_.now() - away < Duration::seconds(job.soak)) {
    co_await job::NextStep{};
    const auto* sample = temperature_.latest();
    if (sample == nullptr || sample->stale() || std::abs(sample->temperature() - temperature) > job.tolerance)
      away = owner_.now();
    if (owner_.now() - began > Duration::seconds(job.steady_timeout))
      throw std::runtime_error{"the temperature does not settle at " + std::to_string(temperature) +
                               " degC within `steady_timeout`"};
  }
}

/// The line once forth and back.
job::Task ThermalCalibration::pass(const Pass& what, recording::Table& table) {
  const Eigen::Vector3d from = what.job.line.start();
  const Eigen::Vector3d way = what.job.line.end() - from;
  const auto intervals = std::max<std::int64_t>(1, std::llround(way.norm() / what.job.interval));
  const std::int64_t points = what.between ? intervals : intervals + 1;
  for (std::int64_t k = 0; k < 2 * points; ++k) {
    const bool forth = k < points;
    const double at = static_cast<double>(forth ? k : 2 * points - 1 - k) + (what.between ? 0.5 : 0.0);
    const Eigen::Vector3d target = from + way * (at / static_cast<double>(intervals));
    co_await host_.move_to(target, {});
    double displacement = 0.0;
    co_await laser_.average(what.job.readings, displacement);
    const auto* heat = temperature_.latest();
    if (heat == nullptr || heat->stale()) throw std::runtime_error{"no sound temperature arrives"};
    std::vector<double> row{(owner_.now() - began_).in_seconds(),
                            target[static_cast<Eigen::Index>(what.job.axis())], heat->temperature(),
                            heat_.rate()};
    for (auto& zone : zones_) {
      const auto* sample = zone->latest();
      if (sample == nullptr || sample->stale())
        throw std::runtime_error{"no sound temperature arrives at port `" + zone->name() + "`"};
      row.push_back(sample->temperature());
    }
    row.insert(row.end(), {displacement - (target - from).norm(), forth ? 1.0 : -1.0, what.number});
    const std::size_t texts = what.model.empty() ? 0 : 1;
    if (texts > 0) {
      table.columns[0].texts.push_back(what.model);
      table.columns[0].values.push_back(std::numeric_limits<double>::quiet_NaN());
    }
    for (std::size_t i = 0; i < row.size(); ++i) table.columns[texts + i].values.push_back(row[i]);
  }
}

/// Passes with the one and the other model in turn: two of each at a temperature that holds, or as many as a trace lasts.
job::Task ThermalCalibration::compare(const ThermalJob& job, const TraceSpec* trace,
                                      const std::array<std::filesystem::path, 2>& files,
                                      recording::Table& table) {
  trace_ = trace;
  trace_start_ = owner_.now();
  for (int number = 0;; ++number) {
    const bool over =
        trace == nullptr ? number >= 4 : owner_.now() - trace_start_ > Duration::seconds(trace->length());
    if (over && number % 2 == 0) break;
    const auto which = static_cast<std::size_t>(number % 2);
    co_await models_.use(files[which]);
    const Pass next{job, true, std::floor(number / 2.0) + 1.0, models[which]};
    co_await pass(next, table);
  }
  trace_ = nullptr;
}

/// Passes at room temperature, then while the heater follows the trace; into `table`, the first `cold_rows` of it at room
/// temperature, and into thermal.csv.
job::Task ThermalCalibration::measure(const ThermalJob& job, recording::Table& table,
                                      std::size_t& cold_rows) {
  host_.tell("waiting for the room temperature of the slide", 0.0);
  co_await reach(job, job.room);
  co_await host_.move_to(job.line.start(), {});
  co_await laser_.align(job.line.start(), job.line.end());
  double number = 0.0;
  for (std::int64_t k = 0; k < job.room_passes; ++k) {
    const Pass next{job, false, ++number, ""};
    co_await pass(next, table);
  }
  cold_rows = table.rows();

  host_.tell("reading the line while the slide is heated and cools", 0.1);
  trace_ = &job.trace;
  trace_start_ = owner_.now();
  while (owner_.now() - trace_start_ < Duration::seconds(job.trace.length())) {
    const Pass next{job, false, ++number, ""};
    co_await pass(next, table);
    co_await job::wait(owner_, job.pause);
    const double share = (owner_.now() - trace_start_).in_seconds() / job.trace.length();
    host_.advance(0.1 + 0.4 * std::min(1.0, share));
  }
  trace_ = nullptr;
  table.write(std::filesystem::absolute(job.out) / "thermal.csv");
}

/// `files`: the model of room temperature, and that over position and temperature. Throws std::runtime_error where the second is
/// the worse one on passes that were not fitted.
void ThermalCalibration::identify(const ThermalJob& job, const recording::Table& table, std::size_t cold_rows,
                                  std::array<std::filesystem::path, 2>& files) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  const std::filesystem::path source = folder / "thermal.csv";
  std::vector<bool> all(table.rows(), true);
  std::vector<bool> cold(table.rows());
  std::vector<bool> fitted(table.rows());
  std::vector<bool> left_out(table.rows());
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto cycle = static_cast<std::int64_t>(table.columns.back().values[i]);
    cold[i] = i < cold_rows;
    left_out[i] = !cold[i] && (cycle - job.room_passes) % left_out_each == 0;
    fitted[i] = !left_out[i];
  }
  const auto rows = [&](const std::vector<bool>& of) {
    auto readings = heat_readings(table, zone_names_, of);
    // A body that lags also remembers the passes left out, and what was before; by the clock of the table.
    readings.history = history_;
    for (double& at : readings.history.time) at -= began_.in_seconds();
    return readings;
  };
  metrology::ThermalReadings at_room = rows(cold);
  at_room.heating_rate.reset();  // what little the temperature did there is noise
  at_room.time.reset();
  at_room.zones.clear();
  const std::uint32_t above = models_.geometric_checksum();
  const IdentifiedHeat room = identify_heat(at_room, job.axis(), above, source, folder / "room");
  const IdentifiedHeat heat = identify_heat(rows(fitted), job.axis(), above, source, folder);
  write_models_tried(heat.fit, folder / "models_tried.txt");
  const metrology::ThermalReadings everything = rows(all);
  if (left_over(everything, heat.fit.model, left_out) > left_over(everything, room.fit.model, left_out))
    throw std::runtime_error{
        "the model is worse than that of room temperature on passes that were not fitted; it was not "
        "activated"};
  files = {room.file, heat.file};
}

/// Keeps the model over position and temperature, or rolls back and throws std::runtime_error.
job::Task ThermalCalibration::verify(const ThermalJob& job,
                                     const std::array<std::filesystem::path, 2>& files) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  host_.tell("comparing with the model of room temperature at one temperature", 0.5);
  co_await reach(job, job.fixed);
  recording::Table fixed = heat_table(true);
  co_await compare(job, nullptr, files, fixed);
  fixed.write(folder / "verify_fixed.csv");
  host_.tell("comparing with the model of room temperature while the temperature varies", 0.7);
  recording::Table varying = heat_table(true);
  co_await compare(job, &job.verify, files, varying);
  varying.write(folder / "verify_varying.csv");

  set_heater(*setpoint_before_);
  setpoint_before_.reset();
  for (const auto* one : {&fixed, &varying})
    if (square_mean(*one, models[1]) > square_mean(*one, models[0]))
      co_await models_.roll_back(
          "the model makes the error larger than that of room temperature; rolled back");
  co_await models_.keep();
}

job::Task ThermalCalibration::run(const ThermalJob& job) {
  began_ = owner_.now();
  if (temperature_.latest() == nullptr) co_await job::wait(owner_, 5.0);  // the cell is coming up
  if (temperature_.latest() == nullptr)
    throw std::runtime_error{"no temperature arrives: connect `temperature` and `heater`"};
  setpoint_before_ = temperature_.latest()->setpoint();
  co_await host_.enable_axes();
  co_await models_.clear("thermal");

  recording::Table table = heat_table(false);
  std::size_t cold_rows = 0;
  co_await measure(job, table, cold_rows);
  host_.tell("identifying the error over position and temperature", 0.5);
  std::array<std::filesystem::path, 2> files;
  identify(job, table, cold_rows, files);
  co_await verify(job, files);
}

}  // namespace invar::calibration

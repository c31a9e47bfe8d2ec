// The calibration over position and temperature: a line read again and again while the heater follows a trace, the fit,
// and what the model is worth at points and temperatures that were not fitted.
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "components/calibration/calibration.hpp"
#include "components/calibration/identify.hpp"
#include "core/base/new_file.hpp"

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

/// Columns of thermal.csv (docs/reference/calibration-files.md#thermalcsv); with the model that was in use for those of
/// a comparison.
recording::Table Calibration::heat_table(bool with_models) const {
  recording::Table table;
  if (with_models) table.add_texts("model", {});
  table.add("t", "s", {});
  table.add("x", "m", {});
  table.add("temperature", "degC", {});
  table.add("heating_rate", "K/s", {});
  for (const std::string& zone : parameters_.zones) table.add("temperature_" + zone, "degC", {});
  table.add("error", "m", {});
  table.add("direction", "", {});
  table.add("cycle", "", {});
  return table;
}

void Calibration::set_heater(double setpoint) {
  thermal::ThermalCommand command;
  stamp(command);
  command.id(next_id());
  command.setpoint(setpoint);
  command.enabled(true);
  heater_.write(command);
  set_at_ = now();
}

/// Each step: what the temperature did, and where the heater is to be on its trace.
void Calibration::follow_heat() {
  if (const auto* sample = temperature_.latest(); sample != nullptr && !sample->stale()) {
    const double at = static_cast<double>(sample->at().time_ns()) * 1e-9;
    heat_.add(at, sample->temperature());
    if (heat_history_.time.empty() || at - heat_history_.time.back() >= history_spacing) {
      heat_history_.time.push_back(at);
      heat_history_.temperature.push_back(sample->temperature());
    }
    if (heat_history_.time.size() > most_history) {  // the oldest quarter goes
      const auto quarter = static_cast<std::ptrdiff_t>(most_history / 4);
      heat_history_.time.erase(heat_history_.time.begin(), heat_history_.time.begin() + quarter);
      heat_history_.temperature.erase(heat_history_.temperature.begin(),
                                      heat_history_.temperature.begin() + quarter);
    }
  }
  if (trace_ != nullptr && now() - set_at_ >= Duration::seconds(set_each))
    set_heater(trace_->at((now() - trace_start_).in_seconds()));
}

/// Holds a temperature until it has stood there for the soak.
Task Calibration::reach(const ThermalJob& job, double temperature) {
  trace_ = nullptr;
  set_heater(temperature);
  const Instant began = now();
  Instant away = now();
  while (now() - away < Duration::seconds(job.soak)) {
    co_await NextStep{};
    const auto* sample = temperature_.latest();
    if (sample == nullptr || sample->stale() || std::abs(sample->temperature() - temperature) > job.tolerance)
      away = now();
    if (now() - began > Duration::seconds(job.steady_timeout))
      throw std::runtime_error{"the temperature does not settle at " + std::to_string(temperature) +
                               " degC within `steady_timeout`"};
  }
}

/// The line once forth and back.
Task Calibration::pass(const Pass& what, recording::Table& table) {
  const Point from = what.job.line.start();
  const Point way = what.job.line.end() - from;
  const auto intervals = std::max<std::int64_t>(1, std::llround(way.norm() / what.job.interval));
  const std::int64_t points = what.between ? intervals : intervals + 1;
  for (std::int64_t k = 0; k < 2 * points; ++k) {
    const bool forth = k < points;
    const double at = static_cast<double>(forth ? k : 2 * points - 1 - k) + (what.between ? 0.5 : 0.0);
    const Point target = from + way * (at / static_cast<double>(intervals));
    co_await move_to(target, {});
    double displacement = 0.0;
    co_await average_reading(what.job.readings, displacement);
    const auto* heat = temperature_.latest();
    if (heat == nullptr || heat->stale()) throw std::runtime_error{"no sound temperature arrives"};
    std::vector<double> row{(now() - began_).in_seconds(), target[static_cast<Eigen::Index>(what.job.axis())],
                            heat->temperature(), heat_.rate()};
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
Task Calibration::compare(const ThermalJob& job, const TraceSpec* trace,
                          const std::array<std::filesystem::path, 2>& files, recording::Table& table) {
  trace_ = trace;
  trace_start_ = now();
  for (int number = 0;; ++number) {
    const bool over =
        trace == nullptr ? number >= 4 : now() - trace_start_ > Duration::seconds(trace->length());
    if (over && number % 2 == 0) break;
    const auto which = static_cast<std::size_t>(number % 2);
    co_await use_model(files[which]);
    const Pass next{job, true, std::floor(number / 2.0) + 1.0, models[which]};
    co_await pass(next, table);
  }
  trace_ = nullptr;
}

Task Calibration::run(const ThermalJob& job) {
  began_ = now();
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  if (const auto* heat = temperature_.latest(); heat == nullptr) co_await wait(5.0);  // the cell is coming up
  if (temperature_.latest() == nullptr)
    throw std::runtime_error{"no temperature arrives: connect `temperature` and `heater`"};
  setpoint_before_ = temperature_.latest()->setpoint();
  co_await enable_axes();
  co_await clear_models("thermal");
  const std::uint32_t above = model_status_.latest()->geometric_checksum();

  report(job::JOB_RUNNING, "waiting for the room temperature of the slide");
  co_await reach(job, job.room);
  co_await move_to(job.line.start(), {});
  co_await align(job.line.start(), job.line.end());
  recording::Table table = heat_table(false);
  double number = 0.0;
  for (std::int64_t k = 0; k < job.room_passes; ++k) {
    const Pass next{job, false, ++number, ""};
    co_await pass(next, table);
  }
  const std::size_t cold_rows = table.rows();
  progress_ = 0.1;

  report(job::JOB_RUNNING, "reading the line while the slide is heated and cools");
  trace_ = &job.trace;
  trace_start_ = now();
  while (now() - trace_start_ < Duration::seconds(job.trace.length())) {
    const Pass next{job, false, ++number, ""};
    co_await pass(next, table);
    co_await wait(job.pause);
    progress_ = 0.1 + 0.4 * std::min(1.0, (now() - trace_start_).in_seconds() / job.trace.length());
  }
  trace_ = nullptr;
  const std::filesystem::path source = folder / "thermal.csv";
  table.write(source);

  report(job::JOB_RUNNING, "identifying the error over position and temperature");
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
    auto readings = heat_readings(table, parameters_.zones, of);
    // A body that lags also remembers the passes left out, and what was before; by the clock of the table.
    readings.history = heat_history_;
    for (double& at : readings.history.time) at -= began_.in_seconds();
    return readings;
  };
  const auto axis = job.axis();
  metrology::ThermalReadings at_room = rows(cold);
  at_room.heating_rate.reset();  // what little the temperature did there is noise
  at_room.time.reset();
  at_room.zones.clear();
  const IdentifiedHeat room = identify_heat(at_room, axis, above, source, folder / "room");
  const IdentifiedHeat heat = identify_heat(rows(fitted), axis, above, source, folder);
  write_models_tried(heat.fit, folder / "models_tried.txt");
  const metrology::ThermalReadings everything = rows(all);
  if (left_over(everything, heat.fit.model, left_out) > left_over(everything, room.fit.model, left_out))
    throw std::runtime_error{
        "the model is worse than that of room temperature on passes that were not fitted; it was not "
        "activated"};

  report(job::JOB_RUNNING, "comparing with the model of room temperature at one temperature");
  co_await reach(job, job.fixed);
  recording::Table fixed = heat_table(true);
  const std::array<std::filesystem::path, 2> files{room.file, heat.file};
  co_await compare(job, nullptr, files, fixed);
  fixed.write(folder / "verify_fixed.csv");
  progress_ = 0.7;
  report(job::JOB_RUNNING, "comparing with the model of room temperature while the temperature varies");
  recording::Table varying = heat_table(true);
  co_await compare(job, &job.verify, files, varying);
  varying.write(folder / "verify_varying.csv");

  set_heater(*setpoint_before_);
  setpoint_before_.reset();
  for (const auto* one : {&fixed, &varying})
    if (square_mean(*one, models[1]) > square_mean(*one, models[0]))
      co_await roll_back("the model makes the error larger than that of room temperature; rolled back");
  co_await keep_models();
  progress_ = 1.0;
  report(job::JOB_DONE, "done");
}

}  // namespace invar::calibration

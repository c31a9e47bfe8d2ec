// An axis in closed loop from its reference alone, or in open loop from its current.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/physics/simulate_plants.hpp"

namespace invar::physics {

namespace {

double first_or(const Record& record, const char* name, double otherwise) {
  const auto* values = record.find(name);
  return values == nullptr || values->empty() || !std::isfinite(values->front()) ? otherwise
                                                                                 : values->front();
}

/// What a cubic through two rows on each side adds to a straight line `at` ticks into a gap of `gap` ticks before `row`.
/// `before`, `after`: ticks to the rows beyond.
double bend(const std::vector<double>& values, std::size_t row, std::size_t gap, std::size_t at,
            std::size_t before, std::size_t after) {
  const double g = static_cast<double>(gap), x = static_cast<double>(at);
  const double known[] = {-static_cast<double>(before), 0.0, g, g + static_cast<double>(after)};
  double cubic = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    double weight = 1.0;
    for (std::size_t j = 0; j < 4; ++j)
      if (j != i) weight *= (x - known[j]) / (known[i] - known[j]);
    cubic += weight * values[row - 2 + i];
  }
  return cubic - (values[row - 1] + x / g * (values[row] - values[row - 1]));
}

/// Cycles of the controller from row to row, as a rule; 1 of a single row.
double usual_cycles(const std::vector<double>& time, double rate) {
  std::vector<double> cycles;
  for (std::size_t i = 1; i < time.size(); ++i) cycles.push_back((time[i] - time[i - 1]) * rate);
  if (cycles.empty()) return 1.0;
  const auto middle = cycles.begin() + static_cast<std::ptrdiff_t>(cycles.size() / 2);
  std::nth_element(cycles.begin(), middle, cycles.end());
  return *middle;
}

/// The controller ticks at its own rate; every row is the record of one tick, the nearest to its time stamp, or where rows
/// come faster of what the carriage did behind it.
class ClosedLoop final : public Simulation {
 public:
  ClosedLoop(const Model& structure, const Record& inputs) {
    const double rate = structure.controller->rate;
    period_ = 1.0 / rate;
    start_time_ = inputs.time.front();
    const auto reference = bridged(inputs.time, inputs.signals.at("reference"));
    const auto* temperatures = inputs.find("temperature");
    const auto temperature =
        temperatures != nullptr ? bridged(inputs.time, *temperatures) : std::vector<double>{};
    const auto* forwards = inputs.find("feedforward");
    const auto forward = forwards != nullptr ? bridged(inputs.time, *forwards) : std::vector<double>{};
    tick_of_row_.reserve(inputs.rows());
    const bool goes_on = structure.reference_goes_on.value_or(false);
    const double cycles_a_row = usual_cycles(inputs.time, rate);
    const std::size_t usual = goes_on ? 1 : static_cast<std::size_t>(std::max(1L, std::lround(cycles_a_row)));
    const bool within = cycles_a_row < 0.75;  // some rows are records of what the carriage did within a cycle
    for (std::size_t row = 0; row < inputs.rows(); ++row) {
      constexpr double trifle = 0.02;  // of a cycle
      const double cycles = std::max(0.0, (inputs.time[row] - start_time_) * rate);
      const auto tick = static_cast<std::size_t>(within ? std::floor(cycles + trifle) : std::round(cycles));
      if (within) {
        const double part = cycles - static_cast<double>(tick);
        behind_tick_.push_back(part > trifle ? part * period_ : 0.0);
      }
      tick_of_row_.push_back(tick);
      // Ticks that no row records, where most have one: the reference is bridged, a lost cycle or two by a cubic, more by a
      // straight line. Where few have one it is held from row to row, and lost rows are put back first.
      const std::size_t known = reference_.size();
      if (tick < known) continue;
      const double from = row == 0 ? reference[0] : reference_.back();
      const double warm = row == 0 || temperature.empty() ? 20.0 : temperature_.back();
      const double fed = row == 0 || forward.empty() ? 0.0 : forward_.back();
      const std::size_t gap = tick + 1 - known, step = 2 * gap <= 3 * usual ? std::max(usual, gap) : usual;
      const std::size_t before = row > 1 ? tick_of_row_[row - 1] - tick_of_row_[row - 2] : 0,
                        after = row + 1 < inputs.rows()
                                    ? static_cast<std::size_t>(std::max(
                                          0L, std::lround((inputs.time[row + 1] - inputs.time[row]) * rate)))
                                    : 0;
      const bool curved = step == 1 && gap > 1 && before > 0 && after > 0 &&
                          gap <= 3 * std::min(before, after) && (goes_on || (before == 1 && after == 1));
      for (std::size_t k = known; k <= tick; ++k) {
        const std::size_t passed = k + 1 - known;
        const double share =
            passed == gap ? 1.0 : static_cast<double>(passed / step * step) / static_cast<double>(gap);
        reference_.push_back(from + share * (reference[row] - from) +
                             (curved ? bend(reference, row, gap, passed, before, after) : 0.0));
        if (!temperature.empty())
          temperature_.push_back(row == 0 ? temperature[0] : warm + share * (temperature[row] - warm));
        if (!forward.empty()) forward_.push_back(row == 0 ? forward[0] : fed + share * (forward[row] - fed));
      }
    }
    start_position_ = first_or(inputs, "position", reference_.front());
    start_velocity_ = first_or(inputs, "velocity", 0.0);
    if (inputs.rows() > 1)
      start_moves_ = (reference[1] - reference[0]) / (inputs.time[1] - inputs.time[0]) * period_;
    start_current_ = first_or(inputs, "current", std::numeric_limits<double>::quiet_NaN());
    limit_ = structure.controller->limit;
    records_applied_ = structure.records_applied;
  }

  void run(const Model& model, Outputs& outputs) const override {
    std::vector<Outputs> all;
    run_all({&model}, all);
    outputs = std::move(all.front());
  }

  /// Tick by tick side by side: a processor works on one loop while it waits for another.
  void run_all(const std::vector<const Model*>& models, std::vector<Outputs>& outputs) const override {
    std::vector<Loop> loops;
    loops.reserve(models.size());
    outputs.resize(models.size());
    for (std::size_t i = 0; i < models.size(); ++i) {
      loops.push_back(begun(*models[i]));
      outputs[i].assign(2, std::vector<double>(tick_of_row_.size(), 0.0));
    }
    std::size_t row = 0;
    for (std::size_t tick = 0; tick < reference_.size(); ++tick) {
      std::size_t next = row;
      while (next < tick_of_row_.size() && tick_of_row_[next] <= tick) ++next;
      for (std::size_t i = 0; i < loops.size(); ++i) {
        auto& [plant, controller] = loops[i];
        const double shown = plant.reading();
        double command = controller.step(reference_[tick], shown);
        if (!forward_.empty()) {
          command += forward_[tick];
          if (limit_ > 0.0) command = std::clamp(command, -limit_, limit_);
        }
        if (!temperature_.empty()) plant.set_temperature(temperature_[tick]);
        const double recorded = records_applied_ ? plant.applied(command, period_) : command;
        double gone = 0.0;
        for (std::size_t r = row; r < next; ++r) {
          if (!behind_tick_.empty() && behind_tick_[r] > gone)
            plant.step(command, behind_tick_[r] - gone), gone = behind_tick_[r];
          outputs[i][0][r] = gone > 0.0 ? plant.reading() : shown, outputs[i][1][r] = recorded;
        }
        plant.step(command, period_ - gone);
      }
      row = next;
    }
  }

 private:
  struct Loop {
    AxisPlant plant;
    AxisController controller;
  };

  [[nodiscard]] Loop begun(const Model& model) const {
    Loop loop{make_axis(model, period_), AxisController{*model.controller}};
    loop.plant.rest_at(start_position_, start_time_);
    if (start_velocity_ != 0.0) {  // a loop without a sum that was on its way: its filter has followed
      loop.plant.go_on_from(start_position_, start_velocity_);
      const double reading = loop.plant.reading();
      for (double k = -100.0; k < 0.0; ++k)
        (void)loop.controller.step(reference_.front() + k * start_moves_,
                                   reading + k * start_velocity_ * period_);
    }
    if (std::isfinite(start_current_)) {  // a loop that has run before: its sum holds what the error does not
      AxisController fresh{*model.controller};
      const double command =
          (forward_.empty() ? 0.0 : forward_.front()) + fresh.step(reference_.front(), loop.plant.reading());
      (void)loop.controller.shift(start_current_ -
                                  (records_applied_ ? loop.plant.applied(command, period_) : command));
    }
    return loop;
  }

  bool records_applied_ = false;
  double period_ = 1e-3, start_time_ = 0.0, start_position_ = 0.0, start_velocity_ = 0.0, start_moves_ = 0.0,
         start_current_ = 0.0, limit_ = 0.0;
  std::vector<double> reference_, temperature_, forward_;  // a tick
  std::vector<std::size_t> tick_of_row_;
  std::vector<double> behind_tick_;  // [s] by row; empty: every row is a tick
};

class OpenLoop final : public Simulation {
 public:
  OpenLoop(const Model& structure, const Record& inputs)
      : time_{inputs.time},
        current_{bridged(inputs.time, inputs.signals.at("current"))},
        start_position_{first_or(inputs, "position", 0.0)},
        restarts_{restarts_of(structure, inputs)} {
    if (const auto* values = inputs.find("temperature")) temperature_ = bridged(inputs.time, *values);
    for (std::size_t i = 1; i < time_.size(); ++i) longest_ = std::max(longest_, time_[i] - time_[i - 1]);
  }

  void run(const Model& model, Outputs& outputs) const override {
    auto plant = make_axis(model, longest_ > 0.0 ? longest_ : 1e-3);
    plant.rest_at(start_position_, time_.front());
    outputs.resize(1);
    outputs[0].resize(time_.size());
    auto restart = restarts_.begin();
    for (std::size_t row = 0; row < time_.size(); ++row) {
      if (restart != restarts_.end() && restart->row == row) {
        plant.go_on_from(model.parameters[restart->parameters[0]].value,
                         model.parameters[restart->parameters[1]].value);
        ++restart;
      }
      outputs[0][row] = plant.reading();
      if (row + 1 == time_.size()) break;
      if (!temperature_.empty()) plant.set_temperature(temperature_[row]);
      plant.step(current_[row], time_[row + 1] - time_[row]);
    }
  }

 private:
  std::vector<double> time_, current_, temperature_;
  double start_position_ = 0.0, longest_ = 0.0;
  std::vector<Restart> restarts_;
};

}  // namespace

std::unique_ptr<Simulation> prepare_axis(const Model& structure, const Record& inputs) {
  if (structure.controller) return std::make_unique<ClosedLoop>(structure, inputs);
  return std::make_unique<OpenLoop>(structure, inputs);
}

}  // namespace invar::physics

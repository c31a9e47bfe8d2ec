// Error maps, droplets and sensors: outputs that follow from their inputs row by row, with little or no memory.
#include <algorithm>
#include <cmath>

#include "core/physics/approach.hpp"
#include "core/physics/library.hpp"
#include "core/physics/simulate_plants.hpp"
#include "core/physics/spline.hpp"
#include "core/physics/static_plants.hpp"
#include "core/physics/temperatures.hpp"

namespace invar::physics {

namespace {

std::vector<double> taken(const Record& inputs, const char* name, double otherwise = 0.0) {
  const auto* values = inputs.find(name);
  return values == nullptr ? std::vector<double>(inputs.rows(), otherwise) : bridged(inputs.time, *values);
}

/// The value over which a Curve goes in one row.
struct Variables {
  const Record* record;
  std::map<std::string, std::vector<double>, std::less<>> columns;
  explicit Variables(const Record& inputs) : record{&inputs} {
    for (const auto& [name, values] : inputs.signals) columns[name] = bridged(inputs.time, values);
    columns["time"] = inputs.time;
  }
  [[nodiscard]] const std::vector<double>* find(const std::string& name) const {
    const auto at = columns.find(name);
    return at == columns.end() ? nullptr : &at->second;
  }
};

class ErrorMap final : public Simulation {
 public:
  ErrorMap(const Model& model, const Record& inputs)
      : variables_{inputs},
        time_{inputs.time},
        position_{taken(inputs, "position")},
        direction_{inputs.find("direction") != nullptr ? taken(inputs, "direction")
                                                       : directions_of_approach(position_)},
        pressure_{taken(inputs, "pressure", 1013.25)},
        offset_{taken(inputs, "offset")},
        temperatures_{taken_temperatures(inputs)} {
    const CubicSpline baseline{model.baseline.positions, model.baseline.errors};
    for (double x : position_) baseline_.push_back(baseline(x));
    first_ = model.baseline.positions.front(), last_ = model.baseline.positions.back();
    if (!(last_ > first_)) last_ = first_ + 1.0;
  }

  void run(const Model& model, Outputs& outputs) const override {
    const std::size_t n = time_.size();
    outputs.resize(1);
    auto& error = outputs[0];
    error = baseline_;
    const double reference = model.value("reference_temperature", 20.0);
    const double expansion = model.value("expansion");
    const auto warmths = warmths_of(model, reference);
    const auto& nominal = warmths.at("temperature");
    for (std::size_t i = 0; i < n; ++i) error[i] += expansion * nominal[i] * position_[i];
    for (const auto& term : model.terms) {
      const auto* kind = error_map_kind(*term.info);
      const auto& late = found(warmths, temperature_of(term));
      if (kind->error != nullptr)
        for (std::size_t i = 0; i < n; ++i)
          error[i] += kind->error(
              {time_[i], position_[i], direction_[i], late[i], pressure_[i], offset_[i], first_, last_},
              term.values.data());
      if (const auto* over = variables_.find(term.curve.over); !term.curve.knots.empty() && over != nullptr)
        for (std::size_t i = 0; i < n; ++i) error[i] += term.curve((*over)[i]) * factor(term, i, warmths);
    }
  }

 private:
  /// By temperature, of each row above the reference.
  using Warmths = std::map<std::string, std::vector<double>, std::less<>>;

  /// Those that are recorded; `temperature` always.
  static Warmths taken_temperatures(const Record& inputs) {
    Warmths all{{"temperature", {}}};
    for (const auto& [name, values] : inputs.signals)
      if (is_temperature(name)) all[name] = bridged(inputs.time, values);
    return all;
  }

  static const std::vector<double>& found(const Warmths& all, std::string_view name) {
    const auto at = all.find(name);
    return at == all.end() ? all.find("temperature")->second : at->second;
  }

  /// As the scale feels them.
  [[nodiscard]] Warmths warmths_of(const Model& model, double reference) const {
    Warmths all = temperatures_;
    for (auto& [name, warmth] : all) {
      if (warmth.empty()) warmth.assign(time_.size(), reference);
      for (double& one : warmth) one -= reference;
    }
    const Warmths warmths = all;
    for (const auto& term : model.terms) {
      if (!error_map_kind(*term.info)->delays_warmth || !(term.values[0] > 0.0)) continue;
      const auto at = all.find(temperature_of(term));
      if (at != all.end()) follow(found(warmths, temperature_of(term)), term.values[0], at->second);
    }
    return all;
  }

  /// Exact for a temperature that goes straight from row to row.
  void follow(const std::vector<double>& warmth, double tau, std::vector<double>& late) const {
    for (std::size_t i = 1; i < late.size(); ++i) {
      const double h = time_[i] - time_[i - 1];
      if (!(h > 0.0)) {
        late[i] = late[i - 1];
        continue;
      }
      const double behind = tau * (warmth[i] - warmth[i - 1]) / h;
      late[i] = warmth[i] - behind + (late[i - 1] - warmth[i - 1] + behind) * std::exp(-h / tau);
    }
  }

  /// What a curve is multiplied by: the signal that it names, else the position where a length is measured or warms.
  [[nodiscard]] double factor(const Term& term, std::size_t row, const Warmths& warmths) const {
    if (is_temperature(term.with)) return found(warmths, term.with)[row];
    if (term.with == "direction") return direction_[row];
    if (term.with == "position") return position_[row];
    return term.info->site == "measurement" || term.info->site == "thermal" ? position_[row] : 1.0;
  }

  Variables variables_;
  std::vector<double> time_, position_, direction_, pressure_, offset_;
  Warmths temperatures_;
  std::vector<double> baseline_;
  double first_ = 0.0, last_ = 1.0;
};

class Droplets final : public Simulation {
 public:
  Droplets(const Model& model, const Record& inputs)
      : variables_{inputs},
        outputs_{model.outputs()},
        target_x_{taken(inputs, "target_x")},
        target_y_{taken(inputs, "target_y")} {
    const auto height = taken(inputs, "height"), pressure = taken(inputs, "pressure");
    const auto vx = taken(inputs, "velocity_x"), vy = taken(inputs, "velocity_y");
    const auto ix = taken(inputs, "image_x"), iy = taken(inputs, "image_y");
    for (std::size_t i = 0; i < inputs.rows(); ++i) {
      Droplet d;
      d.time = inputs.time[i], d.height = height[i], d.pressure = pressure[i];
      d.image_x = ix[i], d.image_y = iy[i], d.stage_x = vx[i], d.stage_y = vy[i];
      droplets_.push_back(d);
    }
  }

  void run(const Model& model, Outputs& outputs) const override {
    const std::size_t n = droplets_.size();
    outputs.resize(outputs_.size());
    for (auto& output : outputs) output.assign(n, 0.0);
    const double px = model.value("placement_error_x"), py = model.value("placement_error_y");
    const double sx = model.value("slope_x"), sy = model.value("slope_y");
    const double speed = model.value("speed", 1.0), scale = model.value("camera_scale");
    for (std::size_t i = 0; i < n; ++i) {
      Droplet d = droplets_[i];
      d.speed = speed;
      for (const auto& term : model.terms)
        if (const auto* kind = droplet_kind(*term.info); kind->apply != nullptr)
          kind->apply(d, term.values.data());
      const auto beside = landing(d, sx, sy);
      double x = target_x_[i] + px + beside.x + scale * d.shift_x;
      double y = target_y_[i] + py + beside.y + scale * d.shift_y;
      for (const auto& term : model.terms) {
        const auto* over = term.curve.knots.empty() ? nullptr : variables_.find(term.curve.over);
        if (over != nullptr)
          (term.on == "landed_y" ? y : x) +=
              term.curve((*over)[i]) * (term.with == "height" ? d.height : 1.0);
      }
      for (std::size_t o = 0; o < outputs_.size(); ++o)
        outputs[o][i] = outputs_[o] == "landed_x" ? x : (outputs_[o] == "landed_y" ? y : std::nan(""));
    }
  }

 private:
  Variables variables_;
  std::vector<std::string> outputs_;
  std::vector<double> target_x_, target_y_;
  std::vector<Droplet> droplets_;
};

class Sensors final : public Simulation {
 public:
  Sensors(const Model& model, const Record& inputs)
      : variables_{inputs},
        outputs_{model.outputs()},
        time_{inputs.time},
        position_{taken(inputs, "true_position")} {
    const std::size_t n = time_.size();
    velocity_.assign(n, 0.0);
    std::vector<double> steps;
    for (std::size_t i = 1; i < n; ++i) steps.push_back(time_[i] - time_[i - 1]);
    double usual = 0.0;
    if (!steps.empty()) {
      std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2),
                       steps.end());
      usual = steps[steps.size() / 2];
    }
    // Central differences; beside a gap the near side alone.
    for (std::size_t i = 0; i < n; ++i) {
      std::size_t a = i == 0 ? i : i - 1, b = i + 1 == n ? i : i + 1;
      if (a < i && time_[i] - time_[a] > 3.0 * usual && b > i) a = i;
      if (b > i && time_[b] - time_[i] > 3.0 * usual && a < i) b = i;
      if (time_[b] > time_[a]) velocity_[i] = (position_[b] - position_[a]) / (time_[b] - time_[a]);
    }
    acceleration_.assign(n, 0.0);
    for (std::size_t i = 1; i + 1 < n; ++i)
      if (time_[i + 1] - time_[i - 1] < 4.0 * usual)
        acceleration_[i] = (velocity_[i + 1] - velocity_[i - 1]) / (time_[i + 1] - time_[i - 1]);
  }

  void run(const Model& model, Outputs& outputs) const override {
    outputs.resize(outputs_.size());
    const double resolution = model.value("resolution"), gain = model.value("gain", 1.0);
    const std::size_t n = time_.size();
    for (std::size_t o = 0; o < outputs_.size(); ++o) {
      const bool encoder = outputs_[o] == "encoder";
      std::vector<double> position = position_, velocity = velocity_;
      double late = 0.0;  // what is late shows through the play, in whatever order the model names them
      for (const auto& term : model.terms)
        if (term.on == outputs_[o] && sensor_kind(*term.info)->delays) late += term.values[0];
      if (late > 0.0) delay(late, position, velocity);
      for (const auto& term : model.terms)
        if (term.on == outputs_[o] && sensor_kind(*term.info)->plays)
          play(term.values[0], encoder ? position : velocity);
      auto& out = outputs[o];
      out.resize(n);
      for (std::size_t i = 0; i < n; ++i) {
        const SensorPoint at{position[i], velocity[i], encoder ? position[i] : gain * velocity[i]};
        out[i] = at.value;
        for (const auto& term : model.terms) {
          if (term.on != outputs_[o]) continue;
          const auto* kind = sensor_kind(*term.info);
          if (kind->reading != nullptr) out[i] += kind->reading(at, term.values.data());
          if (!term.curve.knots.empty()) {
            const auto* over = variables_.find(term.curve.over);
            const auto derived = term.curve.over == "velocity"       ? velocity[i]
                                 : term.curve.over == "acceleration" ? acceleration_[i]
                                                                     : position[i];
            out[i] += term.curve(over != nullptr ? (*over)[i] : derived) *
                      (term.with == "velocity"        ? velocity[i]
                       : term.with == "true_position" ? position[i]
                                                      : 1.0);
          }
        }
        if (encoder && resolution > 0.0) out[i] = resolution * std::round(out[i] / resolution);
      }
    }
  }

 private:
  /// The second divided difference of the smoother of the two parabolas between two rows: where the motion turns at once, what
  /// lies on the other side of the corner says nothing of this one (Harten's essentially non-oscillatory choice).
  [[nodiscard]] double bend(std::size_t a, std::size_t b) const {
    const auto over = [this](std::size_t first) {
      const double one = (position_[first + 1] - position_[first]) / (time_[first + 1] - time_[first]);
      const double two =
          (position_[first + 2] - position_[first + 1]) / (time_[first + 2] - time_[first + 1]);
      return (two - one) / (time_[first + 2] - time_[first]);
    };
    double least = 0.0;
    bool any = false;
    for (const std::size_t first : {a - 1, a})
      if (first < a + 1 && first + 2 < time_.size() && b == a + 1)
        if (const double here = over(first);
            std::isfinite(here) && (!any || std::abs(here) < std::abs(least)))
          least = here, any = true;
    return least;
  }
  /// Position and velocity some time ago: by a parabola through the rows, and by a straight line.
  void delay(double by, std::vector<double>& position, std::vector<double>& velocity) const {
    const std::size_t n = time_.size();
    std::size_t a = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double when = time_[i] - by;
      while (a + 1 < n && time_[a + 1] <= when) ++a;
      const std::size_t b = std::min(a + 1, n - 1);
      const double h = time_[b] - time_[a];
      if (when <= time_.front() || !(h > 0.0)) {
        position[i] = position_[i] - by * velocity_[i];
        continue;
      }
      const double s = (when - time_[a]) / h, r = 1.0 - s;
      position[i] = position_[a] * r + position_[b] * s + bend(a, b) * (when - time_[a]) * (when - time_[b]);
      velocity[i] = velocity_[a] * r + velocity_[b] * s;
    }
  }
  static void play(double width, std::vector<double>& values) {
    double shown = values.empty() ? 0.0 : values.front();
    for (double& value : values) {
      shown = std::clamp(shown, value - 0.5 * width, value + 0.5 * width);
      value = shown;
    }
  }

  Variables variables_;
  std::vector<std::string> outputs_;
  std::vector<double> time_, position_, velocity_, acceleration_;
};

}  // namespace

std::unique_ptr<Simulation> prepare_error_map(const Model& structure, const Record& inputs) {
  return std::make_unique<ErrorMap>(structure, inputs);
}
std::unique_ptr<Simulation> prepare_droplet(const Model& structure, const Record& inputs) {
  return std::make_unique<Droplets>(structure, inputs);
}
std::unique_ptr<Simulation> prepare_sensor(const Model& structure, const Record& inputs) {
  return std::make_unique<Sensors>(structure, inputs);
}

}  // namespace invar::physics

#include "tests/support/mismatch/machine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>

#include "tests/support/mismatch/plants.hpp"

namespace invar::test::mismatch {

double Draw::log_between(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }

double noise_power(const std::vector<double>& noise) {
  double squares = 0.0;
  for (const double v : noise) squares += v * v / static_cast<double>(noise.size());
  return squares;
}

double Noise::operator()() {
  switch (colour_) {
    case Colour::memory:
      last_ = pole_ * last_ + std::sqrt(1.0 - pole_ * pole_) * sigma_ * draw_->normal();
      return last_;
    case Colour::wander:  // a tenth of the power goes slowly
      last_ = 0.995 * last_ + std::sqrt((1.0 - 0.995 * 0.995) * 0.1) * sigma_ * draw_->normal();
      return last_ + std::sqrt(0.9) * sigma_ * draw_->normal();
    case Colour::resonance: {  // poles of radius 0.93 at a turn of `pole` radians a row; half the power
      const double r = 0.93, a = 2.0 * r * std::cos(pole_), b = -r * r;
      const double gain = std::sqrt((1.0 + b) * ((1.0 - b) * (1.0 - b) - a * a) / (1.0 - b));
      const double now = a * last_ + b * before_ + gain * draw_->normal();
      before_ = last_, last_ = now;
      return sigma_ * std::sqrt(0.5) * (now + draw_->normal());
    }
    case Colour::heavy: {  // Student's t of 4 degrees of freedom
      double chi = 0.0;
      for (int k = 0; k < 4; ++k) chi += std::pow(draw_->normal(), 2);
      return sigma_ * std::sqrt(0.5) * draw_->normal() / std::sqrt(chi / 4.0);
    }
    case Colour::white:
      break;
  }
  return sigma_ * draw_->normal();
}

std::string text(double value) {
  std::ostringstream out;
  out.precision(9);
  out << value;
  return out.str();
}

std::string believed(double value, const char* unit, double sigma) {
  return "{value: " + text(value) + ", unit: " + unit + ", sigma: " + text(sigma) + "}";
}

std::vector<double> motion(Draw& draw, int kind, std::size_t rows, double period, double travel) {
  std::vector<double> r(rows, 0.0);
  const double pi = std::numbers::pi, duration = static_cast<double>(rows) * period;
  if (kind == 1) {  // sines, faded in
    double f[3], a[3], p[3];
    for (int k = 0; k < 3; ++k) {
      f[k] = draw.log_between(0.3, 4.0);
      a[k] = std::min(0.16 * travel, 3.0 / std::pow(2.0 * pi * f[k], 2)), p[k] = draw.between(0.0, 6.28);
    }
    for (std::size_t i = 0; i < rows; ++i) {
      const double t = static_cast<double>(i) * period, s = std::min(1.0, t / 0.5);
      const double fade = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
      for (int k = 0; k < 3; ++k)
        r[i] += fade * a[k] * (std::sin(2.0 * pi * f[k] * t + p[k]) - std::sin(p[k]));
    }
    return r;
  }
  if (kind == 2) {  // a sweep about the middle
    const double low = 0.4, high = draw.between(8.0, 20.0);
    for (std::size_t i = 0; i < rows; ++i) {
      const double t = static_cast<double>(i) * period, rate = std::log(high / low) / duration;
      const double f = low * std::exp(rate * t), s = std::min(1.0, t / 0.5);
      const double a = std::min(0.4 * travel, 2.5 / std::pow(2.0 * pi * f, 2));
      r[i] = s * s * (3.0 - 2.0 * s) * a * std::sin(2.0 * pi * low * (std::exp(rate * t) - 1.0) / rate);
    }
    return r;
  }
  // Moves: quintic from place to place; scans go end to end at a constant speed.
  double from = 0.0, to = 0.0, begun = 0.0, lasts = 0.15, pause = 0.0;
  bool forth = true;
  for (std::size_t i = 0; i < rows; ++i) {
    const double t = static_cast<double>(i) * period;
    if (t >= begun + lasts + pause) {
      from = to, begun = t;
      if (kind == 3) {
        to = forth ? travel : 0.0;
        forth = !forth;
        lasts = travel / draw.log_between(0.03, 0.4);
      } else {
        to = draw.between(0.0, travel);
        lasts = std::max({0.08, 1.875 * std::abs(to - from) / draw.log_between(0.05, 0.6),
                          std::sqrt(5.77 * std::abs(to - from) / draw.between(1.0, 6.0))});
      }
      pause = draw.between(0.02, 0.25);
    }
    const double s = std::clamp((t - begun) / lasts, 0.0, 1.0);
    if (kind == 3) {  // constant speed between parabolic blends
      const double b = 0.06, v = 1.0 / (1.0 - b);
      const double way = s < b         ? 0.5 * v * s * s / b
                         : s > 1.0 - b ? 1.0 - 0.5 * v * (1.0 - s) * (1.0 - s) / b
                                       : v * (s - 0.5 * b);
      r[i] = from + (to - from) * way;
    } else {
      r[i] = from + (to - from) * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    }
  }
  return r;
}

std::vector<double> steps(Draw& draw, std::size_t rows, double period, double least, double most, double low,
                          double high, bool from_zero) {
  std::vector<double> values(rows);
  double level = from_zero ? 0.0 : draw.between(low, high), until = draw.between(least, most);
  for (std::size_t i = 0; i < rows; ++i) {
    if (static_cast<double>(i) * period >= until) {
      level = draw.once_in(3.0) ? low : draw.between(low, high);
      until += draw.between(least, most);
    }
    values[i] = level;
  }
  return values;
}

namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// Gaps, empty cells, outliers, repeated and swapped rows. The first three rows stay: they are the start.
void damage(recording::Table& table, const std::vector<std::string>& outputs, Draw& draw) {
  const std::size_t rows = table.rows();
  for (auto& column : table.columns) {
    if (std::find(outputs.begin(), outputs.end(), column.name) == outputs.end()) continue;
    double low = 1e300, high = -1e300;
    for (double v : column.values) low = std::min(low, v), high = std::max(high, v);
    for (std::size_t i = 3; i < rows; ++i) {
      if (draw.once_in(400.0)) column.values[i] = nothing;
      if (draw.once_in(800.0)) column.values[i] += draw.sign() * draw.between(0.05, 0.5) * (high - low);
    }
  }
  std::vector<std::size_t> order;
  const std::size_t gap = rows / 4 + draw.index(rows / 2), width = rows > 2000 ? 12 : 2;
  for (std::size_t i = 0; i < rows; ++i) {
    if (i >= gap && i < gap + width) continue;
    order.push_back(i);
    if (draw.once_in(500.0)) order.push_back(i);
  }
  for (std::size_t i = 4; i + 1 < order.size(); ++i)
    if (draw.once_in(300.0)) std::swap(order[i], order[i + 1]);
  for (auto& column : table.columns) {
    std::vector<double> values;
    for (const auto i : order) values.push_back(column.values[i]);
    column.values = std::move(values);
  }
}

/// Writes a column in steps about as large as its noise.
void quantise(recording::Table& table, const recording::Table& quiet, const std::string& name, Draw& draw) {
  auto column =
      std::find_if(table.columns.begin(), table.columns.end(), [&](const auto& c) { return c.name == name; });
  const auto& smooth = quiet.find(name)->values;
  double square = 0.0;
  for (std::size_t i = 0; i < smooth.size(); ++i) square += std::pow(column->values[i] - smooth[i], 2);
  const double step = draw.between(0.5, 2.0) *
                      std::sqrt(square / static_cast<double>(std::max<std::size_t>(1, smooth.size())));
  if (!(step > 0.0)) return;
  for (double& v : column->values) v = step * std::round(v / step);
}

/// Columns get names that say nothing.
void rename(Machine& machine) {
  std::map<std::string, std::string> names;
  for (const auto& column : machine.recordings.front().columns)
    names.emplace(column.name, "c" + std::to_string(37 + 5 * names.size()));
  for (auto* table : {&machine.test_inputs, &machine.test_outputs})
    for (auto& column : table->columns) column.name = names.at(column.name);
  for (auto* tables : {&machine.recordings, &machine.quiet})
    for (auto& table : *tables)
      for (auto& column : table.columns) column.name = names.at(column.name);
  std::map<std::string, std::vector<double>> noise;
  for (auto& [name, values] : machine.noise) noise[names.at(name)] = std::move(values);
  machine.noise = std::move(noise);
  for (const auto& [from, to] : names) {
    std::size_t at = 0;
    while ((at = machine.yaml.find(from, at)) != std::string::npos) {
      machine.yaml.replace(at, from.size(), to);
      at += to.size();
    }
  }
}

}  // namespace

Machine make(const std::string& plant, const std::string& effect, double size, unsigned seed,
             const Trouble& trouble) {
  Draw draw{seed * 2654435761U + 97U};
  Wish wish;
  std::istringstream parts{effect};
  for (std::string part; std::getline(parts, part, '+');)
    if (part != "none") wish.effects.push_back(part);
  wish.size = size;
  wish.colour = trouble.colour, wish.rows = trouble.rows, wish.muted = trouble.muted,
  wish.crowd = trouble.crowd;
  Machine machine = plant == "axis"        ? make_axis(wish, draw)
                    : plant == "thermal"   ? make_thermal(wish, draw)
                    : plant == "error_map" ? make_error_map(wish, draw)
                    : plant == "droplet"   ? make_droplet(wish, draw)
                    : plant == "sensor"    ? make_sensor(wish, draw)
                                           : make_equations(wish, draw);
  machine.plant = plant, machine.effect = effect;
  if (!(machine.size > 0.0)) machine.size = size;
  machine.parameter_is_off = wish.has("parameter");
  if (machine.verdicts.empty()) {
    if (machine.missing.empty())
      machine.verdicts = {{machine.parameter_is_off ? "parameters_only" : "no_mismatch", 1.0}};
    else if (machine.missing.front().names.contains("unmodelled"))
      machine.verdicts = {{"unknown_physics", 1.0}, {"partly_explained", 0.5}};
    else
      machine.verdicts = {{"explained", 1.0}, {"partly_explained", 0.5}};
  }
  std::vector<std::string> outputs;
  for (const auto& column : machine.test_outputs.columns) outputs.push_back(column.name);
  outputs.erase(outputs.begin());  // the time
  if (trouble.quantised)
    for (std::size_t r = 0; r < machine.recordings.size(); ++r)
      for (const auto& name : outputs) quantise(machine.recordings[r], machine.quiet[r], name, draw);
  for (const auto& name : outputs) {
    auto& noise = machine.noise[name];
    noise = machine.recordings.front().find(name)->values;
    const auto& quiet = machine.quiet.front().find(name)->values;
    for (std::size_t i = 0; i < noise.size(); ++i) noise[i] -= quiet[i];
  }
  if (trouble.faults) {
    for (auto& table : machine.recordings) damage(table, outputs, draw);
  }
  if (trouble.renamed) rename(machine);
  return machine;
}

std::vector<std::string> effects(const std::string& plant) {
  if (plant == "axis")
    return {"none",
            "parameter",
            "coulomb_friction",
            "stribeck_friction",
            "presliding_friction",
            "force_ripple",
            "position_stiffness",
            "constant_force",
            "quadratic_drag",
            "motor_constant_ripple",
            "magnetic_saturation",
            "transport_delay",
            "amplifier_lag",
            "dead_zone",
            "additive_disturbance",
            "encoder_periodic_error",
            "backlash",
            "measurement_delay",
            "flexible_mode",
            "periodic_disturbance",
            "slow_drift",
            "unknown:dent",
            "unknown:grip",
            "unknown:warm_motor"};
  if (plant == "thermal")
    return {"none",          "parameter",         "radiation",         "speed_dependent_convection",
            "hidden_node",   "sensor_lag",        "node_coupling",     "motor_heating",
            "ambient_drift", "heater_saturation", "unknown:open_door", "unknown:visitor"};
  if (plant == "error_map")
    return {"none",        "parameter",         "periodic_error",   "backlash",         "abbe_offset",
            "sag",         "thermal_expansion", "heating_rate_lag", "refractive_index", "unknown:slip",
            "unknown:dent"};
  if (plant == "droplet")
    return {"none",        "parameter",   "stage_velocity_carry", "air_drag",        "crosswind",
            "speed_decay", "valve_delay", "pressure_dependence",  "lens_distortion", "camera_rotation",
            "unknown:jump"};
  if (plant == "sensor")
    return {"none",       "parameter",      "latency",    "bias",
            "gain_droop", "periodic_error", "hysteresis", "unknown:warming"};
  return {"none", "parameter", "dry_friction", "quadratic", "cubic", "coupling", "constant", "lag"};
}

}  // namespace invar::test::mismatch

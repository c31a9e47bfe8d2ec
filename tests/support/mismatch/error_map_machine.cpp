// Axes measured point by point: runs forth and back while the machine warms and the barometer moves.
#include <cmath>
#include <numbers>

#include "tests/support/mismatch/plants.hpp"

namespace invar::test::mismatch {

namespace {

constexpr double pi = std::numbers::pi;

struct Truth {
  double travel = 0.3, expansion = 0.0, late = 0.0;
  double wave = 0.0, pitch = 0.02, phase = 0.0, gap = 0.0, tilt = 0.0, tilt_change = 0.0, sag = 0.0,
         air = 0.0;
  double slip = 0.0, slip_time = 0.0, dent = 0.0, dent_place = 0.0;
  double curve_a = 2e-6, curve_b = 1e-6, curve_phase = 0.0;  // what the last calibration found

  [[nodiscard]] double calibrated(double x) const {
    return curve_a * std::sin(2.0 * pi * x / travel + curve_phase) - curve_a * std::sin(curve_phase) +
           curve_b * x / travel;
  }
};

}  // namespace

Machine make_error_map(const Wish& wish, Draw& draw) {
  Truth m;
  const auto size = [&](const char* name) { return wish.of(name); };
  m.travel = draw.between(0.15, 0.6);
  const double noise = draw.log_between(5e-8, 3e-7), unit = 3.0 * noise;
  m.curve_a = draw.between(1e-6, 5e-6), m.curve_b = draw.between(-3e-6, 3e-6);
  m.curve_phase = draw.between(0.0, 6.28);
  m.wave = size("periodic_error") * unit, m.pitch = draw.log_between(0.03, 0.25) * m.travel;
  m.phase = draw.between(0.0, 6.28);
  m.gap = size("backlash") * 2.0 * unit;
  m.tilt = size("abbe_offset") * unit / 0.04, m.tilt_change = m.tilt * draw.between(-1.5, 1.5);
  m.sag = size("sag") * 1.5 * unit * draw.sign();
  m.air = size("refractive_index") * 2.7e-7;
  const bool expands = wish.has("heating_rate_lag") || wish.has("thermal_expansion");
  const double warm_by = draw.between(2.0, 8.0);
  m.expansion = wish.has("thermal_expansion") ? wish.size * 2.0 * unit / (warm_by * m.travel)
                                              : (expands ? draw.between(5e-6, 1.2e-5) : 0.0);
  const double interval = draw.between(4.0, 8.0);
  m.late = size("heating_rate_lag") * 60.0;
  const double reference = draw.between(19.0, 23.0);
  const bool has_pressure = wish.has("refractive_index") || draw.once_in(3.0);
  const bool has_offset = wish.has("abbe_offset") || draw.once_in(3.0);

  const auto measure = [&](int passes, int points, double begin) {
    recording::Table t;
    std::vector<double> time, position, direction, temperature, pressure, offset, error;
    double scale_warmth = 0.0, now = begin, last = 0.0, last_time = now;
    const double total = passes * points * interval, barometer = draw.between(2.0, 6.0);
    const double base_pressure = draw.between(1000.0, 1025.0), wave = draw.between(0.5, 1.5) * total;
    if (wish.has("unknown:slip") && begin == 0.0)
      m.slip = wish.size * 2.0 * unit * draw.sign(), m.slip_time = draw.between(0.3, 0.6) * total;
    const double warming = total * draw.between(0.2, 0.5);
    for (int p = 0; p < passes; ++p) {
      const double beside = has_offset ? 0.02 * static_cast<double>(draw.index(5)) - 0.04 : 0.0;
      for (int i = 0; i < points; ++i, now += interval) {
        const double share = (i + draw.between(0.05, 0.95)) / points;
        const double x = m.travel * (p % 2 == 0 ? share : 1.0 - share);
        const double since = now - begin;
        // Warms, and cools again in the second half.
        const double warmth =
            warm_by * (since < 0.5 * total ? 1.0 - std::exp(-since / warming)
                                           : (1.0 - std::exp(-0.5 * total / warming)) *
                                                 std::exp(-(since - 0.5 * total) / warming));
        if (m.late > 0.0) {  // exact for straight pieces
          const double h = now - last_time;
          const double kept = h > 0.0 ? std::exp(-h / m.late) : 1.0,
                       rate = h > 0.0 ? (warmth - last) / h : 0.0;
          scale_warmth = warmth - rate * m.late + (scale_warmth - last + rate * m.late) * kept;
        } else {
          scale_warmth = warmth;
        }
        last = warmth, last_time = now;
        const double air = base_pressure + barometer * std::sin(2.0 * pi * since / wave);
        const double s = x / m.travel;
        double e = m.calibrated(x) + m.expansion * scale_warmth * x;
        e += m.wave * std::sin(2.0 * pi * x / m.pitch + m.phase) + 0.5 * m.gap * (p % 2 == 0 ? 1.0 : -1.0);
        e += beside * (m.tilt + m.tilt_change * (s - 0.5)) - m.sag * 4.0 * s * (1.0 - s);
        e += m.air * (air - 1013.25) * x;
        if (m.slip != 0.0 && (begin > 0.0 || now >= m.slip_time)) e += m.slip;
        if (wish.has("unknown:dent"))
          e += wish.size * 3.0 * unit * std::exp(-0.5 * std::pow((s - 0.4) / 0.03, 2));
        time.push_back(now), position.push_back(x), direction.push_back(p % 2 == 0 ? 1.0 : -1.0);
        temperature.push_back(reference + warmth), pressure.push_back(air), offset.push_back(beside);
        error.push_back(e);
      }
    }
    t.add("col_time", "s", time);
    t.add("col_place", "mm", [&] {
      auto mm = position;
      for (double& x : mm) x *= 1e3;
      return mm;
    }());
    t.add("col_way", "1", direction);
    t.add("col_warmth", "degC", temperature);
    if (has_pressure) t.add("col_air", "hPa", pressure);
    if (has_offset) t.add("col_beside", "m", offset);
    t.add("col_error", "m", error);
    return t;
  };
  Machine machine;
  machine.yaml =
      "invar_model: 1\nplant: error_map\ncolumns: {time: col_time, position: col_place, direction: col_way, "
      "temperature: col_warmth, " +
      std::string{has_pressure ? "pressure: col_air, " : ""} + (has_offset ? "offset: col_beside, " : "") +
      "error: col_error}\nbaseline:\n  positions: [";
  std::string errors;
  for (int k = 0; k <= 50; ++k) {
    const double x = m.travel * k / 50.0;
    machine.yaml += (k > 0 ? ", " : "") + text(x);
    errors += (k > 0 ? ", " : "") + text(m.calibrated(x));
  }
  machine.yaml += "]\n  errors: [" + errors + "]\nparameters:\n  reference_temperature: " +
                  believed(reference + draw.normal(0.1), "degC", 0.2) + "\n";
  if (wish.has("heating_rate_lag") || (!expands && wish.has("parameter"))) {
    double expansion = m.expansion;
    if (wish.has("parameter")) {  // the user overrates the expansion
      m.expansion = draw.between(5e-6, 1e-5);
      expansion = m.expansion * (1.0 + draw.sign() * (0.3 + 0.2 * wish.size));
    }
    machine.yaml += "  expansion: " + believed(expansion, "1/K", 0.05 * m.expansion) + "\n";
  }
  if (draw.once_in(2.0)) machine.yaml += "noise: {error: " + text(noise) + "}\n";
  machine.yaml += "terms: []\n";
  const auto quiet =
      measure(static_cast<int>(draw.between(6.0, 14.0)), static_cast<int>(draw.between(30.0, 60.0)), 0.0);
  machine.quiet.push_back(quiet);
  machine.recordings.push_back(quiet);
  Noise wobble{draw, noise, wish.colour, wish.pole(draw, 0.5, 0.85)};
  for (double& v : machine.recordings[0].columns.back().values) v += wobble();
  auto test = measure(4, 40, 9000.0);
  machine.test_outputs.add("col_time", "s", test.columns.front().values);
  machine.test_outputs.add("col_error", "m", test.columns.back().values);
  test.columns.pop_back();
  machine.test_inputs = test;

  for (const auto& effect : wish.effects) {
    if (effect == "parameter") continue;
    std::map<std::string, double> names{{effect, 1.0}};
    std::vector<std::string> sites{"error_map.kinematic"}, depends_on;
    if (effect == "thermal_expansion" || effect == "heating_rate_lag")
      sites = {"error_map.thermal"}, depends_on = {"temperature"};
    if (effect == "refractive_index") sites = {"error_map.measurement"}, depends_on = {"pressure"};
    if (effect == "backlash") depends_on = {"direction"};
    if (effect == "abbe_offset") depends_on = {"offset"};
    if (effect == "periodic_error" || effect == "sag" || effect == "unknown:dent") depends_on = {"position"};
    if (effect == "unknown:slip") depends_on = {"time"};
    if (effect.rfind("unknown", 0) == 0) {
      names = {{"unmodelled", 1.0}};
      sites = {"error_map.kinematic", "error_map.measurement", "error_map.thermal"};
    }
    machine.missing.push_back({names, sites, depends_on});
  }
  return machine;
}

}  // namespace invar::test::mismatch

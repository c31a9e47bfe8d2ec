// Axes in closed loop, integrated by velocity Verlet in steps of 50 us; friction by sticking and slipping, or bristles.
#include <cmath>
#include <deque>
#include <numbers>

#include "tests/support/mismatch/plants.hpp"

namespace invar::test::mismatch {

namespace {

constexpr double pi = std::numbers::pi;
constexpr double period = 1e-3;
constexpr int parts = 20;

struct Truth {
  double mass = 5.0, motor = 30.0, damping = 15.0;
  double kp = 0.0, ki = 0.0, kd = 0.0, filter = 300.0, limit = 8.0;
  double dry = 0.0, sticking = 0.0, creep = 0.01;       // Coulomb, what sticks more, its speed
  double bristle_force = 0.0, bristle_stiffness = 1e5;  // presliding
  double cogging = 0.0, cogging_pitch = 0.03, cogging_phase = 0.0;
  double spring = 0.0, spring_center = 0.0, tilt = 0.0, drag = 0.0;
  double ripple = 0.0, ripple_pitch = 0.024, ripple_phase = 0.0, saturation = 0.0;
  double late_motor = 0.0, lag = 0.0, dead = 0.0;
  double hum = 0.0, hum_frequency = 50.0, hum_phase = 0.0;
  bool hum_is_square = false;
  double scale_error = 0.0, scale_pitch = 1e-3, scale_phase = 0.0, play = 0.0, late_reading = 0.0;
  double swing_share = 0.0, swing_frequency = 60.0;
  double shake = 0.0, shake_frequency = 20.0, shake_phase = 0.0, drift = 0.0;
  double dent = 0.0, dent_place = 0.1, dent_width = 0.006;
  double grip = 0.0;     // a brake that rubs between two speeds
  double warming = 0.0;  // loss of the motor constant per K above 25 degC
};

struct Trace {
  std::vector<double> position, current;
};

double force(const Truth& m, double x, double v, double t, double current, double temperature) {
  const double relative = m.ripple * std::sin(2.0 * pi * x / m.ripple_pitch + m.ripple_phase) -
                          m.saturation * current * current - m.warming * (temperature - 25.0);
  double f = m.motor * current * (1.0 + relative) - m.damping * v;
  f += m.cogging * std::sin(2.0 * pi * x / m.cogging_pitch + m.cogging_phase) -
       m.spring * (x - m.spring_center) + m.tilt - m.drag * v * std::abs(v) + m.drift * t;
  f += m.shake * std::sin(2.0 * pi * m.shake_frequency * t + m.shake_phase);
  if (m.dent != 0.0) f += m.dent * std::exp(-0.5 * std::pow((x - m.dent_place) / m.dent_width, 2));
  if (m.grip != 0.0)
    f -= m.grip * std::copysign(std::exp(-0.5 * std::pow((std::abs(v) - 0.12) / 0.03, 2)), v);
  return f;
}

double dry(const Truth& m, double speed) {
  return m.dry + m.sticking * std::exp(-std::pow(speed / m.creep, 2));
}

Trace run(const Truth& m, const std::vector<double>& reference, const std::vector<double>& temperature,
          double noise_sigma, Colour colour, double pole, Draw& draw) {
  Trace trace;
  Noise noise{draw, noise_sigma, colour, pole};
  const double h = period / parts;
  double x = reference[0], v = 0.0, swing = 0.0, swing_speed = 0.0, current = 0.0, bristle = 0.0, shown = x;
  double sum = 0.0, slope = 0.0, last_error = 0.0;
  bool first = true;
  std::deque<std::pair<double, double>> commands, places;  // time, value
  const double carriage = m.mass * (1.0 - m.swing_share), hanging = m.mass * m.swing_share;
  const double stiffness = hanging * std::pow(2.0 * pi * m.swing_frequency, 2);
  const double swing_damping = 2.0 * 0.02 * std::sqrt(stiffness * hanging);
  const double keep = std::exp(-h / std::max(1e-9, m.lag));
  for (std::size_t k = 0; k < reference.size(); ++k) {
    const double now = static_cast<double>(k) * period;
    double read = m.play > 0.0 ? shown : x;
    if (m.late_reading > 0.0) {
      const double when = now - m.late_reading;
      read = reference[0];
      for (std::size_t i = 1; i < places.size(); ++i)
        if (places[i].first >= when) {
          const auto& [t0, x0] = places[i - 1];
          const auto& [t1, x1] = places[i];
          read = t0 > when ? reference[0] : x0 + (x1 - x0) * (when - t0) / (t1 - t0);
          break;
        }
    }
    read += m.scale_error * std::sin(2.0 * pi * read / m.scale_pitch + m.scale_phase) + noise();
    // The controller of the contract.
    const double e = reference[k] - read;
    if (first) last_error = e, first = false;
    const double a = 1.0 - std::exp(-2.0 * pi * m.filter * period);
    slope += a * ((e - last_error) / period - slope);
    last_error = e;
    const double wanted = m.kp * e + m.ki * (sum + e) * period + m.kd * slope;
    if (std::abs(wanted) <= m.limit) sum += e;
    const double u = std::clamp(m.kp * e + m.ki * sum * period + m.kd * slope, -m.limit, m.limit);
    trace.position.push_back(read), trace.current.push_back(u);

    double command = u;
    if (m.hum > 0.0) {
      const double s = std::sin(2.0 * pi * m.hum_frequency * now + m.hum_phase);
      command += m.hum * (m.hum_is_square ? (s >= 0.0 ? 1.0 : -1.0) : s);
    }
    if (m.dead > 0.0) command = std::abs(command) <= m.dead ? 0.0 : command - std::copysign(m.dead, command);
    commands.emplace_back(now, command);
    while (commands.size() > 300) commands.pop_front();
    for (int part = 0; part < parts; ++part) {
      const double t = now + part * h;
      double arrives = command;
      if (m.late_motor > 0.0) {
        arrives = 0.0;
        for (const auto& [when, value] : commands)
          if (when + m.late_motor <= t + 1e-9) arrives = value;
      }
      const double before = current;
      current = m.lag > 0.0 ? arrives + (current - arrives) * keep : arrives;
      const double mean = m.lag > 0.0 ? 0.5 * (before + current) : current;
      const auto pull = [&](double at, double speed, double when, double way, double way_speed, double bend) {
        double f = force(m, at, speed, when, mean, temperature[k]);
        if (m.bristle_force > 0.0) f -= m.bristle_stiffness * bend;
        if (hanging > 0.0) f += stiffness * way + swing_damping * way_speed;
        return f;
      };
      const double f0 = pull(x, v, t, swing, swing_speed, bristle);
      double direction = v > 0.0 ? 1.0 : (v < 0.0 ? -1.0 : 0.0);
      bool sticks = false;
      if (m.dry + m.sticking > 0.0) {
        if (direction == 0.0) {
          sticks = std::abs(f0) <= dry(m, 0.0);
          direction = f0 > 0.0 ? 1.0 : -1.0;
        }
      } else {
        direction = 0.0;
      }
      const double a0 = sticks ? 0.0 : (f0 - direction * dry(m, std::abs(v))) / carriage;
      const double s0 =
          hanging > 0.0 ? -(stiffness * swing + swing_damping * swing_speed) / hanging - a0 : 0.0;
      const double x1 = x + h * v + 0.5 * h * h * a0, vp = v + h * a0;
      const double swing1 = swing + h * swing_speed + 0.5 * h * h * s0, swing_p = swing_speed + h * s0;
      double bend = bristle;
      if (m.bristle_force > 0.0) {
        const double most = m.bristle_force / m.bristle_stiffness;
        const double limit = std::copysign(most, x1 - x);  // Dahl's law, solved over the step
        bend = limit + (bristle - limit) * std::exp(-std::abs(x1 - x) / most);
      }
      const double f1 = pull(x1, vp, t + h, swing1, swing_p, bend);
      const double a1 = sticks ? 0.0 : (f1 - direction * dry(m, std::abs(vp))) / carriage;
      double v1 = v + 0.5 * h * (a0 + a1);
      if (hanging > 0.0) {
        const double s1 = -(stiffness * swing1 + swing_damping * swing_p) / hanging - a1;
        swing_speed += 0.5 * h * (s0 + s1);
        swing = swing1;
      }
      if (direction != 0.0 &&
          v1 * direction < 0.0) {  // it turns within the step: stays, or goes on the other way
        const double before_turn = std::abs(v) / (std::abs(v) + std::abs(v1));
        const double against = std::abs(f1) - dry(m, 0.0);
        v1 = against > 0.0 ? std::copysign(against / carriage * h * (1.0 - before_turn), f1) : 0.0;
      }
      x = x1, v = v1, bristle = bend;
      if (m.play > 0.0) shown = std::clamp(shown, x - 0.5 * m.play, x + 0.5 * m.play);
      if (m.late_reading > 0.0) {
        places.emplace_back(t + h, x);
        while (places.size() > 1200) places.pop_front();
      }
    }
  }
  return trace;
}

recording::Table table(const std::vector<double>& reference, const std::vector<double>* temperature,
                       const Trace* trace) {
  recording::Table t;
  std::vector<double> time;
  for (std::size_t k = 0; k < reference.size(); ++k) time.push_back(static_cast<double>(k) * period);
  t.add("col_time", "s", time);
  t.add("col_reference", "mm", [&] {
    auto mm = reference;
    for (double& r : mm) r *= 1e3;
    return mm;
  }());
  if (temperature != nullptr) t.add("col_warmth", "degC", *temperature);
  if (trace != nullptr) {
    t.add("col_position", "m", trace->position);
    t.add("col_current", "A", trace->current);
  }
  return t;
}

}  // namespace

Machine make_axis(const Wish& wish, Draw& draw) {
  const Draw as_begun = draw;
  Truth m;
  m.mass = draw.log_between(1.5, 15.0), m.motor = draw.log_between(8.0, 60.0);
  m.damping = draw.log_between(5.0, 40.0);
  const double band = draw.between(130.0, 260.0);
  m.kp = band * band * m.mass / m.motor, m.kd = 1.5 * band * m.mass / m.motor;
  m.ki = m.kp * band / draw.between(5.0, 10.0);
  m.filter = draw.between(200.0, 400.0), m.limit = 30.0 * m.mass / m.motor;
  const double travel = draw.between(0.1, 0.3), push = 0.15 * m.mass;
  const double noise = draw.log_between(5e-8, 4e-7), phase = draw.between(0.0, 6.28);
  const auto size = [&](const char* name) { return wish.of(name); };
  m.dry = size("coulomb_friction") * push;
  if (wish.has("stribeck_friction")) {
    m.dry = size("stribeck_friction") * push, m.sticking = draw.between(0.5, 1.2) * m.dry;
    m.creep = draw.log_between(0.004, 0.02);
  }
  m.bristle_force = size("presliding_friction") * push;
  m.bristle_stiffness = draw.log_between(2.0, 10.0) * 1e4;
  m.cogging = size("force_ripple") * 0.3 * push, m.cogging_pitch = draw.log_between(0.008, 0.05);
  m.cogging_phase = phase;
  m.spring = size("position_stiffness") * 2.0 * push / travel;
  m.spring_center = draw.between(0.2, 0.8) * travel;
  m.tilt = size("constant_force") * push * draw.sign();
  m.drag = size("quadratic_drag") * push / 0.1;
  m.ripple = size("motor_constant_ripple") * 0.03, m.ripple_pitch = draw.log_between(0.01, 0.05);
  m.ripple_phase = phase;
  m.saturation = size("magnetic_saturation") * 0.1 / std::pow(4.0 * m.mass / m.motor, 2);
  m.late_motor = std::min(1.2, size("transport_delay")) * 4e-4;
  m.late_reading = std::min(1.2, size("measurement_delay")) * 4e-4;
  m.lag = std::min(1.2, size("amplifier_lag")) * 4e-4;
  m.dead = size("dead_zone") * 0.3 * push / m.motor;
  m.hum = size("additive_disturbance") * 0.3 * push / m.motor;
  m.hum_frequency = draw.once_in(2.0) ? 50.0 : draw.log_between(0.5, 8.0);
  m.hum_is_square = m.hum_frequency != 50.0, m.hum_phase = phase;
  m.scale_error = size("encoder_periodic_error") * 5.0 * noise, m.scale_pitch = draw.log_between(4e-4, 4e-3);
  m.scale_phase = phase;
  m.play = size("backlash") * 3e-6;
  m.swing_share = std::min(0.3, size("flexible_mode") * 0.06);
  m.swing_frequency = draw.log_between(35.0, 130.0);
  m.shake = size("periodic_disturbance") * 0.3 * push, m.shake_frequency = draw.log_between(3.0, 80.0);
  if (std::abs(m.shake_frequency - 50.0) < 1.0) m.shake_frequency = 43.0;
  m.shake_phase = phase;
  m.drift = size("slow_drift") * 0.1 * push * draw.sign();
  m.dent = size("unknown:dent") * 1.5 * push * draw.sign(), m.dent_width = draw.between(0.003, 0.008);
  m.dent_place = draw.between(0.3, 0.7) * travel;
  m.grip = size("unknown:grip") * push;
  m.warming = size("unknown:warm_motor") * 0.01;

  const double mass_sigma = 0.015 * m.mass, motor_sigma = 0.008 * m.motor, damping_sigma = 0.15 * m.damping;
  double mass = m.mass + draw.normal(0.7 * mass_sigma),
         damping = m.damping + draw.normal(0.7 * damping_sigma);
  const double motor = m.motor + draw.normal(0.5 * motor_sigma);
  if (wish.has("parameter")) {
    const double by = draw.sign() * (4.0 + 8.0 * wish.size);
    if (draw.once_in(2.0))
      mass += by * mass_sigma;
    else
      damping = std::max(0.2 * damping, damping + by * damping_sigma);
  }
  Machine machine;
  machine.size = wish.size;
  machine.yaml =
      "invar_model: 1\nplant: axis\ncolumns: {time: col_time, reference: col_reference, position: "
      "col_position, "
      "current: col_current, temperature: col_warmth}\n"
      "controller: {kind: pid, rate: 1000, kp: " +
      text(m.kp) + ", ki: " + text(m.ki) + ", kd: " + text(m.kd) + ", velocity_filter_hz: " + text(m.filter) +
      ", limit: " + text(m.limit) + "}\nparameters:\n  mass: " + believed(mass, "kg", mass_sigma) +
      "\n  motor_constant: " + believed(motor, "N/A", motor_sigma) +
      "\n  viscous_damping: " + believed(damping, "N s/m", damping_sigma) + "\n";
  if (draw.once_in(2.0)) machine.yaml += "noise: {position: " + text(noise) + "}\n";
  machine.yaml += "terms: []\n";

  // What needs a kind of motion to show gets it.
  int kind = static_cast<int>(draw.index(4));
  if (kind == 2 && (wish.has("position_stiffness") || wish.has("unknown:dent"))) kind = 0;
  auto rows = static_cast<std::size_t>(draw.between(8000.0, 13000.0));
  if (wish.rows > 0) rows = wish.rows;
  const std::size_t recordings = draw.once_in(4.0) ? 2 : 1;
  const double warm_from = draw.between(20.0, 26.0), warm_by = draw.between(4.0, 12.0);
  const auto warmth = [&](std::size_t n) {
    std::vector<double> values(n);
    for (std::size_t i = 0; i < n; ++i)
      values[i] = warm_from + warm_by * static_cast<double>(i) / static_cast<double>(n);
    return values;
  };
  const double pole = wish.pole(draw, 0.6, 0.9);
  for (std::size_t r = 0; r < recordings; ++r) {
    const auto reference =
        motion(draw, (kind + 2 * static_cast<int>(r)) % 4, rows / recordings, period, travel);
    const auto temperature = warmth(reference.size());
    const auto trace = run(m, reference, temperature, noise, wish.colour, pole, draw);
    const auto quiet = run(m, reference, temperature, 0.0, Colour::white, 0.0, draw);
    for (const double u : quiet.current)
      if (std::abs(u) > 0.9 * m.limit) {  // no machine that anybody would run: less of the effect
        draw = as_begun;
        Wish less = wish;
        less.size *= 0.5;
        if (wish.effects.empty() || less.size < 0.01) {  // it is not the effect: another machine
          less.size = wish.size;
          (void)draw.normal();
        }
        return make_axis(less, draw);
      }
    machine.recordings.push_back(table(reference, &temperature, &trace));
    machine.quiet.push_back(table(reference, &temperature, &quiet));
  }
  const auto reference = motion(draw, (kind + 1) % 4, 8000, period, travel);
  const auto temperature = warmth(reference.size());
  const auto trace = run(m, reference, temperature, 0.0, Colour::white, 0.0, draw);
  machine.test_inputs = table(reference, &temperature, nullptr);
  machine.test_outputs = table(reference, nullptr, &trace);
  machine.test_outputs.columns.erase(machine.test_outputs.columns.begin() + 1);

  const auto is = [&](std::map<std::string, double> names, std::vector<std::string> sites,
                      std::vector<std::string> depends_on) {
    machine.missing.push_back({std::move(names), std::move(sites), std::move(depends_on)});
  };
  for (const auto& effect : wish.effects) {
    if (effect == "parameter") continue;
    if (effect == "coulomb_friction" || effect == "stribeck_friction" || effect == "presliding_friction") {
      std::map<std::string, double> names{
          {"coulomb_friction", 0.5}, {"stribeck_friction", 0.5}, {"presliding_friction", 0.5}};
      names[effect] = 1.0;
      is(names, {"axis.force"}, {"velocity", "direction", "position"});
    } else if (effect == "force_ripple") {
      is({{effect, 1.0}, {"motor_constant_ripple", 0.5}}, {"axis.force"}, {"position"});
    } else if (effect == "motor_constant_ripple") {
      is({{effect, 1.0}, {"force_ripple", 0.5}}, {"axis.actuator"}, {"position", "current"});
    } else if (effect == "transport_delay" || effect == "measurement_delay") {
      is({{"transport_delay", 1.0}, {"measurement_delay", 1.0}, {"amplifier_lag", 0.5}},
         {"axis.actuator", "axis.measurement"}, {"frequency", "current", "velocity", "history"});
      machine.verdicts = {{"ambiguous", 1.0}, {"explained", 0.5}};
    } else if (effect == "amplifier_lag") {
      is({{effect, 1.0}, {"transport_delay", 0.5}, {"measurement_delay", 0.5}},
         {"axis.actuator", "axis.measurement"}, {"frequency", "current", "velocity", "history"});
      machine.verdicts = {{"explained", 1.0}, {"ambiguous", 1.0}, {"partly_explained", 0.5}};
    } else if (effect == "additive_disturbance") {
      is({{effect, 1.0}, {"periodic_disturbance", 0.5}}, {"axis.actuator"}, {"time"});
      machine.verdicts = {{"explained", 1.0}, {"ambiguous", 1.0}, {"partly_explained", 0.5}};
    } else if (effect == "periodic_disturbance") {
      is({{effect, 1.0}, {"additive_disturbance", 0.5}}, {"axis.disturbance"}, {"time"});
      machine.verdicts = {{"explained", 1.0}, {"ambiguous", 1.0}, {"partly_explained", 0.5}};
    } else if (effect == "unknown:dent") {
      is({{"unmodelled", 1.0}}, {"axis.force"}, {"position"});
    } else if (effect == "unknown:grip") {
      is({{"unmodelled", 1.0}}, {"axis.force"}, {"velocity"});
    } else if (effect == "unknown:warm_motor") {
      is({{"unmodelled", 1.0}}, {"axis.actuator"}, {"temperature"});
    } else {
      const std::string site = effect == "dead_zone" || effect == "magnetic_saturation" ? "axis.actuator"
                               : effect == "encoder_periodic_error" || effect == "backlash"
                                   ? "axis.measurement"
                               : effect == "flexible_mode" ? "axis.structure"
                               : effect == "slow_drift"    ? "axis.disturbance"
                                                           : "axis.force";
      is({{effect, 1.0}}, {site}, {});
    }
  }
  return machine;
}

}  // namespace invar::test::mismatch

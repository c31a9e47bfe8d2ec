// Heated parts: one or two nodes with what takes, gives and delays heat, by Euler's rule in fine steps with Richardson's
// correction.
#include <cmath>

#include "tests/support/mismatch/plants.hpp"

namespace invar::test::mismatch {

namespace {

struct Truth {
  bool two = false;
  double capacity[2] = {700.0, 4000.0}, loss[2] = {7.0, 14.0};
  double gain = 1.0, contact = 0.0;  // contact that the model knows or misses
  double radiation = 0.0, convection = 0.0, hidden_capacity = 0.0, hidden_conductance = 0.0, sensor = 0.0;
  double resistance = 0.0, air_drift = 0.0, most_power = 1e9;
  double air_constant = 0.0;   // the air settles with this time constant; 0: goes on warming
  double second_sensor = 0.0;  // a sensor that follows in two steps
  double rod = 0.0;            // share of the hidden store that lies behind a second contact
  double draught_power = 1.0;  // the loss goes with this power of the speed
  double door_from = 1e18, door_to = 1e18, door = 0.0;           // more loss for a while
  double visitor = 0.0, visitor_from = 1e18, visitor_to = 1e18;  // heat from somewhere
};

struct Run {
  std::vector<double> time, power, ambient, speed, current;
  std::vector<double> shown[2];
};

void integrate(const Truth& m, Run& run, int parts) {
  const std::size_t rows = run.time.size();
  double t[2] = {run.ambient[0], run.ambient[0]}, hidden = t[0], end = t[0], read = t[0], between = t[0];
  run.shown[0].assign(rows, 0.0), run.shown[1].assign(rows, 0.0);
  for (std::size_t i = 0; i < rows; ++i) {
    run.shown[0][i] = m.sensor > 0.0 ? read : t[0];
    run.shown[1][i] = t[1];
    if (i + 1 == rows) break;
    const double h = (run.time[i + 1] - run.time[i]) / parts;
    for (int p = 0; p < parts; ++p) {
      const double now = run.time[i] + p * h;
      const double air =
          run.ambient[i] +
          m.air_drift * (m.air_constant > 0.0 ? m.air_constant * -std::expm1(-now / m.air_constant) : now);
      double loss = m.loss[0] + m.convection * std::pow(run.speed[i] / 0.4, m.draught_power) * 0.4;
      if (now >= m.door_from && now < m.door_to) loss += m.door;
      double heat = m.gain * std::min(run.power[i], m.most_power) - loss * (t[0] - air);
      const double a = t[0] + 273.15, b = air + 273.15;
      heat -= m.radiation * (a * a * a * a - b * b * b * b);
      heat += m.resistance * run.current[i] * run.current[i];
      heat -= m.hidden_conductance * (t[0] - hidden);
      if (now >= m.visitor_from && now < m.visitor_to) heat += m.visitor;
      double other = 0.0;
      if (m.two) {
        heat -= m.contact * (t[0] - t[1]);
        other = m.contact * (t[0] - t[1]) - m.loss[1] * (t[1] - air);
      }
      if (m.hidden_capacity > 0.0) {
        const double on = m.rod > 0.0 ? 2.0 * m.hidden_conductance * (hidden - end) : 0.0;
        hidden += h * (m.hidden_conductance * (t[0] - hidden) - on) / (m.hidden_capacity * (1.0 - m.rod));
        if (m.rod > 0.0) end += h * on / (m.hidden_capacity * m.rod);
      }
      if (m.second_sensor > 0.0) {
        between += h * (t[0] - between) / m.sensor;
        read += h * (between - read) / m.second_sensor;
      } else if (m.sensor > 0.0) {
        read += h * (t[0] - read) / m.sensor;
      }
      t[0] += h * heat / m.capacity[0];
      if (m.two) t[1] += h * other / m.capacity[1];
    }
  }
}

void simulate(const Truth& m, Run& run) {
  Run fine = run;
  integrate(m, run, 10);
  integrate(m, fine, 20);
  for (int n = 0; n < 2; ++n)
    for (std::size_t i = 0; i < run.shown[n].size(); ++i)
      run.shown[n][i] = 2.0 * fine.shown[n][i] - run.shown[n][i];
}

recording::Table table(const Run& run, bool two, bool inputs, bool outputs) {
  recording::Table t;
  t.add("col_time", "s", run.time);
  if (inputs) {
    t.add("col_power", "W", run.power);
    t.add("col_air", "degC", run.ambient);
    t.add("col_speed", "m/s", run.speed);
    t.add("col_motor", "A", run.current);
  }
  if (outputs) {
    t.add("col_slide", "degC", run.shown[0]);
    if (two) t.add("col_base", "degC", run.shown[1]);
  }
  return t;
}

}  // namespace

Machine make_thermal(const Wish& wish, Draw& draw) {
  Truth m;
  const auto size = [&](const char* name) { return wish.of(name); };
  m.two = wish.has("node_coupling") || draw.once_in(3.0);
  m.capacity[0] = draw.log_between(300.0, 1200.0), m.capacity[1] = draw.log_between(2.0, 6.0) * m.capacity[0];
  m.loss[0] = draw.log_between(3.0, 10.0), m.loss[1] = draw.log_between(8.0, 20.0);
  const double constant = m.capacity[0] / m.loss[0];  // s
  const double rise = draw.between(15.0, 40.0), power = rise * m.loss[0];
  const double step = constant / draw.between(60.0, 150.0), noise = draw.log_between(0.006, 0.03);
  const bool known_contact = m.two && !wish.has("node_coupling");
  m.contact = known_contact ? draw.between(0.1, 0.4) * m.loss[0] : size("node_coupling") * 0.05 * m.loss[0];
  m.radiation = size("radiation") * 0.08 * m.loss[0] / 1.1e8;
  m.convection = size("speed_dependent_convection") * 0.25 * m.loss[0];
  m.hidden_conductance = size("hidden_node") * 0.08 * m.loss[0];
  if (m.hidden_conductance > 0.0)
    m.hidden_capacity = m.hidden_conductance * constant * draw.log_between(0.3, 1.5);
  m.sensor = size("sensor_lag") * 0.03 * constant;
  m.resistance = size("motor_heating") * 0.01 * power;
  auto rows = static_cast<std::size_t>(draw.between(1500.0, 3500.0));
  if (wish.rows > 0) rows = wish.rows;
  const double duration = static_cast<double>(rows) * step;
  m.air_drift = size("ambient_drift") * 0.6 / duration * draw.sign();
  // Half of the machines have the effect in another form than a tool would write it.
  if (draw.once_in(2.0)) {
    m.air_constant = duration * draw.between(0.3, 1.2);
    m.air_drift *= duration / m.air_constant / -std::expm1(-duration / m.air_constant);
    m.rod = draw.between(0.2, 0.5);
    m.second_sensor = m.sensor * draw.between(0.1, 0.4);
    m.draught_power = draw.between(0.8, 1.2);
  }
  if (wish.has("heater_saturation")) m.most_power = power * std::max(0.3, 1.0 - 0.12 * wish.size);
  if (wish.has("unknown:open_door")) {
    m.door_from = draw.between(0.25, 0.5) * duration,
    m.door_to = m.door_from + draw.between(0.15, 0.3) * duration;
    m.door = wish.size * 0.2 * m.loss[0];
  }
  if (wish.has("unknown:visitor")) {
    m.visitor_from = draw.between(0.25, 0.5) * duration;
    m.visitor_to = m.visitor_from + draw.between(0.1, 0.25) * duration;
    m.visitor = wish.size * 0.06 * power;
  }
  const auto inputs = [&](std::size_t n, double from, double longest) {
    Run run;
    for (std::size_t i = 0; i < n; ++i) run.time.push_back(step * static_cast<double>(i));
    run.power = steps(draw, n, step, 0.4 * constant, longest * constant, 0.0, power, false);
    run.speed = steps(draw, n, step, 0.3 * constant, 1.1 * constant, 0.0, 0.4, false);
    run.current = steps(draw, n, step, 0.3 * constant, 1.3 * constant, 0.0, 3.0, false);
    const double slow = draw.between(0.5, 1.5) * duration, swing = draw.between(0.1, 0.6);
    for (double t : run.time) run.ambient.push_back(from + swing * std::sin(6.28 * t / slow));
    return run;
  };
  const double capacity_sigma = 0.04 * m.capacity[0], loss_sigma = 0.06 * m.loss[0];
  double capacity = m.capacity[0] + draw.normal(0.7 * capacity_sigma),
         loss = m.loss[0] + draw.normal(0.7 * loss_sigma);
  if (wish.has("parameter")) {
    const double by = draw.sign() * (4.0 + 2.0 * wish.size);
    (draw.once_in(2.0) ? capacity : loss) *= 1.0 + by * 0.05;
  }
  Machine machine;
  machine.yaml =
      "invar_model: 1\nplant: thermal\ncolumns: {time: col_time, speed: col_speed, motor_current: "
      "col_motor}\n"
      "nodes:\n  slide: {column: col_slide, capacity: " +
      believed(capacity, "J/K", capacity_sigma) + ", loss: " + believed(loss, "W/K", loss_sigma) + "}\n";
  if (m.two)
    machine.yaml += "  base: {column: col_base, capacity: " +
                    believed(m.capacity[1] * (1.0 + draw.normal(0.03)), "J/K", 0.05 * m.capacity[1]) +
                    ", loss: " + believed(m.loss[1] * (1.0 + draw.normal(0.04)), "W/K", 0.06 * m.loss[1]) +
                    "}\n";
  machine.yaml +=
      "heaters:\n  pad: {node: slide, column: col_power, gain: " + believed(1.0, "W/W", 0.02) + "}\n";
  if (known_contact)
    machine.yaml += "couplings:\n  - {between: [slide, base], conductance: " +
                    believed(m.contact * (1.0 + draw.normal(0.05)), "W/K", 0.1 * m.contact) + "}\n";
  machine.yaml += "ambient: col_air\n";
  if (draw.once_in(2.0)) machine.yaml += "noise: {slide: " + text(noise) + "}\n";
  machine.yaml += "terms: []\n";

  auto run = inputs(rows, draw.between(19.0, 25.0), 1.6);
  simulate(m, run);
  machine.quiet.push_back(table(run, m.two, true, true));
  for (int n = 0; n < 2; ++n) {
    Noise wobble{draw, noise, wish.colour, wish.pole(draw, 0.7, 0.95)};
    for (double& v : run.shown[n]) v = 1e-3 * std::round(1e3 * (v + wobble()));
  }
  machine.recordings.push_back(table(run, m.two, true, true));
  auto test = inputs(rows / 2, draw.between(19.0, 25.0), 2.5);
  simulate(m, test);
  machine.test_inputs = table(test, m.two, true, false);
  machine.test_outputs = table(test, m.two, false, true);

  for (const auto& effect : wish.effects) {
    if (effect == "parameter") continue;
    std::map<std::string, double> names{{effect, 1.0}};
    std::vector<std::string> sites, depends_on;
    if (effect == "radiation") sites = {"thermal.loss"}, depends_on = {"temperature"};
    if (effect == "speed_dependent_convection") sites = {"thermal.loss"}, depends_on = {"speed"};
    if (effect == "hidden_node") sites = {"thermal.storage"}, depends_on = {"history", "temperature"};
    if (effect == "sensor_lag") sites = {"thermal.measurement"}, depends_on = {"history", "temperature"};
    if (effect == "node_coupling") sites = {"thermal.exchange"}, depends_on = {"temperature"};
    if (effect == "motor_heating") sites = {"thermal.source"}, depends_on = {"motor_current"};
    if (effect == "ambient_drift") sites = {"thermal.source"}, depends_on = {"time", "ambient"};
    if (effect == "heater_saturation") sites = {"thermal.source"}, depends_on = {"power"};
    if (effect.rfind("unknown", 0) == 0) {
      names = {{"unmodelled", 1.0}};
      sites = {"thermal.loss", "thermal.source"}, depends_on = {"time"};
    }
    machine.missing.push_back({names, sites, depends_on});
  }
  return machine;
}

}  // namespace invar::test::mismatch

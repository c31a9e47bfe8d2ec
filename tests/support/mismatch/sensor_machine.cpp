// Instruments beside an interferometer: an encoder and a velocity sensor on a motion known in closed form.
#include <cmath>
#include <numbers>

#include "tests/support/mismatch/plants.hpp"

namespace invar::test::mismatch {

Machine make_sensor(const Wish& wish, Draw& draw) {
  constexpr double pi = std::numbers::pi;
  const auto size = [&](const char* name) { return wish.of(name); };
  const double resolution = draw.log_between(1e-7, 1e-6), encoder_noise = 0.4 * resolution;
  const double velocity_noise = draw.log_between(2e-4, 1e-3), period = draw.once_in(2.0) ? 1e-3 : 5e-4;
  const double gain = 1.0 + draw.normal(0.007);
  const bool on_encoder = draw.once_in(2.0);
  const double late = size("latency") * 8e-6, velocity_late = on_encoder ? 0.0 : size("latency") * 2e-3;
  const double encoder_late = on_encoder ? late : 0.0;
  const double bias = size("bias") * velocity_noise * draw.sign(), droop = size("gain_droop") * 0.08;
  const double wave = size("periodic_error") * resolution, pitch = draw.log_between(5e-4, 4e-3);
  const double phase = draw.between(0.0, 6.28), play = size("hysteresis") * 3.0 * resolution;
  const double warming = size("unknown:warming") * 3.0 * resolution;
  const double model_gain =
      wish.has("parameter") ? gain + draw.sign() * (0.04 + 0.02 * wish.size) : gain + draw.normal(0.004);

  Machine machine;
  machine.yaml =
      "invar_model: 1\nplant: sensor\ncolumns: {time: col_time, true_position: col_true, encoder: col_enc, "
      "velocity_sensor: col_vel}\nparameters:\n  resolution: {value: " +
      text(resolution) + ", unit: m, sigma: 0}\n  gain: " + believed(model_gain, "1", 0.01) + "\n";
  if (draw.once_in(2.0))
    machine.yaml += "noise: {encoder: " + text(std::hypot(encoder_noise, 0.29 * resolution)) +
                    ", velocity_sensor: " + text(velocity_noise) + "}\n";
  machine.yaml += "terms: []\n";
  const auto record = [&](std::size_t rows, bool with_noise) {
    double a[4], f[4], p[4];
    for (int k = 0; k < 4; ++k) {
      f[k] = draw.log_between(0.1, 3.0), p[k] = draw.between(0.0, 6.28);
      a[k] = std::min(0.05, draw.between(0.1, 0.4) / (2.0 * pi * f[k]));
    }
    const auto at = [&](double t) {
      double x = 0.0;
      for (int k = 0; k < 4; ++k) x += a[k] * (std::sin(2.0 * pi * f[k] * t + p[k]) - std::sin(p[k]));
      return x;
    };
    const auto rate = [&](double t) {
      double v = 0.0;
      for (int k = 0; k < 4; ++k) v += 2.0 * pi * f[k] * a[k] * std::cos(2.0 * pi * f[k] * t + p[k]);
      return v;
    };
    recording::Table t;
    std::vector<double> time, truth, encoder, velocity;
    double shown = at(0.0);
    const double duration = static_cast<double>(rows) * period;
    Noise wobble{draw, velocity_noise, wish.colour, wish.pole(draw, 0.5, 0.9)};
    for (std::size_t i = 0; i < rows; ++i) {
      const double now = period * static_cast<double>(i);
      double x = at(now - encoder_late), v = rate(now - velocity_late);
      if (play > 0.0) x = shown = std::clamp(shown, x - 0.5 * play, x + 0.5 * play);
      x += wave * std::sin(2.0 * pi * x / pitch + phase) + warming * (1.0 - std::exp(-3.0 * now / duration));
      v = gain * v * (1.0 - droop * std::abs(v)) + bias;
      if (with_noise)
        x = resolution * std::round((x + draw.normal(encoder_noise)) / resolution), v += wobble();
      time.push_back(now), truth.push_back(at(now)), encoder.push_back(x), velocity.push_back(v);
    }
    t.add("col_time", "s", time);
    t.add("col_true", "m", truth);
    t.add("col_enc", "m", encoder);
    t.add("col_vel", "m/s", velocity);
    return t;
  };
  const auto rows = static_cast<std::size_t>(draw.between(6000.0, 14000.0));
  const Draw twin = draw;
  machine.recordings.push_back(record(rows, true));
  draw = twin;
  machine.quiet.push_back(record(rows, false));
  auto test = record(6000, false);
  machine.test_outputs.add("col_time", "s", test.columns.front().values);
  machine.test_outputs.columns.push_back(test.columns[2]);
  machine.test_outputs.columns.push_back(test.columns[3]);
  test.columns.resize(2);
  machine.test_inputs = test;
  for (const auto& effect : wish.effects) {
    if (effect == "parameter") continue;
    std::map<std::string, double> names{{effect, 1.0}};
    if (effect.rfind("unknown", 0) == 0) names = {{"unmodelled", 1.0}};
    machine.missing.push_back({names, {"sensor.measurement"}, {}});
  }
  return machine;
}

}  // namespace invar::test::mismatch

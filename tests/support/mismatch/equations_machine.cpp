// Models written down as expressions: two tanks, a driven oscillator, a falling body; by Runge-Kutta in fine steps.
#include <cmath>
#include <functional>
#include <numbers>

#include "tests/support/mismatch/plants.hpp"

namespace invar::test::mismatch {

namespace {

using State = std::array<double, 2>;
using Slope = std::function<State(double, const State&, double)>;  // time, state, input

/// `late` [s]: the input, held from row to row, arrives through a lag; 0: at once.
std::vector<State> integrate(const Slope& slope, State s, const std::vector<double>& input, double period,
                             double late) {
  std::vector<State> all;
  double arrived = input.front();
  constexpr int parts = 10;
  const double h = period / parts;
  const auto moved = [](const State& a, const State& b, double by) {
    return State{a[0] + by * b[0], a[1] + by * b[1]};
  };
  for (std::size_t i = 0; i < input.size(); ++i) {
    all.push_back(s);
    for (int p = 0; p < parts; ++p) {
      const double t = period * static_cast<double>(i) + p * h;
      const auto felt = [&](double since) {
        return late > 0.0 ? input[i] + (arrived - input[i]) * std::exp(-since / late) : input[i];
      };
      const State a = slope(t, s, felt(0.0)), b = slope(t + 0.5 * h, moved(s, a, 0.5 * h), felt(0.5 * h)),
                  c = slope(t + 0.5 * h, moved(s, b, 0.5 * h), felt(0.5 * h)),
                  d = slope(t + h, moved(s, c, h), felt(h));
      arrived = felt(h);
      s = moved(moved(moved(moved(s, a, h / 6.0), b, h / 3.0), c, h / 3.0), d, h / 6.0);
    }
  }
  return all;
}

}  // namespace

Machine make_equations(const Wish& wish, Draw& draw) {
  const auto size = [&](const char* name) { return wish.of(name); };
  Machine machine;
  Slope slope;
  State begin{0.0, 0.0};
  const double period = 0.02;
  double output_scale = 1.0;
  std::string place = "v";
  const bool tanks = wish.has("coupling") || (!wish.has("cubic") && !wish.has("dry_friction") &&
                                              !wish.has("quadratic") && draw.once_in(3.0));
  const auto rows = static_cast<std::size_t>(draw.between(1500.0, 3000.0));
  std::vector<double> input, test_input;
  double late = 0.0;
  if (tanks) {  // two masses of heat, coupled by what the user forgot
    const double a = draw.between(0.2, 0.6), b = draw.between(0.3, 0.8), k = draw.between(0.5, 1.5);
    const double through = size("coupling") * 0.15, leak = size("constant") * 0.05;
    slope = [=](double, const State& s, double u) {
      return State{-a * s[0] + k * u + leak, -b * s[1] + 0.3 * u + through * s[0]};
    };
    place = wish.has("coupling") ? "y" : "x";
    machine.yaml =
        "invar_model: 1\nplant: equations\ncolumns: {time: col_time}\ninputs: {u: col_u}\nstates:\n"
        "  x: {derivative: \"-a*x + k*u\", initial: {value: 0, sigma: 0}}\n"
        "  y: {derivative: \"-b*y + 0.3*u\", initial: {value: 0, sigma: 0}}\n"
        "outputs: {first: {column: col_x, expression: x}, second: {column: col_y, expression: "
        "y}}\nparameters:\n  a: " +
        believed(a * (wish.has("parameter") ? 1.5 : 1.0 + draw.normal(0.03)), "1", 0.05 * a) +
        "\n  b: " + believed(b * (1.0 + draw.normal(0.03)), "1", 0.05 * b) +
        "\n  k: " + believed(k * (1.0 + draw.normal(0.03)), "1", 0.05 * k) + "\nterms: []\n";
    output_scale = 1.0;
  } else {
    const double w2 = std::pow(2.0 * std::numbers::pi * draw.between(0.3, 1.0), 2),
                 c = draw.between(0.1, 0.5);
    const double k = draw.between(5.0, 15.0), amplitude = k / w2;
    const double rub = size("dry_friction") * 0.06 * k,
                 bend = size("cubic") * 0.1 * w2 / (amplitude * amplitude);
    const double drag = size("quadratic") * 0.15 * c / (amplitude * std::sqrt(w2)),
                 push = size("constant") * 0.1 * k;
    slope = [=](double, const State& s, double u) {
      return State{s[1], -w2 * s[0] - c * s[1] + k * u - rub * std::tanh(s[1] / (1e-3 * amplitude)) -
                             bend * s[0] * s[0] * s[0] - drag * s[1] * std::abs(s[1]) + push};
    };
    machine.yaml =
        "invar_model: 1\nplant: equations\ncolumns: {time: col_time}\ninputs: {u: col_u}\nstates:\n"
        "  x: {derivative: \"v\", initial: {value: 0, sigma: 0}}\n"
        "  v: {derivative: \"-w*x - c*v + k*u\", initial: {value: 0, sigma: 0}}\n"
        "outputs: {place: {column: col_x, expression: x}}\nparameters:\n  w: " +
        believed(w2 * (wish.has("parameter") ? 1.3 : 1.0 + draw.normal(0.02)), "1", 0.03 * w2) +
        "\n  c: " + believed(c * (1.0 + draw.normal(0.05)), "1", 0.1 * c) +
        "\n  k: " + believed(k * (1.0 + draw.normal(0.02)), "1", 0.03 * k) + "\nterms: []\n";
    output_scale = 0.3 * amplitude;
  }
  late = size("lag") * 0.06;
  const auto signal = [&](std::size_t n) {
    auto u = steps(draw, n, period, 0.5, 4.0, -1.0, 1.0, true);
    return u;
  };
  const auto table = [&](const std::vector<double>& u, double noise, bool inputs, bool outputs) {
    const auto states = integrate(slope, begin, u, period, late);
    recording::Table t;
    std::vector<double> time, x, y;
    Noise wobble_x{draw, noise * output_scale, wish.colour, wish.pole(draw, 0.8, 0.8)}, wobble_y = wobble_x;
    for (std::size_t i = 0; i < u.size(); ++i) {
      time.push_back(period * static_cast<double>(i));
      x.push_back(states[i][0] + (noise > 0.0 ? wobble_x() : 0.0));
      y.push_back(states[i][1] + (noise > 0.0 ? wobble_y() : 0.0));
    }
    t.add("col_time", "s", time);
    if (inputs) t.add("col_u", "1", u);
    if (outputs) {
      t.add("col_x", "1", x);
      if (tanks) t.add("col_y", "1", y);
    }
    return t;
  };
  const double noise = draw.log_between(0.003, 0.02);
  input = signal(rows), test_input = signal(1500);
  machine.recordings.push_back(table(input, noise, true, true));
  machine.quiet.push_back(table(input, 0.0, true, true));
  machine.test_inputs = table(test_input, 0.0, true, false);
  machine.test_outputs = table(test_input, 0.0, false, true);
  for (const auto& effect : wish.effects) {
    if (effect == "parameter") continue;
    std::map<std::string, double> names{{effect, 1.0}};
    std::vector<std::string> sites{"equations." + place};
    if (effect == "coupling") names["linear"] = 1.0;
    if (effect == "lag") {
      names["delay"] = 0.5, sites = {"equations.input", "equations.output"};
      // A linear machine at rest answers a late input as it would show late what it did: nothing tells the two apart.
      if (!tanks) machine.verdicts = {{"explained", 1.0}, {"ambiguous", 1.0}, {"partly_explained", 0.5}};
    }
    machine.missing.push_back({names, sites, {}});
  }
  return machine;
}

}  // namespace invar::test::mismatch

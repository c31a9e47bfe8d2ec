// Thermal error read at few places of the travel: error over that of an oracle, and how often sigma holds.
//
//     build/bin/bench_thermal_places [machines] [first seed]
//
// Machines are drawn at random: a constant, a scale and a bow of the travel, each at one temperature and per kelvin, each
// present or not; in one of three also a wave finer than those. The oracle knows that a machine is made of constant, scale
// and bow alone, still and per kelvin, and fits these by least squares; what two places cannot show (a bow) it does not
// know either. Every seed is printed; the figures are those of machines without and with a wave, and of all.
#include <Eigen/QR>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <random>
#include <vector>

#include "core/metrology/thermal/thermal_identification.hpp"

namespace invar::metrology {
namespace {

struct Machine {
  int places = 2;
  double travel = 0.5;                 // m
  double coldest = 20.0, span = 10.0;  // degC, K
  double noise = 5e-7;                 // m, of one reading
  std::array<double, 3> still{};       // constant, scale, bow at the coldest temperature [m]
  std::array<double, 3> warm{};        // the same per kelvin [m/K]
  double wave = 0.0, wave_length = 1.0, wave_phase = 0.0;

  [[nodiscard]] double error(double x, double temperature) const {
    const double u = 2.0 * x / travel - 1.0, dt = temperature - coldest;
    const std::array<double, 3> over{1.0, u, 1.0 - u * u};
    double sum = wave * std::sin(2.0 * std::numbers::pi * x / wave_length + wave_phase) * (1.0 + 0.1 * dt);
    for (std::size_t k = 0; k < 3; ++k) sum += over[k] * (still[k] + warm[k] * dt);
    return sum;
  }
};

Machine drawn(std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  Machine machine;
  machine.places = 2 + static_cast<int>(5.0 * uniform(random));
  machine.travel = 0.1 * std::pow(20.0, uniform(random));
  machine.span = 2.0 + 18.0 * uniform(random);
  machine.noise = 1e-7 * std::pow(10.0, uniform(random));
  // Sizes of constant, scale and bow: an axis grows by 12 ppm/K, its mount moves by as much, it bends by a tenth of that.
  const double growth = 12e-6 * machine.travel;
  const std::array<double, 3> sizes{growth, 0.5 * growth, 0.1 * growth};
  for (std::size_t k = 0; k < 3; ++k) {
    if (uniform(random) < 0.6) machine.warm[k] = sizes[k] * normal(random);
    if (uniform(random) < 0.6) machine.still[k] = 3.0 * sizes[k] * normal(random);
  }
  if (uniform(random) < 0.33) {
    machine.wave = 0.02 * growth * machine.span * normal(random);
    machine.wave_length = machine.travel * (0.5 + uniform(random));
    machine.wave_phase = 2.0 * std::numbers::pi * uniform(random);
  }
  return machine;
}

ThermalReadings read(const Machine& machine, std::mt19937& random) {
  std::normal_distribution<double> normal;
  const int rounds = 20 + static_cast<int>(random() % 180);
  const Eigen::Index n = rounds * machine.places;
  ThermalReadings readings;
  readings.x.resize(n), readings.temperature.resize(n), readings.error.resize(n);
  readings.time = Eigen::VectorXd(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto round = i / machine.places, place = i % machine.places;
    readings.x(i) = machine.travel * static_cast<double>(place) / (machine.places - 1);
    readings.temperature(i) = machine.coldest + machine.span * static_cast<double>(round) / (rounds - 1);
    (*readings.time)(i) = 60.0 * static_cast<double>(round) + static_cast<double>(place);
    readings.error(i) =
        machine.error(readings.x(i), readings.temperature(i)) + machine.noise * normal(random);
  }
  return readings;
}

/// Columns of the oracle: constant, scale and bow, still and per kelvin.
Eigen::VectorXd oracle_row(const Machine& machine, double x, double temperature) {
  const double u = 2.0 * x / machine.travel - 1.0, dt = (temperature - machine.coldest) / machine.span;
  const Eigen::Vector3d over{1.0, u, 1.0 - u * u};
  const Eigen::Index seen = machine.places > 2 ? 3 : 2;
  Eigen::VectorXd row(2 * seen);
  row << over.head(seen), dt * over.head(seen);
  return row;
}

struct Judged {
  double ours = 0.0, oracle = 0.0;  // RMS over the travel and the temperatures [m]
  double covered = 0.0;             // share within two sigma
};

Judged judge(const Machine& machine, const ThermalReadings& readings) {
  const ThermalFit fit = identify_thermal(readings);
  Eigen::MatrixXd rows(readings.x.size(), oracle_row(machine, 0.0, 0.0).size());
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    rows.row(i) = oracle_row(machine, readings.x(i), readings.temperature(i)).transpose();
  const Eigen::VectorXd known = rows.completeOrthogonalDecomposition().solve(readings.error);
  Judged result;
  double count = 0.0;
  for (int i = 0; i <= 40; ++i)
    for (int j = 0; j <= 10; ++j) {
      const double x = machine.travel * i / 40.0, t = machine.coldest + machine.span * j / 10.0;
      const double truth = machine.error(x, t);
      const double apart = fit.model.value(fit.model.typical(x, t)) - truth;
      result.ours += apart * apart;
      result.oracle += std::pow(oracle_row(machine, x, t).dot(known) - truth, 2);
      result.covered += std::abs(apart) <= 2.0 * fit.model.sigma(fit.model.typical(x, t)) ? 1.0 : 0.0;
      count += 1.0;
    }
  result.ours = std::sqrt(result.ours / count);
  result.oracle = std::sqrt(result.oracle / count);
  result.covered /= count;
  return result;
}

struct Sum {
  double machines = 0.0, log_ratio = 0.0, ours = 0.0, oracle = 0.0, covered = 0.0;
  void add(const Judged& one) {
    machines += 1.0, covered += one.covered;
    log_ratio += std::log(one.ours / one.oracle);
    ours += one.ours * one.ours, oracle += one.oracle * one.oracle;
  }
  void print(const char* what) const {
    std::printf(
        "%s: %.0f machines, error over the oracle's %.2f (mean of logarithms), %.2f (RMS); within two sigma "
        "%.3f\n",
        what, machines, std::exp(log_ratio / machines), std::sqrt(ours / oracle), covered / machines);
  }
};

int run(int machines, unsigned first) {
  Sum plain, waves, all;
  std::printf("| seed | places | wave um | noise um | ours um | oracle um | ratio | within 2 sigma |\n");
  for (int k = 0; k < machines; ++k) {
    const unsigned seed = first + static_cast<unsigned>(k);
    std::mt19937 random{seed};
    const Machine machine = drawn(random);
    const Judged judged = judge(machine, read(machine, random));
    std::printf("| %u | %d | %.2f | %.2f | %.3f | %.3f | %.2f | %.2f |\n", seed, machine.places,
                1e6 * std::abs(machine.wave), 1e6 * machine.noise, 1e6 * judged.ours, 1e6 * judged.oracle,
                judged.ours / judged.oracle, judged.covered);
    (machine.wave == 0.0 ? plain : waves).add(judged);
    all.add(judged);
  }
  plain.print("without a wave");
  waves.print("with a wave");
  all.print("all");
  return 0;
}

}  // namespace
}  // namespace invar::metrology

int main(int argc, char** argv) {
  return invar::metrology::run(argc > 1 ? std::atoi(argv[1]) : 60,
                               argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1U);
}

// Fusion with a sensor that sticks: error over that of an oracle which is told which readings are stuck, and how often
// sigma holds.
//
//     build/bin/bench_fusion_sticking [machines] [first seed]
//
// Rigs are drawn at random: encoder step, offset and hysteresis, a tachometer that loses gain with speed and lags, its noise.
// Each is identified from runs at constant speed both ways, then moves and rests; the encoder, or in one of four the tachometer,
// sticks where the axis turns, at rest, or anywhere, for good or for some seconds. To the oracle, the same observer with the
// same model, stuck readings are missing. Every seed is printed.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>

#include "core/metrology/fusion/fusion_observer.hpp"
#include "tests/unit/metrology/fusion/fusion_rig.hpp"

namespace invar::metrology {
namespace {

using namespace testing;

struct Drawn {
  Rig rig;
  FusionRun stuck, told;  // the same run; in `told` the stuck readings are missing
  bool encoder = true;
  bool returns = false;
  double noise = 0.0;
};

Drawn draw(unsigned seed) {
  std::mt19937 random{seed};
  const auto between = [&](double a, double b) { return std::uniform_real_distribution{a, b}(random); };
  Drawn drawn;
  drawn.rig = {.step = 1e-3 * std::exp(between(std::log(0.5), std::log(4.0))),
               .offset = 1e-4 * between(-5.0, 5.0),
               .hysteresis = random() % 2 == 0 ? 0.0 : 1e-4 * between(0.0, 2.0),
               .compression = between(0.0, 0.2),
               .lag = 1e-3 * between(0.0, 5.0)};
  const double period = between(2.0, 6.0), rest = random() % 2 == 0 ? 0.0 : between(0.2, 1.5);
  drawn.noise = std::exp(between(std::log(0.03), std::log(0.4)));
  drawn.stuck =
      record(drawn.rig, with_rests(period, rest), 16.0, drawn.noise, static_cast<unsigned>(random()));
  drawn.told = drawn.stuck;
  const double turn = (0.5 * period + rest) * std::floor(between(1.0, 3.0)) + 0.5 * period;
  const int where = static_cast<int>(random() % 3);
  const double at = where == 0   ? turn + between(-0.02, 0.02)
                    : where == 1 ? turn + rest * between(0.0, 1.0)
                                 : between(2.0, 9.0);
  const Eigen::Index n = drawn.stuck.time.size();
  const auto from = std::min<Eigen::Index>(static_cast<Eigen::Index>(at / dt), n - 500);
  drawn.returns = random() % 2 == 0;
  const auto to =
      drawn.returns ? std::min<Eigen::Index>(from + static_cast<Eigen::Index>(between(1.0, 6.0) / dt), n) : n;
  drawn.encoder = random() % 4 != 0;
  auto& readings = drawn.encoder ? drawn.stuck.positions : drawn.stuck.velocities;
  auto& missing = drawn.encoder ? drawn.told.positions : drawn.told.velocities;
  readings.col(0).segment(from, to - from).setConstant(readings(from, 0));
  missing.col(0).segment(from, to - from).setConstant(std::numeric_limits<double>::quiet_NaN());
  return drawn;
}

struct Fused {
  double rms = 0.0;
  double covered = 0.0;  // share of rows within two sigma
};

Fused judge(const FusionModel& model, const FusionRun& run) {
  FusionObserver observer{model};
  const auto fused = fuse(observer, run);
  Fused result;
  for (std::size_t i = 0; i < fused.size(); ++i) {
    const double apart = std::abs(fused[i].position - run.reference(static_cast<Eigen::Index>(i)));
    result.rms += apart * apart / static_cast<double>(fused.size());
    result.covered += (apart <= 2.0 * fused[i].sigma ? 1.0 : 0.0) / static_cast<double>(fused.size());
  }
  result.rms = std::sqrt(result.rms);
  return result;
}

int run(int machines, unsigned first) {
  double log_ratio = 0.0, squares = 0.0, oracle_squares = 0.0, covered = 0.0;
  std::printf("| seed | sticks | step mm | noise | ours mm | oracle mm | ratio | within 2 sigma |\n");
  for (int k = 0; k < machines; ++k) {
    const unsigned seed = first + static_cast<unsigned>(k);
    const Drawn drawn = draw(seed);
    const FusionModel model = identify_sensors(training(drawn.rig, true), {"encoder"}, {"speed"}, nullptr);
    const Fused ours = judge(model, drawn.stuck), oracle = judge(model, drawn.told);
    std::printf("| %u | %s%s | %.2f | %.2f | %.3f | %.3f | %.2f | %.2f |\n", seed,
                drawn.encoder ? "encoder" : "tachometer", drawn.returns ? ", comes back" : "",
                1e3 * drawn.rig.step, drawn.noise, 1e3 * ours.rms, 1e3 * oracle.rms, ours.rms / oracle.rms,
                ours.covered);
    log_ratio += std::log(ours.rms / oracle.rms) / machines;
    squares += ours.rms * ours.rms, oracle_squares += oracle.rms * oracle.rms;
    covered += ours.covered / machines;
  }
  std::printf(
      "%d machines: error over the oracle's %.2f (mean of logarithms), %.2f (RMS); within two sigma %.3f\n",
      machines, std::exp(log_ratio), std::sqrt(squares / oracle_squares), covered);
  return 0;
}

}  // namespace
}  // namespace invar::metrology

int main(int argc, char** argv) {
  return invar::metrology::run(argc > 1 ? std::atoi(argv[1]) : 60,
                               argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1U);
}

// Random calibrations of every kind, judged against an oracle: machines of any chain, travel and roughness, line sets from
// too few to plenty, lasers with reversal, drift, outliers, beam breaks and missing rows.
//
//     build/bin/bench_geometric_cases [cases] [first seed] [--same-waves | --reversal | --screws | --pass]
//
// The last three draw machines of one kind: lost motion that varies along the axes, ball screws of any pitch with beam breaks,
// one pass of 50 to 5000 readings a line.
// Waves are harmonics of the axis' own travel (rails that bow), with --same-waves of 0.25 m whatever the travel (bolts).
// The oracle solves the same equations with the very covariance that the curves were drawn from, which nobody has.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "tests/bench/random_calibration.hpp"
#include "tests/unit/metrology/geometric/left_over.hpp"

namespace invar::metrology {
namespace {

using namespace testing;

double quantile(std::vector<double> values, double part) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1) + 0.5)];
}

struct Tally {
  std::string name;
  std::vector<double> ratio, inside, honesty, left, steps_inside;
};

void print(const Tally& tally) {
  double mean = 0.0, steps = 0.0, honesty = 0.0, log_ratio = 0.0;
  const double n = static_cast<double>(tally.ratio.size());
  for (std::size_t i = 0; i < tally.ratio.size(); ++i) {
    mean += tally.inside[i] / n;
    log_ratio += std::log(tally.ratio[i]) / n;
    honesty += tally.honesty[i] * tally.honesty[i] / n;
  }
  for (const double s : tally.steps_inside) steps += s / static_cast<double>(tally.steps_inside.size());
  std::printf("%-28s %5.0f %8.2f %8.3f %8.3f %8.3f %9.3f %8.3f %9.2f %9.3f\n", tally.name.c_str(), n,
              1e6 * quantile(tally.left, 0.5), std::exp(log_ratio), quantile(tally.ratio, 0.9), mean,
              quantile(tally.inside, 0.1), quantile(tally.inside, 0.0), std::sqrt(honesty), steps);
}

}  // namespace
}  // namespace invar::metrology

namespace {

invar::metrology::testing::Kind kind_named(const std::string& name) {
  using invar::metrology::testing::Kind;
  if (name == "--reversal") return Kind::reversal;
  if (name == "--screws") return Kind::screws;
  return name == "--pass" ? Kind::pass : Kind::any;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace invar::metrology;
  const int cases = argc > 1 ? std::atoi(argv[1]) : 100;
  const std::string how = argc > 3 ? argv[3] : "";
  testing::same_waves = how == "--same-waves";
  const testing::Kind kind = kind_named(how);
  const unsigned first = argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 5000;
  std::vector<Tally> tallies;
  Tally all{"all", {}, {}, {}, {}, {}};
  Tally reversal{"the reversal of an axis", {}, {}, {}, {}, {}};
  std::vector<double> seconds;
  for (int i = 0; i < cases; ++i) {
    const Case one = testing::random_case(first + static_cast<unsigned>(i), kind);
    const int nodes = one.axes == 2 ? 15 : 6;
    const std::clock_t start = std::clock();
    const Identification found = identify(one.machine, one.lines);
    seconds.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    const testing::Left left = testing::left_over(one.machine, &found.model, nodes);
    const GeometricModel best = testing::oracle(one, found);
    const double least = testing::left_over(one.machine, &best, nodes).rms;
    double steps = -1.0;
    if (i % 3 == 0 && kind == testing::Kind::any) {
      IdentificationOptions options;
      options.method = IdentificationMethod::displacement;
      const GeometricModel in_steps = identify(one.machine, one.lines, options).model;
      steps = testing::left_over(one.machine, &in_steps, nodes).inside;
    }
    const auto place = std::find_if(tallies.begin(), tallies.end(),
                                    [&](const Tally& t) { return t.name == one.lines_name; });
    Tally& tally =
        place == tallies.end() ? tallies.emplace_back(Tally{one.lines_name, {}, {}, {}, {}, {}}) : *place;
    for (Tally* t : {&tally, &all}) {
      t->left.push_back(left.rms);
      t->ratio.push_back(left.rms / least);
      t->inside.push_back(left.inside);
      t->honesty.push_back(left.rms / left.sigma);
      if (steps >= 0.0) t->steps_inside.push_back(steps);
    }
    if (kind == testing::Kind::reversal) {
      const auto errors = testing::reversal_errors(one, found);
      reversal.left.push_back(errors.found);
      reversal.ratio.push_back(errors.found / errors.oracle);
      reversal.inside.push_back(errors.inside);
      reversal.honesty.push_back(1.0);
      if (std::getenv("VERBOSE") != nullptr)
        std::printf("  %u reversal left %.3f oracle %.3f inside %.2f\n", first + static_cast<unsigned>(i),
                    1e6 * errors.found, 1e6 * errors.oracle, errors.inside);
    }
    if (std::getenv("VERBOSE") == nullptr) continue;
    std::printf(
        "  %u %-26s left %.2f oracle %.2f ratio %.2f inside %.2f residual/sigma %.2f noise %.3f misfit %.3f "
        "amp %.2f %.2f %.2f len %.3f %.3f %.3f readings %zu %.2f s\n",
        first + static_cast<unsigned>(i), one.lines_name.c_str(), 1e6 * left.rms, 1e6 * least,
        left.rms / least, left.inside, left.rms / left.sigma, 1e6 * found.noise, 1e6 * found.misfit,
        1e6 * found.prior.amplitude[0], 1e6 * found.prior.amplitude[1], 1e6 * found.prior.amplitude[2],
        found.prior.length[0], found.prior.length[1], found.prior.length[2],
        one.lines.front().readings.size(), seconds.back());
    for (const auto& line : found.lines)
      std::printf(
          "      %s: %d readings, %zu points, %d outliers, %zu breaks, drift %.2f um, noise %.2f um\n",
          line.name.c_str(), line.noise.readings, line.points.size(), line.noise.outliers,
          line.noise.breaks.size(), 1e6 * line.noise.drift, 1e6 * line.noise.noise);
    for (int k = 0; k < 3; ++k) {
      const auto& family = one.families[static_cast<std::size_t>(translation(k, k))];
      if (!one.machine.chain.has(k) || family.pitch <= 0.0) continue;
      std::printf("      %c true %.2f mm %.2f um:", "xyz"[k], 1e3 * family.period, 1e6 * family.pitch);
      for (const auto& wave : found.basis.waves)
        if (wave.axis == k)
          std::printf(" %.2f mm %.2f um", 1e3 * wave.period(), 1e6 * std::hypot(wave.cosine, wave.sine));
      std::printf("\n");
    }
  }
  std::printf("%-28s %5s %8s %8s %8s %8s %9s %8s %9s %9s\n", "lines", "cases", "left um", "ratio", "ratio 90",
              "2 sigma", "worst 10%", "worst", "res/sig", "steps 2s");
  std::sort(tallies.begin(), tallies.end(), [](const Tally& a, const Tally& b) { return a.name < b.name; });
  for (const Tally& tally : tallies) print(tally);
  print(all);
  if (kind == testing::Kind::reversal) print(reversal);
  std::printf("identification %.2f s of CPU median, %.2f s at most\n", quantile(seconds, 0.5),
              quantile(seconds, 1.0));
}

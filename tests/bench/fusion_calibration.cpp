// What the job calibrate-fusion brings: the axis of deployment/fusion.yaml with tachometers of several faults that nobody told
// the fusion, its fused position by the laser before and after. Prints a table; no test.
#include <cstdio>
#include <string>

#include "components/calibration/fusion_trial.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/trial_cell.hpp"

namespace {

using namespace invar;

job::JobStatus calibrate(double gain, double droop, double noise, const std::string& out) {
  support::FusedTachometer pair;
  pair.of_tachometer.gain = gain;
  pair.of_tachometer.gain_droop = droop;
  pair.of_tachometer.latency = 0.003;
  pair.of_tachometer.noise_level = noise;
  calibration::FusionTrial::Parameters trial;
  trial.sensors = {{"encoder", "position", "feedback"}, {"tachometer", "velocity", "port"}};
  trial.jobs.resize(1);
  trial.jobs[0].name = "fuse";
  trial.jobs[0].out = out;
  auto world = support::coarse_world();
  world.x.model = (support::machines / "axis-rippled.yaml").string();
  support::TrialCell<calibration::FusionTrial> cell{world, support::coarse_stage(), trial};
  support::FusedX fused{cell.axis, pair};
  cell.join(fused);
  cell.bring_up();
  return cell.run("fuse");
}

}  // namespace

int main() {
  std::puts("gain, loss of gain per m/s, noise: what the job said (encoder of 2 mm alone: 0.58 mm)");
  for (const double gain : {1.0, 0.92, 0.8, 1.2})
    for (const double droop : {0.0, 0.6})
      for (const double noise : {0.02, 0.1, 0.3}) {
        const testing::TemporaryFolder folder;
        const auto status = calibrate(gain, droop, noise, (folder / "out").string());
        std::printf("%.2f %.1f %.2f  %s%s\n", gain, droop, noise,
                    status.phase() == job::JOB_DONE ? "" : "failed: ", status.text().c_str());
      }
}

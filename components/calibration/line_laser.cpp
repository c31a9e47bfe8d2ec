#include "components/calibration/line_laser.hpp"

#include <stdexcept>

namespace invar::calibration {

LineLaser::LineLaser(Component& owner, job::JobHost& host, const double& timeout)
    : owner_{owner},
      host_{host},
      timeout_{timeout},
      reading_{owner, "reading", {.profile = "calibration"}, 4096},
      beam_{owner, "beam", "command"} {}

void LineLaser::drop_readings() {
  sensing::DisplacementReading unused;
  while (reading_.take(unused)) {
  }
}

job::Task LineLaser::align(Eigen::Vector3d from, Eigen::Vector3d to) {
  const Eigen::Vector3d direction = (to - from).normalized();
  sensing::BeamCommand beam;
  owner_.stamp(beam);
  beam.id(host_.next_id());
  beam.beam_start({from.x(), from.y(), from.z()});
  beam.beam_direction({direction.x(), direction.y(), direction.z()});
  beam_.write(beam);
  for (int k = 0; k < 4; ++k) co_await job::NextStep{};  // the beam is aligned before the first reading
}

job::Task LineLaser::average(std::int64_t count, double& mean) {
  drop_readings();
  sensing::DisplacementReading reading;
  const Instant after = owner_.now();
  double sum = 0.0;
  std::int64_t taken = 0;
  while (taken < count) {
    co_await job::NextStep{};
    while (taken < count && reading_.take(reading)) {
      if (reading.at().time_ns() < after.ns) continue;
      if (!reading.valid()) throw std::runtime_error{"the laser lost its beam"};
      sum += reading.displacement();
      ++taken;
    }
    if (owner_.now() - after > Duration::seconds(timeout_))
      throw std::runtime_error{"no reading of the laser arrives"};
  }
  mean = sum / static_cast<double>(count);
}

}  // namespace invar::calibration

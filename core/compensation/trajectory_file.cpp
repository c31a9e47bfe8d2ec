#include "core/compensation/trajectory_file.hpp"

#include <cmath>
#include <limits>

namespace invar::compensation {

void write_trajectory(ModelText& text, const metrology::DropletTrajectory& trajectory) {
  const Eigen::Vector3d covariance{trajectory.covariance(0, 0), trajectory.covariance(0, 1),
                                   trajectory.covariance(1, 1)};
  text.comment(
          "landed - aimed = placement + height * slope + field (aimed - centre) + (delay + height * "
          "slowness) * stage "
          "velocity; m, m/m, s, s/m")
      .numbers("placement", Eigen::VectorXd{trajectory.placement})
      .numbers("slope", Eigen::VectorXd{trajectory.slope})
      .number("slowness", trajectory.slowness)
      .number("delay", trajectory.delay)
      .comment("covariance of (placement, slope) in one direction: xx, xy, yy")
      .numbers("covariance", Eigen::VectorXd{covariance});
  if (std::isfinite(trajectory.slowness_sigma)) text.number("slowness_sigma", trajectory.slowness_sigma);
  if (std::isfinite(trajectory.delay_sigma)) text.number("delay_sigma", trajectory.delay_sigma);
  if (!trajectory.field.isZero(0.0)) {
    const Eigen::Vector4d field{trajectory.field(0, 0), trajectory.field(0, 1), trajectory.field(1, 0),
                                trajectory.field(1, 1)};
    const Eigen::Vector3d field_covariance{trajectory.field_covariance(0, 0),
                                           trajectory.field_covariance(0, 1),
                                           trajectory.field_covariance(1, 1)};
    text.open("field")
        .numbers("matrix", Eigen::VectorXd{field})
        .numbers("centre", Eigen::VectorXd{trajectory.field_centre})
        .comment("covariance of a row of the matrix: xx, xy, yy")
        .numbers("covariance", Eigen::VectorXd{field_covariance})
        .close();
  }
  text.open("heights")
      .number("least", trajectory.least_height)
      .number("most", trajectory.most_height)
      .close();
}

metrology::DropletTrajectory read_trajectory(const config::Node& root) {
  metrology::DropletTrajectory trajectory;
  const auto placement = exactly(root.required("placement"), 2, "m");
  const auto slope = exactly(root.required("slope"), 2, "1");
  const auto covariance = exactly(root.required("covariance"), 3, "1");
  trajectory.placement << placement[0], placement[1];
  trajectory.slope << slope[0], slope[1];
  trajectory.covariance << covariance[0], covariance[1], covariance[1], covariance[2];
  trajectory.slowness = root.number("slowness", "s/m", Range::not_negative());
  trajectory.slowness_sigma =
      root.number("slowness_sigma", "s/m", Range::not_negative(), std::numeric_limits<double>::infinity());
  trajectory.delay = root.number("delay", "s", {}, 0.0);
  trajectory.delay_sigma =
      root.number("delay_sigma", "s", Range::not_negative(), std::numeric_limits<double>::infinity());
  if (root.has("field")) {
    const auto node = root["field"];
    const auto field = exactly(node.required("matrix"), 4, "1");
    const auto centre = exactly(node.required("centre"), 2, "m");
    const auto spread = exactly(node.required("covariance"), 3, "1");
    trajectory.field << field[0], field[1], field[2], field[3];
    trajectory.field_centre << centre[0], centre[1];
    trajectory.field_covariance << spread[0], spread[1], spread[1], spread[2];
  }
  const auto heights = root.required("heights");
  trajectory.least_height = heights.number("least", "m");
  trajectory.most_height = heights.number("most", "m");
  return trajectory;
}

metrology::DropletTrajectory load_trajectory(const std::filesystem::path& file) {
  const auto yaml = config::Yaml::load(file);
  (void)yaml.root().integer("invar_compensation", 1, 1);
  (void)yaml.root().choice("kind", {"dispenser"});
  check_seal(yaml);
  yaml.root()["identified_from"].accept_all();
  const auto trajectory = read_trajectory(yaml.root());
  yaml.finish();
  return trajectory;
}

}  // namespace invar::compensation

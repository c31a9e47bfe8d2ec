// ruler.yaml: the circles of a ruler, whose radii are known.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

namespace invar::vision {

struct RulerMark {
  double radius = 0.0;                           // m
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // m, on the ruler; only a simulated camera needs it
};

/// `circles: [{radius: 5.0e-4}, ...]`, any order; each may say where it is: `at: [0, 1.0e-3]`. Throws InputError.
std::vector<RulerMark> read_ruler(const std::filesystem::path& file);

std::vector<double> radii_of(const std::vector<RulerMark>& ruler);

}  // namespace invar::vision

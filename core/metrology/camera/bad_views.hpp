// Bad views: views of a flat target that do not go with the others, and why.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/metrology/camera/planar_camera.hpp"

namespace invar::metrology {

struct BadView {
  std::size_t view = 0;  // of those given
  double rms = 0.0;      // px, of its points by the camera of the good views, pose fitted; NaN: no pose
  std::vector<Eigen::Index> points{};  // those that alone are wrong; empty: the whole view is
  std::string why = "its points are not in the order of the target's";
  bool has_cause = false;  // `why` names it for certain
};

struct SortedViews {
  std::vector<std::size_t> good;
  std::vector<BadView> bad;
};

/// Finds views whose points are in another order, doubled, exchanged, or of another camera. The homography of such a view leaves
/// far more than those of the others. Or a camera calibrated without the view meets it far worse than a typical one: three
/// times where a cause is found, six times otherwise. Up to a third of the views; at least four are kept.
SortedViews sort_views(const Eigen::Matrix2Xd& target, const std::vector<Eigen::Matrix2Xd>& views);

}  // namespace invar::metrology

// Identifiability: what a set of lines leaves open, in words and error motion names, and how accurate it will be.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/metrology/geometric/geometric_identification.hpp"

namespace invar::metrology {

/// How much of the prior's variance of one error motion (or squareness) the lines leave.
struct ErrorMotionKnowledge {
  std::string name;    // ISO
  double left = 1.0;   // posterior over prior variance, 0..1
  double sigma = 0.0;  // mean sd along the axis, m or rad
};

/// Something the lines do not tell: one error motion, or a combination that only shows as a sum.
struct Unidentified {
  std::vector<std::string> components;  // ISO names; more than one: a combination
  double left = 1.0;                    // largest share of prior variance left among them
  /// "EXY with EYX: the lines show only a combination" and the like.
  [[nodiscard]] std::string words() const;
};

struct Identifiability {
  std::vector<ErrorMotionKnowledge> components;
  std::vector<Unidentified> unidentified;
  double volumetric_rms = 0.0;  // m, expected length of the remaining error vector, rigid motion removed
  double volumetric_rms_prior = 0.0;  // m, the same before any line
};

/// Needs basis, posterior and model of an identification (or of a plan).
Identifiability identifiability(const GeometricBasis& basis, const Posterior& posterior,
                                const Squareness& squareness, const std::array<Range, 3>& travel,
                                const Eigen::Vector3d& tool);

}  // namespace invar::metrology

// Head of every model of a whole machine: chain, travels, tool, squareness.
#pragma once

#include <array>

#include "core/compensation/model_file.hpp"
#include "core/metrology/geometric/axis_reversal.hpp"
#include "core/metrology/geometric/volumetric.hpp"

namespace invar::compensation {

void write_chain(ModelText& text, const metrology::Chain& chain, const std::array<Range, 3>& travel,
                 const Eigen::Vector3d& tool);
/// Faults go to the document's list, as for all of these.
void read_chain(const config::Node& root, metrology::Chain& chain, std::array<Range, 3>& travel,
                Eigen::Vector3d& tool);

/// Pairs without a sigma were not identified and are left out.
void write_squareness(ModelText& text, const metrology::Squareness& squareness,
                      const metrology::Squareness& sigma);
void read_squareness(const config::Node& root, metrology::Squareness& squareness,
                     metrology::Squareness& sigma);

/// A reversal over position, as a map below `key`. The fault of a damaged one goes to the document's list.
void write_curve(ModelText& text, const std::string& key, const metrology::ReversalCurve& curve);
metrology::ReversalCurve read_curve(const config::Node& node, const char* unit, double largest);

/// The mean of each axis under `reversal`, the curves under `reversal_over_position`. A file without curves holds the means
/// everywhere; a mean of 0 without a curve was not measured.
void write_reversal(ModelText& text, const std::array<metrology::ReversalCurve, 3>& reversal);
void read_reversal(const config::Node& root, const metrology::Chain& chain,
                   const std::array<Range, 3>& travel, std::array<metrology::ReversalCurve, 3>& reversal);

}  // namespace invar::compensation

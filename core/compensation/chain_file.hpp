// What every model of a whole machine says of it first: chain, travels, tool, squareness.
#pragma once

#include <array>

#include "core/compensation/model_file.hpp"
#include "core/metrology/volumetric.hpp"

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

}  // namespace invar::compensation

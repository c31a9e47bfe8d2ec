// Waves: does a term that repeats in time or along the way do what a cause of its own would?
#pragma once

#include <cstddef>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Does the machine swing with this wave already without it? Then any wrong number of its laws leaves such a wave, and
/// nothing that comes from outside can be told from that.
bool is_its_own(const Case& data, const physics::Model& model, std::size_t term);

/// Does a wave in time explain something all along? One that begins throws a slow loop off at once, and would explain whatever
/// the start leaves.
bool lasts(const Case& data, const physics::Model& model, std::size_t term);

/// Is what a sine explains a line, with one phase from beginning to end? A hum of the noise has a band, and what coarse
/// steps make of a motion has another phase in every pass, however much evidence a sine in it gathers. Against the scatter
/// of its amplitude from block to block (Fisher's F), strictly where that is more than rows without memory would make.
bool is_line(const Case& data, const physics::Model& model, std::size_t term);

/// Would readings rounded to their own steps show the wave without it? Steps beat against the distance between rows and
/// against the steps of the instrument itself.
bool is_rounding(const Case& data, const physics::Model& model, std::size_t term);

}  // namespace invar::diagnosis

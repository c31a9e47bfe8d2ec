// An axis's residual carried back through its closed loop to the force (or the reading) that would have caused it.
#pragma once

#include <complex>
#include <vector>

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

using Complex = std::complex<double>;
using Spectrum = std::vector<Complex>;

std::size_t power_of_two(std::size_t n);
/// The lower half, its middle included, of the spectrum of values followed by zeros up to `size`.
Spectrum transform(std::vector<double> values, std::size_t size);

/// Responses of the whitened residual to a pulse of one tick at `site`, by output, over its size.
std::vector<std::vector<double>> pulse_responses(const Case& data, const Weighing& weighing,
                                                 const physics::Model& model, const char* site, double size);
/// Power of the answer to a push, by bin of the lower half of a spectrum of `size`.
std::vector<double> answer_power(const std::vector<std::vector<double>>& responses, std::size_t size);
/// The adjoint: for each row of a recording, how much a push there would take from the residual.
std::vector<double> carried_back(const Case& data, const Fit& fitted,
                                 const std::vector<std::vector<double>>& responses, std::size_t recording);

}  // namespace invar::diagnosis

// Lines: what stands out of the spectrum of a series over time, as sines and as square waves.
#pragma once

#include <utility>
#include <vector>

#include "core/diagnosis/locate/carried_back.hpp"

namespace invar::diagnosis {

std::vector<double> power_of(const Spectrum& spectrum, std::size_t bins);
/// Peaks of a power spectrum that stand out of their neighbourhood, best first; bins below `from` are left out.
std::vector<double> peaks(const std::vector<double>& power, std::size_t from, std::size_t to,
                          std::size_t most);

/// Waves that stand out of a series over time; `responses` are its answers to a push. Sines come best first by frequency
/// [Hz], square waves by frequency and phase at time zero [rad].
struct Lines {
  std::vector<double> frequency;
  std::vector<std::pair<double, double>> squares;
};
Lines lines_of(const std::vector<double>& time, std::vector<double> series,
               const std::vector<std::vector<double>>& responses);

}  // namespace invar::diagnosis

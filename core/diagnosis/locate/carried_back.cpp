#include "core/diagnosis/locate/carried_back.hpp"

#include <algorithm>
#include <unsupported/Eigen/FFT>

#include "core/physics/library.hpp"

namespace invar::diagnosis {

std::size_t power_of_two(std::size_t n) {
  std::size_t p = 1;
  while (p < n) p *= 2;
  return p;
}

Spectrum transform(std::vector<double> values, std::size_t size) {
  values.resize(size, 0.0);
  Spectrum out;
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  fft.fwd(out, values);
  return out;
}

std::vector<std::vector<double>> pulse_responses(const Case& data, const Weighing& weighing,
                                                 const physics::Model& model, const char* site, double size) {
  const auto& recording = data.recordings.front();
  const std::size_t rows = recording.inputs.rows(), at = std::min<std::size_t>(40, rows / 4);
  const double t = recording.inputs.time[at], period = recording.inputs.time[at + 1] - t;
  // Friction would hold the carriage against a small pulse; the loop's linear part is wanted.
  physics::Model smooth = model;
  std::erase_if(smooth.terms, [](const physics::Term& term) { return term.info->sticks_and_slips; });
  physics::Model pulsed = smooth;
  physics::Term pulse;
  pulse.info = physics::unmodelled(physics::Plant::axis, site);
  pulse.curve = {"time", {t - period, t, t + period}, {0.0, size, 0.0}};
  pulsed.terms.push_back(pulse);
  physics::Outputs quiet, struck;
  recording.simulation->run(smooth, quiet);
  recording.simulation->run(pulsed, struck);
  std::vector<std::vector<double>> responses;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    std::vector<double> difference(rows), white(rows);
    for (std::size_t i = 0; i < rows; ++i) difference[i] = (struck[o][i] - quiet[o][i]) / size;
    whiten(weighing.filters[o], difference, std::vector<bool>(rows, true), white.data());
    white.erase(white.begin(), white.begin() + static_cast<std::ptrdiff_t>(at));
    responses.push_back(std::move(white));
  }
  return responses;
}

std::vector<double> answer_power(const std::vector<std::vector<double>>& responses, std::size_t size) {
  std::vector<double> power(size / 2, 0.0);
  for (const auto& response : responses) {
    const auto one = transform(response, size);
    for (std::size_t k = 0; k < power.size(); ++k) power[k] += std::norm(one[k]);
  }
  return power;
}

std::vector<double> carried_back(const Case& data, const Fit& fitted,
                                 const std::vector<std::vector<double>>& responses, std::size_t recording) {
  Eigen::Index at = 0;
  for (std::size_t r = 0; r < recording; ++r)
    at += static_cast<Eigen::Index>(data.recordings[r].inputs.rows() * data.outputs.size());
  const std::size_t rows = data.recordings[recording].inputs.rows();
  const std::size_t size = power_of_two(2 * std::max(rows, responses.front().size()));
  Spectrum sum(size / 2 + 1, Complex{});
  for (std::size_t o = 0; o < data.outputs.size(); ++o, at += static_cast<Eigen::Index>(rows)) {
    std::vector<double> w(fitted.residual.data() + at,
                          fitted.residual.data() + at + static_cast<Eigen::Index>(rows));
    const auto residual = transform(std::move(w), size), response = transform(responses[o], size);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += std::conj(response[k]) * residual[k];
  }
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<double> back;
  fft.inv(back, sum, static_cast<Eigen::Index>(size));
  back.resize(rows);
  return back;
}

}  // namespace invar::diagnosis

#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/dataset/in_parallel.hpp"

#include <algorithm>
#include <cmath>

namespace invar::diagnosis {

using physics::Model;

std::vector<physics::Outputs> simulate(const Case& data, const Model& model) {
  Remembered::Simulations recordings;
  for (const auto& recording : data.recordings) recordings.push_back(recording.simulation);
  if (auto known = data.remembered->find(model, recordings)) return std::move(*known);
  auto all = simulate_once(data, model);
  data.remembered->keep(model, recordings, all);
  return all;
}

std::vector<physics::Outputs> simulate_once(const Case& data, const Model& model) {
  if (data.stop.stop_requested()) throw Stopped{};
  std::vector<physics::Outputs> all(data.recordings.size());
  for (std::size_t r = 0; r < all.size(); ++r) data.recordings[r].simulation->run(model, all[r]);
  return all;
}

Weighing weigh(const Case& data, const std::vector<physics::Outputs>& simulated, Colour colour) {
  Weighing weighing;
  weighing.left_of_inputs = data.left_of_inputs;
  weighing.present.resize(data.recordings.size());
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    std::vector<std::vector<double>> series;
    std::size_t used = 0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& measured = data.recordings[r].measured[o];
      std::vector<double> one(measured.size());
      std::vector<bool> present(measured.size());
      for (std::size_t i = 0; i < one.size(); ++i) {
        one[i] = measured[i] - simulated[r][o][i];
        present[i] = std::isfinite(one[i]);
        used += present[i] ? 1U : 0U;
      }
      series.push_back(std::move(one));
      weighing.present[r].push_back(std::move(present));
      weighing.rows += static_cast<Eigen::Index>(measured.size());
    }
    const std::size_t most =
        colour == Colour::fitted && data.is_time_series ? std::min<std::size_t>(16, used / 150) : 0;
    auto filter = fit_whitening(series, most);
    // Hardly any values: nothing but the user's word says how good they are.
    if (used < 20 && std::isfinite(data.given_noise[o])) filter = {{}, data.given_noise[o]};
    weighing.filters.push_back(filter);
  }
  // In a loop the command repeats the noise of the reading.
  weighing.temper = data.model.controller && data.outputs.size() > 1 ? 0.5 : 1.0;
  return weighing;
}

Eigen::Index rows_of(const Case& data) {
  Eigen::Index rows = 0;
  for (const auto& recording : data.recordings)
    rows += static_cast<Eigen::Index>(recording.inputs.rows() * data.outputs.size());
  return rows;
}

Eigen::VectorXd differences(const Case& data, const std::vector<physics::Outputs>& simulated) {
  Eigen::VectorXd out(rows_of(data));
  Eigen::Index at = 0;
  for (std::size_t rec = 0; rec < data.recordings.size(); ++rec)
    for (std::size_t o = 0; o < data.outputs.size(); ++o)
      for (std::size_t i = 0; i < data.recordings[rec].inputs.rows(); ++i)
        out(at++) = data.recordings[rec].measured[o][i] - simulated[rec][o][i];
  return out;
}

namespace {

/// What is present but not finite ran away.
void bound_run_away(const Whitening& filter, std::vector<double>& values) {
  for (double& v : values)
    if (!std::isfinite(v)) v = 1e3 * filter.sigma;
}

void whiten_all(const Case& data, const Weighing& weighing, const double* in, double* out) {
  std::vector<double> r;
  for (std::size_t rec = 0; rec < data.recordings.size(); ++rec)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      const std::size_t rows = data.recordings[rec].inputs.rows();
      r.assign(in, in + rows);
      bound_run_away(weighing.filters[o], r);
      whiten(weighing.filters[o], r, weighing.present[rec][o], out);
      in += rows;
      out += rows;
    }
}

}  // namespace

Eigen::VectorXd filtered(const Case& data, const Weighing& weighing, const Eigen::VectorXd& differences) {
  Eigen::VectorXd out(differences.size());
  whiten_all(data, weighing, differences.data(), out.data());
  return out.cwiseMax(-1e6).cwiseMin(1e6);
}

Eigen::VectorXd residual(const Case& data, const Weighing& weighing,
                         const std::vector<physics::Outputs>& simulated) {
  return filtered(data, weighing, differences(data, simulated));
}

Eigen::VectorXd residual(const Case& data, const Weighing& weighing, const Model& model) {
  return residual(data, weighing, simulate(data, model));
}

Eigen::MatrixXd whitened(const Case& data, const Weighing& weighing, const Eigen::MatrixXd& columns) {
  Eigen::MatrixXd out(columns.rows(), columns.cols());
  in_parallel(static_cast<std::size_t>(columns.cols()), [&](std::size_t j) {
    const auto k = static_cast<Eigen::Index>(j);
    whiten_all(data, weighing, columns.col(k).data(), out.col(k).data());
  });
  return out;
}

namespace {

/// Rows first to last - 1 of one output of one recording, among the rows of all.
struct Block {
  std::size_t recording = 0, output = 0, first = 0, last = 0;
};

std::vector<Block> blocks_of(const Case& data) {
  std::vector<Block> blocks;
  std::size_t at = 0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      const std::size_t rows = data.recordings[r].inputs.rows();
      blocks.push_back({r, o, at, at + rows});
      at += rows;
    }
  return blocks;
}

/// A stretch through the filter of its output. The filter goes on behind its end for as many rows as it looks back, from
/// one that is measured to the next.
Columns::Stretch whitened(const Weighing& weighing, const Block& block, const Columns::Stretch& stretch) {
  const auto& filter = weighing.filters[block.output];
  const auto& present = weighing.present[block.recording][block.output];
  const std::size_t first = static_cast<std::size_t>(stretch.first) - block.first;
  std::size_t last = static_cast<std::size_t>(stretch.last()) - block.first;
  for (std::size_t seen = 0; last < present.size() && seen < filter.a.size(); ++last)
    seen = present[last] ? seen + 1 : 0;
  std::vector<double> values(stretch.values.begin(), stretch.values.end());
  bound_run_away(filter, values);
  values.resize(last - first);
  const std::vector<bool> known(present.begin() + static_cast<std::ptrdiff_t>(first),
                                present.begin() + static_cast<std::ptrdiff_t>(last));
  Columns::Stretch white{stretch.column, stretch.first,
                         Eigen::VectorXd(static_cast<Eigen::Index>(values.size()))};
  whiten(filter, values, known, white.values.data());
  return white;
}

}  // namespace

Columns whitened(const Case& data, const Weighing& weighing, const Columns& columns) {
  const auto blocks = blocks_of(data);
  std::vector<Columns::Stretch> stretches;
  for (const auto& stretch : columns.stretches()) {
    const auto block = std::upper_bound(blocks.begin(), blocks.end(), static_cast<std::size_t>(stretch.first),
                                        [](std::size_t row, const Block& one) { return row < one.last; });
    stretches.push_back(whitened(weighing, *block, stretch));
  }
  return {columns.cols(), whitened(data, weighing, columns.full()), columns.full_at(), std::move(stretches)};
}

}  // namespace invar::diagnosis

#include "tools/diagnose/left_over.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "tools/diagnose/candidates.hpp"

namespace invar::diagnose {

namespace {

using Series = std::vector<double>;

Series rate_of(const Series& time, const Series& values) {
  Series rate(values.size(), 0.0);
  for (std::size_t i = 1; i + 1 < values.size(); ++i)
    rate[i] = (values[i + 1] - values[i - 1]) / (time[i + 1] - time[i - 1]);
  return rate;
}

/// The mean of the past, older rows less by exp(-1) every `rows`.
Series past_of(const Series& values, double rows) {
  Series past(values.size());
  double state = values.empty() ? 0.0 : values.front();
  for (std::size_t i = 0; i < values.size(); ++i) past[i] = state += (values[i] - state) / rows;
  return past;
}

/// What acts on the machine, whatever it answers: an answer holds the noise that is to be judged.
std::vector<Series> causes(const Case& data, const physics::Outputs& simulated, std::size_t recording) {
  const auto& inputs = data.recordings[recording].inputs;
  std::vector<Series> all;
  for (const auto& [name, values] : inputs.signals) {
    if (std::find(data.outputs.begin(), data.outputs.end(), name) != data.outputs.end()) continue;
    all.push_back(physics::bridged(inputs.time, values));
    if (data.is_time_series && (name == "reference" || name == "true_position")) {
      all.push_back(rate_of(inputs.time, all.back()));
      all.push_back(rate_of(inputs.time, all.back()));
      Series direction = all[all.size() - 2];
      for (double& v : direction) v = static_cast<double>((v > 0.0) - (v < 0.0));
      all.push_back(std::move(direction));
    }
  }
  if (data.model.plant == physics::Plant::thermal || data.model.plant == physics::Plant::equations)
    all.insert(all.end(), simulated.begin(), simulated.end());
  return all;
}

/// Orthonormal columns of the surface over all rows of all recordings; constants and copies drop out.
Eigen::MatrixXd surface(const Case& data, const std::vector<physics::Outputs>& simulated) {
  Eigen::Index rows = 0;
  for (const auto& recording : data.recordings) rows += static_cast<Eigen::Index>(recording.inputs.rows());
  std::vector<Eigen::VectorXd> direct, past;
  Eigen::Index at = 0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto own = causes(data, simulated[r], r);
    const auto n = static_cast<Eigen::Index>(data.recordings[r].inputs.rows());
    const auto put = [&](std::vector<Eigen::VectorXd>& columns, std::size_t k, const Series& values) {
      if (columns.size() <= k) columns.resize(k + 1, Eigen::VectorXd::Zero(rows));
      for (Eigen::Index i = 0; i < n; ++i) {
        const double v = values[static_cast<std::size_t>(i)];
        columns[k](at + i) = std::isfinite(v) ? v : 0.0;
      }
    };
    for (std::size_t k = 0; k < own.size(); ++k) {
      put(direct, k, own[k]);
      std::size_t memory = 0;
      if (data.is_time_series)
        for (const double span : {3.0, 20.0, 120.0}) put(past, 3 * k + memory++, past_of(own[k], span));
    }
    at += n;
  }
  const auto standardise = [](Eigen::VectorXd& column) {
    column.array() -= column.mean();
    const double size = std::sqrt(column.squaredNorm() / static_cast<double>(column.size()));
    column /= size > 1e-300 ? size : 1.0;
  };
  for (auto& column : direct) standardise(column);
  std::vector<Eigen::VectorXd> all{Eigen::VectorXd::Ones(rows)};
  all.insert(all.end(), direct.begin(), direct.end());
  for (std::size_t i = 0; i < direct.size(); ++i)
    for (std::size_t k = i; k < direct.size(); ++k) all.emplace_back(direct[i].cwiseProduct(direct[k]));
  all.insert(all.end(), past.begin(), past.end());
  Eigen::MatrixXd basis(rows, 0);
  for (auto& column : all) {  // Gram and Schmidt, twice: what hardly differs from the others says nothing
    const double size = column.norm();
    for (int pass = 0; pass < 2; ++pass) column -= basis * (basis.transpose() * column);
    if (!(column.norm() > 1e-4 * size) || basis.cols() * 6 > rows) continue;
    basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
    basis.rightCols(1) = column.normalized();
  }
  return basis;
}

}  // namespace

std::vector<double> followed_share(const Case& data, const physics::Model& model) {
  const auto simulated = simulate(data, model);
  const Eigen::MatrixXd basis = surface(data, simulated);
  std::vector<double> shares;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    std::vector<Series> left;
    Series values;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      left.push_back(data.recordings[r].measured[o]);
      for (std::size_t i = 0; i < left[r].size(); ++i) left[r][i] -= simulated[r][o][i];
      values.insert(values.end(), left[r].begin(), left[r].end());
    }
    const double level = median(values), most = 6.0 * robust_sigma(values);
    const auto share_at = [&](double shift) {  // each recording turned round by that share of itself
      Eigen::VectorXd column(basis.rows());
      Eigen::Index at = 0;
      for (const auto& one : left) {
        const std::size_t n = one.size(), by = static_cast<std::size_t>(shift * static_cast<double>(n));
        for (std::size_t i = 0; i < n; ++i) {
          const double v = one[(i + by) % n] - level;
          column(at++) = std::isfinite(v) ? std::clamp(v, -most, most) : 0.0;
        }
      }
      column.array() -= column.mean();
      const double all = column.squaredNorm();
      return all > 0.0 ? (basis.transpose() * column).squaredNorm() / all : 0.0;
    };
    constexpr int shifts = 30;
    double mean = 0.0, square = 0.0, largest = 0.0;
    for (int k = 0; k < shifts; ++k) {
      const double by_chance = share_at(0.1 + 0.8 * (k + 0.5) / shifts);
      mean += by_chance / shifts, square += by_chance * by_chance / shifts;
      largest = std::max(largest, by_chance);
    }
    const double spread = std::sqrt(std::max(0.0, square - mean * mean)), now = share_at(0.0);
    shares.push_back(now > std::max(largest, mean + 4.0 * spread) && mean < 1.0 ? (now - mean) / (1.0 - mean)
                                                                                : 0.0);
  }
  return shares;
}

}  // namespace invar::diagnose

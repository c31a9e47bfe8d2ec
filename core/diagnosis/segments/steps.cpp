#include "core/diagnosis/segments/steps.hpp"

#include <algorithm>
#include <cmath>

namespace invar::diagnosis {

namespace {

/// Is some output of these runs more than a share of its noise away from that of the others?
bool differ(const Case& data, const std::vector<physics::Outputs>& coarse,
            const std::vector<physics::Outputs>& fine, const std::vector<double>& noise) {
  constexpr double share = 0.1;
  for (std::size_t r = 0; r < coarse.size(); ++r)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      const auto& measured = data.recordings[r].measured[o];
      const double given = data.given_noise[o];
      const double least = std::isfinite(given) ? std::min(given, noise[o]) : noise[o];
      double sum = 0.0, rows = 0.0;
      for (std::size_t i = 0; i < measured.size(); ++i)
        if (const double e = coarse[r][o][i] - fine[r][o][i]; std::isfinite(e) && std::isfinite(measured[i]))
          sum += e * e, rows += 1.0;
      if (rows > 0.0 && std::sqrt(sum / rows) > share * least) return true;
    }
  return false;
}

}  // namespace

bool step_finely(Case& data, const physics::Model& at, const std::vector<double>& noise) {
  if (data.model.plant != physics::Plant::equations) return false;
  constexpr int most = 2;
  const auto run = [&at](const Case& with) {
    std::vector<physics::Outputs> all(with.recordings.size());
    for (std::size_t r = 0; r < all.size(); ++r) with.recordings[r].simulation->run(at, all[r]);
    return all;
  };
  auto coarse = run(data);
  int halved = 0;
  for (; halved < most; ++halved) {
    auto finer = data;
    for (auto& recording : finer.recordings) {
      recording.inputs.turn *= 0.5;
      recording.simulation = physics::prepare(finer.model, recording.inputs);
    }
    auto fine = run(finer);
    if (!differ(data, coarse, fine, noise)) break;
    data = std::move(finer);
    coarse = std::move(fine);
  }
  return halved > 0;
}

}  // namespace invar::diagnosis

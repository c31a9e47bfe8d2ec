// Remembered: the last runs of a case's models; a search asks for many of them again.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "core/physics/simulation.hpp"

namespace invar::diagnosis {

/// Any number of threads may ask and keep. A run counts as known where the prepared recordings and all numbers of the model
/// are the same, bit by bit.
class Remembered {
 public:
  using Simulations = std::vector<std::shared_ptr<const physics::Simulation>>;
  using Outputs = std::vector<physics::Outputs>;

  [[nodiscard]] std::optional<Outputs> find(const physics::Model& model, const Simulations& recordings) const;
  void keep(const physics::Model& model, const Simulations& recordings, const Outputs& outputs);

 private:
  struct Run {
    std::vector<physics::Parameter> parameters;
    std::vector<physics::Term> terms;
    Simulations recordings;  // held, so that no other recording ever stands at their place
    Outputs outputs;
  };
  mutable std::mutex mutex_;
  std::deque<Run> runs_;
};

}  // namespace invar::diagnosis

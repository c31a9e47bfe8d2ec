// ErrorMotionTables: networks of the error motions compiled for the control loop.
#pragma once

#include <Eigen/Core>
#include <array>
#include <variant>
#include <vector>

#include "core/metrology/geometric/error_motion_networks.hpp"
#include "core/numerics/lookup_table.hpp"

namespace invar::metrology {

/// Each network as a table of one to three inputs, linear in between, at the calibration's tool. Everything but the
/// constructor is real-time: no allocation, no exception, some 10 ns an error motion.
class ErrorMotionTables {
 public:
  /// `tolerance` [m]: how far an error motion's share of the field may be from its network, where `most_nodes` nodes suffice.
  explicit ErrorMotionTables(ErrorMotionNetworks model, double tolerance = 1e-8,
                             std::size_t most_nodes = 1U << 18U);

  /// The machine's states in the order of the model's; until then, and after `forget`, the usual ones hold.
  void set(std::size_t state, double value) noexcept { state_[state] = value; }
  void forget() noexcept;

  /// Actual minus commanded position [m]; end values are held outside travels and ranges.
  [[nodiscard]] Eigen::Vector3d error(const Eigen::Vector3d& position) const noexcept;
  [[nodiscard]] Eigen::Vector3d sigma(const Eigen::Vector3d& position) const noexcept {
    return model_.sigma_at(position, model_.tool, state_);
  }
  /// Whether the states as set lie within the calibration.
  [[nodiscard]] bool inside() const noexcept { return model_.knows(state_); }
  /// Proven bound [m] on the difference from the model within the travels.
  [[nodiscard]] double bound() const noexcept { return bound_; }
  [[nodiscard]] const ErrorMotionNetworks& model() const noexcept { return model_; }

 private:
  struct Entry {
    int component;
    std::vector<std::size_t> states;
    std::variant<numerics::LookupTable<1>, numerics::LookupTable<2>, numerics::LookupTable<3>> table;
  };
  [[nodiscard]] double value(const Entry& entry, double position) const noexcept;

  ErrorMotionNetworks model_;
  Eigen::Matrix3d directions_;
  std::vector<Entry> entries_;
  std::vector<double> state_;
  double bound_ = 0.0;
};

}  // namespace invar::metrology

// Compensation: corrects the setpoints of the axes by the identified error, live, layer by layer.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/component/staged_model.hpp"
#include "core/metrology/geometric_model.hpp"
#include "idl/compensation.h"
#include "idl/stage.h"
#include "idl/thermal.h"

namespace invar::compensation {

/// correction = -e(P - e(P)) at the axes' setpoints P, e of the active model. A model is staged (loaded and checked by a
/// thread of its own, never by the loop), activated and rolled back by command; the correction then moves to its new value
/// at no more than `rate_limit`, so nothing jumps. A model that is corrupt, of another machine or beyond the
/// bounds is refused and the last good one holds. Real-time.
class Compensation final : public Component {
 public:
  struct Parameters {
    std::int64_t axes = 2;
    std::filesystem::path model;
    double bound = 2e-3;
    double rate_limit = 1e-3;
    double largest_sigma = 1e-4;
    void describe(auto& p) {
      p(axes, "axes", 1, 3, "how many axes are corrected");
      p(model, "model", "compensation.yaml that is active from the start; none: nothing is corrected");
      p(bound, "bound", "m", Range{0.0, 0.1},
        "a model that corrects more anywhere in the travels is refused");
      p(rate_limit, "rate_limit", "m/s", Range{1e-9, 1.0},
        "how fast a correction may change beside the motion itself", while_running);
      p(largest_sigma, "largest_sigma", "m", Range{0.0, 0.1},
        "a model less certain than this at mid travel is refused");
    }
  };
  explicit Compensation(const Parameters& parameters);
  ~Compensation() override;
  void configure() override { model_.open(parameters_.model, "calibrate again"); }
  void activate() override;
  void cleanup() noexcept override { model_.close(); }
  void step(const Tick& tick) noexcept override;

 private:
  struct Axis;
  using Staged = StagedModel<metrology::GeometricModel>;

  [[nodiscard]] std::string refusal(const metrology::GeometricModel& model) const;
  void correct(const Tick& tick) noexcept;

  const Parameters& parameters_;
  std::vector<std::unique_ptr<Axis>> axes_;
  Input<thermal::NodeTemperature> temperature_{*this, "temperature", {.optional = true, .profile = "state"}};
  Staged model_;

  Eigen::Vector3d applied_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d setpoint_ = Eigen::Vector3d::Zero();
  bool easing_ = false;  // on the way to another model's correction
};

}  // namespace invar::compensation

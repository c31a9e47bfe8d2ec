// Compensation: corrects the setpoints of the axes by the identified error, live, layer by layer.
#pragma once

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
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
  void configure() override;
  void activate() override;
  void cleanup() noexcept override;
  void step(const Tick& tick) noexcept override;

 private:
  struct Axis;
  /// A file that was loaded and checked; kept until cleanup, so that the loop may hold a plain pointer.
  struct Model {
    metrology::GeometricModel geometric;
    std::uint64_t id = 0;
    std::uint32_t checksum = 0;
    std::string refusal;  // empty: sound
  };
  struct Request {
    std::uint64_t command = 0;
    std::array<char, 1025> path{};
  };
  struct Loaded {
    std::uint64_t command = 0;
    Model* model = nullptr;
  };

  [[nodiscard]] Model* load(const std::filesystem::path& file);
  [[nodiscard]] std::string refusal(const metrology::GeometricModel& model) const;
  void run_loader();
  void obey(const ModelCommand& command) noexcept;
  void take_loaded(const Loaded& loaded) noexcept;
  void answer(std::uint64_t command, ModelState state, const Model* model, const char* text) noexcept;
  void correct(const Tick& tick) noexcept;

  const Parameters& parameters_;
  std::vector<std::unique_ptr<Axis>> axes_;
  Input<thermal::NodeTemperature> temperature_{*this, "temperature", {.optional = true, .profile = "state"}};
  Inbox<ModelCommand> command_{*this, "model"};
  Output<ModelStatus> status_{*this, "status", "state"};

  const Model* active_ = nullptr;
  const Model* staged_ = nullptr;
  const Model* previous_ = nullptr;
  ModelStatus reply_;
  Eigen::Vector3d applied_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d setpoint_ = Eigen::Vector3d::Zero();
  bool easing_ = false;  // on the way to another model's correction

  Ring<Request> requests_{8};                   // loop to loader
  Ring<Loaded> loaded_{8};                      // loader to loop
  std::vector<std::unique_ptr<Model>> models_;  // the loader's
  std::atomic<bool> ending_{false};
  std::thread loader_;
};

}  // namespace invar::compensation

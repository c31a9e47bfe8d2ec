// Compensation: corrects the setpoints of the axes by the identified errors, live, layer by layer.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/compensation/kept_models.hpp"
#include "components/compensation/live_model.hpp"
#include "components/compensation/temperatures.hpp"
#include "core/component/component.hpp"
#include "core/component/model_loader.hpp"
#include "core/component/parameters.hpp"
#include "idl/compensation.h"
#include "idl/event.h"
#include "idl/stage.h"

namespace invar::compensation {

/// correction = -e(P - e(P)) at the axes' setpoints P; e is the sum of the layers:
///
/// - the geometric model, expanded to the slide's temperature where its calibration found an expansion, or error motions
///   measured one by one, which may depend on temperatures; with half the reversal of each axis to the side that it last
///   moved from;
/// - for each axis a model over position and temperature of the error that the geometric one leaves.
///
/// A model is staged (loaded, checked and compiled by a thread of its own, never by the loop), activated and rolled back by
/// command. A change of models is blended in at `rate_limit`. Changes made in a transaction are
/// taken back when their owner falls silent. A model that is corrupt, of another machine or beyond the bounds is refused and
/// the last good one holds.
///
/// Models in use outside a transaction are kept in the folder `state` and used again at the next start, before the models that
/// the cell file names. A kept model that is corrupt or of another machine is refused. Temperatures outside the calibrated
/// range hold the end value. When they are stale the last one holds, and after `temperature_hold` the layer is taken out. The
/// status and notices say so. Real-time.
class Compensation final : public Component {
 public:
  struct Parameters {
    std::int64_t axes = 2;
    std::filesystem::path machine;
    std::filesystem::path model;
    std::filesystem::path thermal_model;
    std::string state;
    std::vector<std::string> zones;
    double bound = 2e-3;
    double rate_limit = 1e-3;
    double steepest = 1e-2;
    double largest_sigma = 1e-4;
    double transaction_timeout = 60.0;
    double rate_filter = 20.0;
    double temperature_timeout = 2.0;
    double temperature_hold = 60.0;
    double most_outside = 2.0;
    void describe(auto& p);
  };
  explicit Compensation(const Parameters& parameters);
  [[nodiscard]] std::vector<Claim> claims() const override {
    const std::string folder = std::filesystem::path{parameters_.state}.lexically_normal().string();
    return folder.empty() ? std::vector<Claim>{}
                          : std::vector<Claim>{{"the folder " + folder, "state", true}};
  }
  ~Compensation() override;
  void configure() override;
  void activate() override;
  void cleanup() noexcept override;
  void step(const Tick& tick) noexcept override;

  /// Set-up, before configure: reads and keeps no state, as a replay must.
  void keep_nothing() { keeps_ = false; }

 private:
  struct Axis {
    Axis(Compensation& owner, std::size_t number)
        : state{owner, std::string{"state_"} + "xyz"[number]},
          correction{owner, std::string{"correction_"} + "xyz"[number]} {
      state.key = correction.key = static_cast<std::uint32_t>(number);
    }
    Input<stage::AxisState> state;
    Output<AxisCorrection> correction;
  };
  /// The models in use, by layer.
  struct Stack {
    LiveModel* geometric = nullptr;
    std::array<LiveModel*, 3> thermal{};
    [[nodiscard]] bool empty() const noexcept;
  };
  struct Layers {
    Eigen::Vector3d geometric = Eigen::Vector3d::Zero();  // m, each layer's correction
    Eigen::Vector3d thermal = Eigen::Vector3d::Zero();
    [[nodiscard]] Eigen::Vector3d sum() const noexcept { return geometric + thermal; }
  };
  // Models and transactions.
  void start_with_kept();
  void start_with_named();
  [[nodiscard]] Stack stack_of(const std::vector<KeptModels::Entry>& entries);
  void change_to(const Stack& next) noexcept;
  [[nodiscard]] const char* put_into(Stack& stack, LiveModel& model) const noexcept;
  void keep() noexcept;
  void obey(const ModelCommand& command) noexcept;
  void take_loaded() noexcept;
  [[nodiscard]] static const char* why_not_above(const LiveModel& model, const Stack& stack) noexcept;
  void use(const Stack& stack) noexcept;
  void say_in_use() noexcept;
  void end_transaction() noexcept;
  void watch_transaction(const Tick& tick) noexcept;
  void answer(std::uint64_t command, ModelState state, const LiveModel* model, const char* text) noexcept;
  void publish_status() noexcept;
  void notify(event::Severity level, const char* text) noexcept;

  // The loop: correction.cpp.
  void follow_temperature(const Tick& tick) noexcept;
  [[nodiscard]] TemperatureCondition judge(Instant at) noexcept;
  [[nodiscard]] bool expands() const noexcept {
    return active_.geometric != nullptr && active_.geometric->expands;
  }
  /// Whether the error motions depend on temperatures.
  [[nodiscard]] bool has_states() const noexcept {
    return active_.geometric != nullptr && active_.geometric->components && active_.geometric->by_temperature;
  }
  [[nodiscard]] double value_of(const LiveModel::State& state) const noexcept;
  [[nodiscard]] bool has_temperature() const noexcept {
    return condition_ != TEMPERATURE_UNUSED && condition_ != TEMPERATURE_REFUSED;
  }
  [[nodiscard]] double kelvin_outside(const LiveModel& model) const noexcept;
  void set_temperatures() noexcept;
  void set_states() noexcept;
  [[nodiscard]] bool is_used(const LiveModel* thermal) const noexcept {
    return thermal != nullptr && (!thermal->by_temperature || has_temperature());
  }
  /// Changes the layers without a step in the correction: the difference is blended in.
  template <class Change>
  void ease(Change change) noexcept {
    const Eigen::Vector3d was = wanted(setpoint_).sum();
    change();
    easing_ += was - wanted(setpoint_).sum();
  }
  [[nodiscard]] Layers corrections(const Eigen::Vector3d& at) const noexcept;
  [[nodiscard]] Layers wanted(const Eigen::Vector3d& setpoint) const noexcept;
  [[nodiscard]] double kelvin_in_doubt(Instant at, unsigned zones) const noexcept;
  [[nodiscard]] Eigen::Vector3d geometric_sigma(Instant at) const noexcept;
  [[nodiscard]] double thermal_sigma(const LiveModel& model, double x, Instant at) const noexcept;
  void follow_motion(const Eigen::Vector3d& velocity) noexcept;
  void correct(const Tick& tick) noexcept;
  void publish(const Tick& tick, const Layers& layers, const Eigen::Vector3d& before) noexcept;

  const Parameters& parameters_;
  ModelLimits limits_;
  std::vector<std::unique_ptr<Axis>> axes_;
  Temperatures temperatures_;
  Inbox<ModelCommand> command_{*this, "model"};
  Output<ModelStatus> status_{*this, "status", "state"};
  Output<event::Notice> notices_{*this, "notices", "event"};

  Stack active_;
  std::optional<Stack> before_;  // what a rollback without a transaction goes back to; nothing: not known
  LiveModel* staged_ = nullptr;
  std::uint64_t transaction_ = 0;
  Stack transaction_start_;
  Instant heard_;  // of the transaction's owner
  ModelStatus reply_;

  Eigen::Vector3d setpoint_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d moving_ =
      Eigen::Vector3d::Zero();  // sense of each axis' last motion: +1, -1, 0 before the first
  Eigen::Vector3d applied_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d easing_ = Eigen::Vector3d::Zero();  // what a change still has to go, on top of the layers
  bool blind_ = true;                                 // no setpoints: the last correction holds
  bool clamped_ = false;
  TemperatureCondition condition_ = TEMPERATURE_UNUSED;
  Instant outside_at_{INT64_MIN};
  Instant started_;
  double expanded_to_ = 0.0;         // degC, the temperature that the geometric layer is grown to
  double temperature_before_ = 0.0;  // at the last step of the lags
  Instant lags_at_;

  KeptModels kept_{*this};
  ModelLoader<LiveModel> loader_;  // its thread writes what is to be kept
  bool keeps_ = true;
  bool handles_models_ = false;  // something was loaded or changed
  bool begins_ = false;          // the first step says what stands
  std::string kept_refusal_;     // why the kept models are not in use
};

void Compensation::Parameters::describe(auto& p) {
  p(axes, "axes", 1, 3, "how many axes are corrected");
  p(machine, "machine", "machine.yaml: a model of another chain or travel is refused");
  p(model, "model",
    "compensation.yaml of kind geometric or components that is active from the start; none: nothing is "
    "corrected");
  p(thermal_model, "thermal_model", "compensation.yaml of kind thermal, likewise");
  p(state, "state",
    "folder that keeps the models in use over a restart, created; relative to where the cell was started; "
    "kept models win "
    "over `model`; none: nothing is kept");
  p(zones, "zones", "further temperatures: each makes a port temperature_<zone>");
  p(bound, "bound", "m", Range{0.0, 0.1}, "a model that corrects more anywhere in the travels is refused");
  p(rate_limit, "rate_limit", "m/s", Range{1e-9, 1.0},
    "how fast a correction may change beside the motion itself", while_running);
  p(steepest, "steepest", "m/m", Range{1e-6, 1.0},
    "a model whose correction changes faster along the way is refused");
  p(largest_sigma, "largest_sigma", "m", Range{0.0, 0.1},
    "a model less certain than this at mid travel is refused");
  p(transaction_timeout, "transaction_timeout", "s", Range{1.0, 3600.0},
    "without a sign of life from its owner a transaction is rolled back after this");
  p(rate_filter, "rate_filter", "s", Range{0.1, 3600.0}, "time constant of the heating rate's filter");
  p(temperature_timeout, "temperature_timeout", "s", Range{0.01, 3600.0},
    "an older temperature is stale: the last one holds");
  p(temperature_hold, "temperature_hold", "s", Range{0.0, 36000.0},
    "after this long the layer of position and temperature is taken out");
  p(most_outside, "most_outside", "K", Range{0.0, 100.0},
    "so far outside the calibrated temperatures the end value holds; further out the layer is taken out");
}

}  // namespace invar::compensation

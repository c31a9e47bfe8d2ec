// ModelWatch: compares an axis with its model while it works, and says so with the place when they part.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/component/staged_model.hpp"
#include "core/physics/force_balance.hpp"
#include "idl/event.h"
#include "idl/stage.h"

namespace invar::watch {

/// Balances the forces that the model knows against the motion that the axis makes, stretch by stretch. The
/// allowance covers noise and the model's own sigmas. Where the missing force exceeds `parts` times the allowance throughout `time`
/// of motion, a notice names the site and the variable of the force, as `invar diagnose` would. `quiet` of motion below `agrees` times takes it back. It
/// stands in the loop of its stage, since it needs every cycle. It takes models as the stage does: connected to the stage's
/// inbox it follows each `invar job apply`. Real-time.
class ModelWatch final : public Component {
 public:
  struct Parameters {
    std::filesystem::path model;
    double stretch = 0.025;
    double slowest = 2e-3;
    double noise = 0.1;
    double time = 4.0;
    double parts = 3.0;
    double agrees = 1.8;
    double quiet = 30.0;
    void describe(auto& p) {
      p(model, "model", "model.yaml of plant axis to compare with");
      p(stretch, "stretch", "s", Range{1e-3, 1.0}, "forces are balanced over so long");
      p(slowest, "slowest", "m/s", Range{1e-6, 1.0},
        "slower is no motion: dry friction may be anything there");
      p(noise, "noise", "N", Range{1e-6, 1e6}, "1 sigma of a stretch's balance where all is right");
      p(time, "time", "s", Range{0.1, 10.0}, "time of motion that is judged", while_running);
      p(parts, "parts", "1", Range{1.0, 1e3},
        "parted: force over its sigma, RMS over `time`, above it for `time`", while_running);
      p(agrees, "agrees", "1", Range{0.1, 1e3}, "agreeing again: below it ...", while_running);
      p(quiet, "quiet", "s", Range{0.0, 1e5}, "... for so much motion", while_running);
      if constexpr (requires { p.node(); }) {
        if (!p.node().has("model")) p.node().fault("`model` is missing", "name the model.yaml of the stage");
        if (agrees >= parts)
          p.node()["agrees"].fault("is not below `parts`", "leave a gap, so that notices do not chatter");
        if (time / stretch > static_cast<double>(physics::MissingForceHistory::size))
          p.node()["time"].fault("holds more than 512 stretches", "choose longer stretches or less time");
      }
    }
  };

  explicit ModelWatch(const Parameters& parameters);
  void configure() override { model_.open(parameters_.model, "diagnose the axis again"); }
  void cleanup() noexcept override { model_.close(); }
  void activate() override;
  void step(const Tick& tick) noexcept override;

  [[nodiscard]] bool parted() const noexcept { return parted_; }
  /// The missing force over its sigma, RMS over the last `time` of motion.
  [[nodiscard]] double over_noise() const noexcept { return over_noise_; }

 private:
  using Staged = StagedModel<physics::ForceBalance>;
  [[nodiscard]] std::string load(const std::filesystem::path& file, Staged::Model& model) const;
  void judge() noexcept;
  void notify(event::Severity level, const char* text) noexcept;

  const Parameters& parameters_;
  Input<stage::AxisState> state_{*this, "state"};
  Output<event::Notice> notices_{*this, "notices", "event"};
  Staged model_;
  physics::MissingForceHistory history_;
  event::Notice notice_;
  std::uint64_t last_cycle_ = 0;
  int gaps_ = 0;  // one after the other
  double over_noise_ = 0.0;
  bool parted_ = false;
  std::size_t above_ = 0, below_ = 0;  // stretches since force over sigma went above `parts`, below `agrees`
};

}  // namespace invar::watch

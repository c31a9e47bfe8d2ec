// LowPass: smooths one position signal with a first-order low-pass.
#pragma once

#include <cmath>
#include <numbers>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "idl/stage.h"

class LowPass final : public invar::Component {
 public:
  struct Parameters {
    double cutoff = 100.0;
    void describe(auto& p) {
      p(cutoff, "cutoff", "Hz", invar::Range{0.1, 450.0}, "-3 dB corner", invar::while_running);
    }
  };
  explicit LowPass(const Parameters& parameters) : parameters_{parameters} {}  // may allocate, may throw
  void activate() override { primed_ = false; }

  // Real-time. Exact for an input held over the period: y' = rate (u - y).
  void step(const invar::Tick& tick) noexcept override {
    const auto* u = raw_.latest();
    if (u == nullptr) return;  // nothing arrived yet
    if (!primed_) y_ = u->position();
    primed_ = true;
    y_ -= std::expm1(-2.0 * std::numbers::pi * parameters_.cutoff * tick.period) * (u->position() - y_);
    auto out = *u;  // keeps axis and stamp
    out.position(y_);
    smooth_.write(out);
  }

 private:
  const Parameters& parameters_;
  invar::Input<invar::stage::AxisFeedback> raw_{*this, "raw"};
  invar::Output<invar::stage::AxisFeedback> smooth_{*this, "smooth"};
  double y_ = 0.0;
  bool primed_ = false;
};

// The component alone, without middleware: a step of its input against the closed form.
#include "low_pass.hpp"

#include <iostream>

namespace test {

/// The other end of each port.
struct Bench : invar::Component {
  invar::Output<invar::stage::AxisFeedback> raw{*this, "raw"};
  invar::Input<invar::stage::AxisFeedback> smooth{*this, "smooth"};
  void step(const invar::Tick& /*tick*/) noexcept override {}
};

}  // namespace test

int main() {
  constexpr double period = 1e-3;  // s
  constexpr int steps = 200;
  const LowPass::Parameters parameters{.cutoff = 20.0};
  LowPass component{parameters};
  test::Bench bench;
  bench.raw.connect(*static_cast<invar::InputPort*>(component.find_port("raw")));
  static_cast<invar::OutputPort*>(component.find_port("smooth"))->connect(bench.smooth);
  component.activate();

  double worst = 0.0;  // m
  for (int i = 0; i < steps; ++i) {
    invar::stage::AxisFeedback sample;
    sample.position(i == 0 ? 0.0 : 1.0);
    bench.raw.write(sample);
    component.step({invar::Instant{i * 1'000'000LL}, period, static_cast<std::uint64_t>(i)});
    const double exact = -std::expm1(-2.0 * std::numbers::pi * parameters.cutoff * period * i);
    worst = std::max(worst, std::abs(bench.smooth.latest()->position() - exact));
  }
  std::cout << "largest difference from the closed form: " << (worst < 1e-12 ? "below" : "above")
            << " 1e-12 m\n";
  return worst < 1e-12 ? 0 : 1;
}

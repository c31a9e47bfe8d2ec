// Small components that the executor's tests step.
#pragma once

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <stdexcept>
#include <thread>

#include "core/component/component.hpp"
#include "core/executor/executor.hpp"

namespace invar::toys {

/// Waits for the world; a watchdog, not a measurement.
template <class Condition>
bool eventually(Condition condition) {
  for (int i = 0; i < 20'000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
  return false;
}

struct Sample {
  std::uint64_t cycle = 0;
  double value = 0.0;
};

/// A mass on a spring pushed by `force`: feedback with some arithmetic in it.
class Plant final : public Component {
 public:
  Input<Sample> force{*this, "force"};
  Output<Sample> position{*this, "position"};
  void step(const Tick& tick) noexcept override {
    const Sample* f = force.latest();
    const double a = (f != nullptr ? f->value : 0.0) - 40.0 * x_ - 0.3 * v_;
    v_ += a * tick.period;
    x_ += v_ * tick.period;
    position.write({tick.cycle, x_});
  }

 private:
  double x_ = 0.01, v_ = 0.0;
};

/// A PD controller with a gain that may change while running and a setpoint that starts at the measured
/// value.
class Servo final : public Component {
 public:
  struct Parameters {
    double gain = 100.0;
    double window = 1.0;
    void describe(auto& p) {
      p(gain, "gain", "1/s2", Range{0.0, 1000.0}, "proportional gain", while_running);
      p(window, "window", "s", Range{0.0, 10.0}, "fixed");
    }
  };
  Input<Sample> position{*this, "position", {.deadline = Duration::milliseconds(3)}};
  Output<Sample> force{*this, "force"};

  explicit Servo(const Parameters& parameters) : parameters_{parameters} {
    force.set_safe_value({0, 0.0});
    starts_at(setpoint, measured, 1e-6);
  }
  void configure() override {
    ++configured;
    if (refuse_to_configure) throw std::runtime_error{"no such device"};
  }
  void activate() override {
    measured = std::numeric_limits<double>::quiet_NaN();
    if (const Sample* p = position.latest()) measured = p->value;
    setpoint = measured + jump;
  }
  void step(const Tick& tick) noexcept override {
    ++steps;
    if (fail_at != 0 && tick.cycle == fail_at) {
      fail("following error too large");
      return;
    }
    const Sample* p = position.latest();
    if (p == nullptr) return;
    if (!std::isfinite(measured)) setpoint = (measured = p->value) + jump;
    force.write({tick.cycle, parameters_.gain * (setpoint - p->value)});
  }
  void deactivate() noexcept override { ++deactivated; }
  void cleanup() noexcept override { ++cleaned; }
  bool input_lost(const InputPort&, const Tick&) noexcept override {
    ++lost;
    return controls_loss;
  }
  void parameters_changed() noexcept override { ++changes; }

  double setpoint = 0.0, measured = 0.0, jump = 0.0;
  std::uint64_t fail_at = 0;
  bool refuse_to_configure = false, controls_loss = false;
  int configured = 0, cleaned = 0, deactivated = 0, changes = 0, lost = 0;
  std::uint64_t steps = 0;

 private:
  const Parameters& parameters_;
};

/// Runs a function each step.
class Call final : public Component {
 public:
  explicit Call(std::function<void(const Tick&)> work) : work_{std::move(work)} {}
  void step(const Tick& tick) noexcept override { work_(tick); }
  void activate() override { log("activate"); }
  void deactivate() noexcept override { log("deactivate"); }
  void configure() override { log("configure"); }
  std::vector<std::string>* journal = nullptr;

 private:
  void log(const char* what) {
    if (journal != nullptr) journal->push_back(name + " " + what);
  }
  std::function<void(const Tick&)> work_;
};

/// Slows down by one a step once it is asked to come to rest.
class Runner final : public Component {
 public:
  Input<Sample> seen{*this, "seen"};
  Output<Sample> driven{*this, "driven"};
  Runner() { driven.set_safe_value({0, -1.0}); }
  void step(const Tick& tick) noexcept override {
    if (asked && speed > 0) --speed;
    driven.write({tick.cycle, static_cast<double>(speed)});
  }
  bool wind_down() noexcept override {
    asked = true;
    return speed == 0;
  }
  void activate() override { asked = false; }
  std::atomic<int> speed{20};
  bool asked = false;
};

/// Keeps the newest sample of anything, and a hash of all of them.
class Listener final : public Component {
 public:
  Input<Sample> position{*this, "position"};
  Input<Sample> force{*this, "force"};
  void step(const Tick&) noexcept override {
    for (Input<Sample>* input : {&position, &force})
      if (const Sample* s = input->latest()) {
        last = *s;
        std::uint64_t bits = 0;
        std::memcpy(&bits, &s->value, sizeof bits);
        for (const std::uint64_t word : {bits, s->cycle}) hash = (hash ^ word) * 1099511628211ULL;
      }
  }
  Sample last;
  std::uint64_t hash = 1469598103934665603ULL;
};

/// What the runner reads, the runner, and who reads the runner.
struct Track {
  explicit Track(ExecutorOptions options) : executor{std::move(options)} {
    auto a = std::make_unique<Plant>();
    auto b = std::make_unique<Runner>();
    auto c = std::make_unique<Listener>();
    runner = b.get();
    listener = c.get();
    a->position.connect(b->seen);
    b->driven.connect(c->force);
    executor.add(std::move(a));
    executor.add(std::move(b));
    executor.add(std::move(c));
    for (const Transition transition : {Transition::configure, Transition::activate})
      for (std::size_t i = 0; i < 3; ++i) (void)executor.transition(i, transition);
  }
  [[nodiscard]] std::string states() const {
    std::string text;
    for (std::size_t i = 0; i < 3; ++i) text += executor.state(i) == LifecycleState::active ? 'a' : '-';
    return text;
  }
  Runner* runner;
  Listener* listener;
  Executor executor;
};

/// Plant, servo and listener, joined in a circle.
struct Loop {
  explicit Loop(ExecutorOptions options, std::uint32_t listen_every = 1) : executor{std::move(options)} {
    auto parameters = std::make_shared<Servo::Parameters>();
    Placement placement;
    ParameterLister lister{placement.parameters};
    parameters->describe(lister);
    placement.storage = parameters;
    placement.type = "servo";
    auto a = std::make_unique<Plant>();
    auto b = std::make_unique<Servo>(*parameters);
    auto c = std::make_unique<Listener>();
    plant = a.get();
    servo = b.get();
    listener = c.get();
    plant->name = "plant";
    servo->name = "servo";
    listener->name = "listener";
    plant->position.connect(servo->position);
    plant->position.connect(listener->position);
    servo->force.connect(plant->force);
    servo->force.connect(listener->force);
    executor.add(std::move(a), {"plant", {}, nullptr, 1});
    executor.add(std::move(b), std::move(placement));
    executor.add(std::move(c), {"listener", {}, nullptr, listen_every});
  }
  void bring_up() {
    for (std::size_t i = 0; i < 3; ++i) (void)executor.transition(i, Transition::configure);
    for (std::size_t i = 0; i < 3; ++i) (void)executor.transition(i, Transition::activate);
  }
  Plant* plant;
  Servo* servo;
  Listener* listener;
  Executor executor;
};

inline ExecutorOptions simulated() {
  ExecutorOptions options;
  options.process = "test";
  options.simulated = true;
  return options;
}

}  // namespace invar::toys

// Ports: how a component reads and writes samples without knowing where they come from or go to.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <typeindex>
#include <utility>
#include <vector>

#include "core/base/time.hpp"
#include "core/component/channel.hpp"

namespace invar {

class Component;

/// Base of every port. A port is a member of its component and registers itself there. Set-up only, except
/// where said.
class Port {
 public:
  enum class Direction { input, inbox, output };

  Port(Component& owner, std::string_view name, Direction direction, std::type_index type);
  virtual ~Port() = default;
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] Direction direction() const { return direction_; }
  /// The C++ type of its samples; core/dds finds the wire type by it.
  [[nodiscard]] std::type_index type() const { return type_; }
  [[nodiscard]] Component& owner() const { return owner_; }

  /// The name of the QoS profile: declared by the component, overridden by the deployment.
  std::string profile;
  /// The full topic, "cell/<cell>/<component>/<port>" or what the deployment connects it to; empty:
  /// unconnected.
  std::string topic;
  /// The axis, node, sensor or component that its samples are of: the member of their key beside `cell`. Nothing: the
  /// component's own id, and of an axis nothing is known. Declared by the component.
  std::optional<std::uint32_t> key;

 private:
  Component& owner_;
  std::string name_;
  Direction direction_;
  std::type_index type_;
};

/// How an input is declared.
struct InputOptions {
  /// Unconnected is a fault of the deployment unless the input is optional.
  bool optional = false;
  /// Zero: none. Otherwise, when the newest sample is older than this while the component is active, the
  /// executor takes the component to its safe state (Component::input_lost).
  Duration deadline{};
  std::string_view profile = "realtime";
};

/// The part of an input that an executor and a transport need, whatever its type.
class InputPort : public Port {
 public:
  InputPort(Component& owner, std::string_view name, Direction direction, std::type_index type,
            InputOptions options)
      : Port{owner, name, direction, type}, options_{options} {
    profile = options.profile;
  }

  [[nodiscard]] const InputOptions& options() const { return options_; }
  /// Samples of which keys are taken, beside that of the cell; empty: every one. Set by the deployment.
  std::vector<std::uint32_t> keys;
  /// The topic is the plant's and not of this cell alone: samples of cell 0 are for every cell. Set by the deployment.
  bool is_of_plant = false;
  /// When the newest sample arrived, in the clock of the owner's executor; Instant{INT64_MIN} before the
  /// first. Any thread.
  [[nodiscard]] Instant arrived() const noexcept { return {arrived_ns_.load(std::memory_order_acquire)}; }
  /// When the newest sample was made, by its stamp; Instant{INT64_MIN} before the first, and for types without a stamp.
  [[nodiscard]] Instant made() const noexcept { return {made_ns_.load(std::memory_order_relaxed)}; }
  [[nodiscard]] std::uint64_t received() const noexcept { return received_.load(std::memory_order_relaxed); }
  /// The outputs of this process that feed it. Set-up only.
  [[nodiscard]] const std::vector<const Port*>& sources() const { return sources_; }
  void add_source(const Port& output) { sources_.push_back(&output); }
  /// Discards the waiting commands of an inbox: a component that becomes active does not obey earlier ones. Real-time.
  virtual void discard() noexcept {}
  /// A sample came that is not taken: its writer does not own the topic, it is too old, of another key, or no number.
  /// Any thread.
  void refuse() noexcept { refused_.fetch_add(1, std::memory_order_relaxed); }
  /// Samples refused. Any thread.
  [[nodiscard]] virtual std::uint64_t lost() const noexcept {
    return refused_.load(std::memory_order_relaxed);
  }

 protected:
  template <class T>
  void mark(const T& sample, Instant now) noexcept {
    if constexpr (requires { sample.at().time_ns(); })
      made_ns_.store(sample.at().time_ns(), std::memory_order_relaxed);
    arrived_ns_.store(now.ns, std::memory_order_release);
    received_.fetch_add(1, std::memory_order_relaxed);
  }

 private:
  InputOptions options_;
  std::vector<const Port*> sources_;
  std::atomic<std::int64_t> arrived_ns_{INT64_MIN};
  std::atomic<std::int64_t> made_ns_{INT64_MIN};
  std::atomic<std::uint64_t> received_{0};
  std::atomic<std::uint64_t> refused_{0};
};

/// Receiver of the samples of an output: an input of this process, or a transport. Called on the writer's
/// thread; must be real-time when the writer is.
template <class T>
using Sink = std::function<void(const T& sample, Instant now)>;

/// The latest sample of a signal. Real-time.
template <class T>
class Input final : public InputPort {
 public:
  Input(Component& owner, std::string_view name, InputOptions options = {})
      : InputPort{owner, name, Direction::input, typeid(T), options} {}

  /// The newest sample, or nullptr when none arrived yet; stays valid and unchanged until the next call. All calls of one step
  /// give the same: what a component has checked is what it goes on with.
  const T* latest() noexcept;
  /// Time since the newest sample arrived; a very long time when there is none.
  [[nodiscard]] Duration age(Instant now) const noexcept {
    const Instant at = arrived();
    return at.ns == INT64_MIN ? Duration{INT64_MAX} : now - at;
  }

  /// From the one thread that feeds this input.
  void accept(const T& sample, Instant now) noexcept {
    channel_.write(sample);
    mark(sample, now);
  }

 private:
  Latest<T> channel_;
  std::uint64_t read_in_ = 0;  // the owner's step
};

/// Every sample in order, for commands and events. Real-time. Several sources may feed it, each through its
/// own lane.
template <class T>
class Inbox final : public InputPort {
 public:
  Inbox(Component& owner, std::string_view name, InputOptions options = {.profile = "command"},
        std::size_t capacity = 64)
      : InputPort{owner, name, Direction::inbox, typeid(T), options}, capacity_{capacity} {}

  /// The next sample, oldest first within a lane; false when there is none.
  bool take(T& sample) noexcept {
    for (auto& lane : lanes_)
      if (lane->pop(sample)) return true;
    return false;
  }
  void discard() noexcept override {
    for (T sample; take(sample);) {
    }
  }
  /// Those too that this component did not take in time. Any thread.
  [[nodiscard]] std::uint64_t lost() const noexcept override {
    std::uint64_t sum = InputPort::lost();
    for (const auto& lane : lanes_) sum += lane->lost();
    return sum;
  }

  /// Set-up only: a lane for one more feeding thread; valid as long as the port.
  [[nodiscard]] Sink<T> add_lane() {
    lanes_.push_back(std::make_unique<Ring<T>>(capacity_));
    Ring<T>* lane = lanes_.back().get();
    return [this, lane](const T& sample, Instant now) {
      lane->push(sample);
      mark(sample, now);
    };
  }

 private:
  std::size_t capacity_;
  std::vector<std::unique_ptr<Ring<T>>> lanes_;
};

/// The part of an output that an executor needs, whatever its type.
class OutputPort : public Port {
 public:
  OutputPort(Component& owner, std::string_view name, std::type_index type, std::string_view qos)
      : Port{owner, name, Direction::output, type} {
    profile = qos;
  }
  /// Writes the declared safe value, where there is one. Real-time.
  virtual void write_safe_value() noexcept = 0;
  /// Set-up only: joins an input of the same type in this process; false when the types differ.
  virtual bool connect(InputPort& input) = 0;
  [[nodiscard]] std::uint64_t written() const noexcept { return written_.load(std::memory_order_relaxed); }

 protected:
  void count() noexcept { written_.fetch_add(1, std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> written_{0};
};

/// A signal, event or command that the component gives. Real-time where its sinks are.
template <class T>
class Output final : public OutputPort {
 public:
  Output(Component& owner, std::string_view name, std::string_view qos = "realtime")
      : OutputPort{owner, name, typeid(T), qos} {}

  void write(const T& sample) noexcept;
  /// Set-up: what is written when the component fails or is deactivated (zero force, heater off).
  void set_safe_value(const T& sample) { safe_ = std::make_unique<T>(sample); }
  void write_safe_value() noexcept override;

  bool connect(InputPort& input) override {
    if (input.type() != type()) return false;
    if (input.direction() == Direction::input) {
      auto* latest = static_cast<Input<T>*>(&input);
      add_sink([latest](const T& sample, Instant now) { latest->accept(sample, now); });
    } else {
      add_sink(static_cast<Inbox<T>*>(&input)->add_lane());
    }
    input.add_source(*this);
    return true;
  }
  /// Set-up only.
  void add_sink(Sink<T> sink) { sinks_.push_back(std::move(sink)); }

 private:
  std::vector<Sink<T>> sinks_;
  std::unique_ptr<T> safe_;
};

}  // namespace invar

#include "core/component/component.hpp"

namespace invar {

template <class T>
const T* Input<T>::latest() noexcept {
  const std::uint64_t step = owner().running_step();
  if (step != 0 && step == std::exchange(read_in_, step)) return channel_.held();
  return channel_.read();
}

template <class T>
void Output<T>::write_safe_value() noexcept {
  if (!safe_) return;
  if constexpr (requires { safe_->cell(owner().cell); })
    safe_->cell(owner().cell);  // a receiver takes no sample of another cell
  write(*safe_);
}

template <class T>
void Output<T>::write(const T& sample) noexcept {
  count();
  const Instant now = owner().now();
  for (const auto& sink : sinks_) sink(sample, now);
}

}  // namespace invar

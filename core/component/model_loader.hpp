// ModelLoader: brings models from files to a loop that must not wait for them.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "core/component/component.hpp"

namespace invar {

/// Loading and checking happen on a thread of its own, never in the loop (in simulated time at once, so that runs
/// repeat). What was loaded is kept until `close`, so that the loop may hold a plain pointer. A `Model` has a number `id` and
/// a text `refusal`, empty where it is sound.
template <class Model>
class ModelLoader {
 public:
  /// Fills the model, or throws, or says in `refusal` why the loop must not use it.
  using Load = std::function<void(const std::filesystem::path& file, Model& model)>;
  struct Loaded {
    std::uint64_t command = 0;
    Model* model = nullptr;
  };

  ModelLoader(const Component& owner, Load load) : owner_{owner}, load_{std::move(load)} {}
  ~ModelLoader() { close(); }
  ModelLoader(const ModelLoader&) = delete;
  ModelLoader& operator=(const ModelLoader&) = delete;

  /// Set-up: from the component's configure. `also` is done in each turn of the thread, and a last time while the models
  /// still stand: what else the loop leaves to a thread. It must not throw.
  void open(std::function<void()> also = {}) {
    ending_ = false;
    if (!owner_.simulated_time) thread_ = std::thread{[this, also = std::move(also)] { run(also); }};
  }
  /// From the component's cleanup: the loop holds no model any more.
  void close() noexcept {
    ending_ = true;
    if (thread_.joinable()) thread_.join();
    Request request;
    while (requests_.pop(request)) {
    }
    Loaded loaded;
    while (loaded_.pop(loaded)) {  // the next start must not find one that is gone
    }
    models_.clear();
  }
  /// Set-up, before `open`. Never throws for a bad file: that is a model with a refusal.
  Model* load(const std::filesystem::path& file) {
    auto model = std::make_unique<Model>();
    try {
      load_(file, *model);
    } catch (const std::exception& error) {
      model->refusal = error.what();
    }
    models_.push_back(std::move(model));
    models_.back()->id = models_.size();
    return models_.back().get();
  }
  /// False: too many at once. Real-time where time is real.
  bool request(std::uint64_t command, std::string_view file) noexcept {
    Request request;
    request.command = command;
    std::memcpy(request.path.data(), file.data(), std::min(file.size(), request.path.size() - 1));
    if (!owner_.simulated_time) return requests_.push(request);
    return loaded_.push({command, load(request.path.data())});
  }
  /// The next that was loaded; false when there is none. Real-time.
  bool take(Loaded& loaded) noexcept { return loaded_.pop(loaded); }

 private:
  struct Request {
    std::uint64_t command = 0;
    std::array<char, 1025> path{};
  };
  void run(const std::function<void()>& also) {
    Request request;
    for (bool last = false; !last;) {
      last = ending_;
      while (!last && requests_.pop(request)) loaded_.push({request.command, load(request.path.data())});
      if (also) also();
      if (!last) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }

  const Component& owner_;
  Load load_;
  Ring<Request> requests_{8};                   // loop to thread
  Ring<Loaded> loaded_{8};                      // thread to loop
  std::vector<std::unique_ptr<Model>> models_;  // the thread's
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace invar

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
#include <initializer_list>
#include <memory>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "core/component/cell_folders.hpp"
#include "core/component/component.hpp"

namespace invar {

/// Why a rollback is refused: since the start, and in what was kept over it, no other model stood before the one in use.
inline constexpr const char* no_model_before =
    "the model before this one is not known; name its file, or take this one out";

/// Loading and checking happen on a thread of its own, never in the loop (in simulated time at once, so that runs
/// repeat). The loop holds plain pointers, and says by `use` which: what it holds no more is given back. A `Model` has a number
/// `id` and a text `refusal`, empty where it is sound.
template <class Model>
class ModelLoader {
  static constexpr std::size_t most_in_use = 16;

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
    taken_ = handed_over_;
    ++start_;  // what the loop said of its models is over
  }
  /// Set-up, before `open`. Never throws for a bad file: that is a model with a refusal.
  Model* load(const std::filesystem::path& file) {
    auto model = std::make_unique<Model>();
    try {
      load_(file, *model);
    } catch (const std::exception& error) {
      model->refusal = error.what();
    }
    model->id = ++last_id_;
    models_.push_back({std::move(model), 0});
    return models_.back().model.get();
  }
  /// False: too many at once. Real-time where time is real.
  bool request(std::uint64_t command, std::string_view file) noexcept {
    Request request;
    request.command = command;
    std::memcpy(request.path.data(), file.data(), std::min(file.size(), request.path.size() - 1));
    if (!owner_.simulated_time) return requests_.push(request);
    give_back(in_use_.read());
    return load_and_hand_over(request);
  }
  /// The next that was loaded; false when there is none. Real-time.
  bool take(Loaded& loaded) noexcept {
    if (!loaded_.pop(loaded)) return false;
    ++taken_;
    return true;
  }
  /// All models, of those that were loaded and taken so far, that the loop and `also` may still use; at most sixteen, null
  /// ones do not count. Real-time.
  void use(std::initializer_list<const Model*> models) noexcept {
    InUse used;
    used.start = start_;
    used.taken = taken_;
    std::copy_n(models.begin(), std::min(models.size(), most_in_use), used.models.begin());
    in_use_.write(used);
  }
  /// How many models are held. Not while the thread runs.
  [[nodiscard]] std::size_t held() const { return models_.size(); }

 private:
  struct Request {
    std::uint64_t command = 0;
    std::array<char, 1025> path{};
  };
  struct Held {
    std::unique_ptr<Model> model;
    std::uint64_t number = 0;  // counts those handed to the loop from 1; 0: it knew of it from the start
  };
  struct InUse {
    std::array<const Model*, most_in_use> models{};
    std::uint64_t taken = 0;
    std::uint64_t start = 0;
  };
  /// A command names a file; only in the cell's folders is it looked for.
  bool load_and_hand_over(const Request& request) {
    const std::filesystem::path named = request.path.data();
    std::optional<std::filesystem::path> file = named;
    if (owner_.folders) file = owner_.folders->model(named);
    Model* model = nullptr;
    if (file) {
      model = load(*file);
    } else {
      models_.push_back({std::make_unique<Model>(), 0});
      model = models_.back().model.get();
      model->id = ++last_id_;
      model->refusal = CellFolders::no_model;
    }
    if (loaded_.push({request.command, model})) {
      models_.back().number = ++handed_over_;
      return true;
    }
    models_.pop_back();
    return false;
  }
  void give_back(const InUse* used) {
    if (used == nullptr || used->start != start_) return;
    std::erase_if(models_, [used](const Held& held) {
      return held.number <= used->taken &&
             std::find(used->models.begin(), used->models.end(), held.model.get()) == used->models.end();
    });
  }
  void run(const std::function<void()>& also) {
    Request request;
    for (bool last = false; !last;) {
      last = ending_;
      const InUse* used = in_use_.read();  // first: what `also` finds waiting was in use before this was said
      while (!last && requests_.pop(request)) (void)load_and_hand_over(request);
      if (also) also();
      give_back(used);
      if (!last) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }

  const Component& owner_;
  Load load_;
  Ring<Request> requests_{8};                    // loop to thread
  Ring<Loaded> loaded_{8};                       // thread to loop
  Latest<InUse> in_use_;                         // loop to thread
  std::vector<Held> models_;                     // the thread's
  std::uint64_t last_id_ = 0, handed_over_ = 0;  // the thread's
  std::uint64_t taken_ = 0;                      // the loop's
  std::uint64_t start_ = 0;                      // counts those of the component
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace invar

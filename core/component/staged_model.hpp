// StagedModel: a model that a loop uses and that commands change - staged from a file, activated, rolled back.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/fault.hpp"
#include "core/component/component.hpp"
#include "idl/compensation.h"

namespace invar {

/// Loading and checking happen on a thread of its own, never in the loop (in simulated time at once, so that runs
/// repeat). What was loaded is kept until `close`, so that the loop may hold a plain pointer. `Content` is whatever
/// the loop evaluates.
template <class Content>
class StagedModel {
 public:
  struct Model {
    Content content;
    std::uint64_t id = 0;
    std::uint32_t checksum = 0;
    std::string refusal;  // empty: sound
  };
  /// Fills content and checksum, or throws; a text that it returns is why the model is refused.
  using Load = std::function<std::string(const std::filesystem::path& file, Model& model)>;

  StagedModel(Component& owner, Load load, std::string_view command_port, std::string_view status_port)
      : owner_{owner},
        load_{std::move(load)},
        command_{owner, command_port},
        status_{owner, status_port, "state"} {}
  ~StagedModel() { close(); }
  StagedModel(const StagedModel&) = delete;
  StagedModel& operator=(const StagedModel&) = delete;

  /// Set-up: from the component's configure. An empty file: no model at first. Throws InputError.
  void open(const std::filesystem::path& file, const char* mend) {
    active_ = staged_ = previous_ = nullptr;
    if (!file.empty()) {
      Model* model = load(file);
      if (!model->refusal.empty()) throw InputError{file.string(), model->refusal, mend};
      active_ = model;
    }
    ending_ = false;
    if (!owner_.simulated_time) loader_ = std::thread{[this] { run_loader(); }};
  }
  /// From the component's cleanup.
  void close() noexcept {
    ending_ = true;
    if (loader_.joinable()) loader_.join();
    active_ = staged_ = previous_ = nullptr;
    models_.clear();
  }
  /// From the component's activate: says which model is in use. Real-time.
  void announce() noexcept {
    answer(0, active_ != nullptr ? compensation::MODEL_ACTIVE : compensation::MODEL_NONE, active_, "");
  }

  /// Takes commands; true when another model, or none, is active from now on. Real-time.
  bool update() noexcept {
    bool changed = false;
    Loaded loaded;
    while (loaded_.pop(loaded)) take(loaded);
    compensation::ModelCommand command;
    while (command_.take(command)) changed = obey(command) || changed;
    return changed;
  }
  /// The model in use; nullptr: none. Real-time.
  [[nodiscard]] Model* active() noexcept { return active_; }

 private:
  struct Request {
    std::uint64_t command = 0;
    std::array<char, 1025> path{};
  };
  struct Loaded {
    std::uint64_t command = 0;
    Model* model = nullptr;
  };

  Model* load(const std::filesystem::path& file) {
    auto model = std::make_unique<Model>();
    try {
      model->refusal = load_(file, *model);
    } catch (const std::exception& error) {
      model->refusal = error.what();
    }
    models_.push_back(std::move(model));
    models_.back()->id = models_.size();
    return models_.back().get();
  }
  void run_loader() {
    Request request;
    while (!ending_) {
      while (requests_.pop(request)) loaded_.push({request.command, load(request.path.data())});
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  void answer(std::uint64_t command, compensation::ModelState state, const Model* model,
              const char* text) noexcept {
    reply_.cell(owner_.cell);
    reply_.component_id(owner_.id);
    reply_.at().time_ns(owner_.now().ns);
    reply_.command_id(command);
    reply_.state(state);
    reply_.model_id(model != nullptr ? model->id : 0);
    reply_.model_checksum(model != nullptr ? model->checksum : 0);
    reply_.text(text);
    status_.write(reply_);
  }
  void take(const Loaded& loaded) noexcept {
    if (!loaded.model->refusal.empty()) {
      answer(loaded.command, compensation::MODEL_REFUSED, loaded.model, loaded.model->refusal.c_str());
      return;
    }
    staged_ = loaded.model;
    answer(loaded.command, compensation::MODEL_STAGED, staged_, "");
  }
  bool obey(const compensation::ModelCommand& command) noexcept {
    switch (command.kind()) {
      case compensation::MODEL_STAGE: {
        Request request;
        request.command = command.id();
        std::memcpy(request.path.data(), command.path().c_str(),
                    std::min(command.path().size(), request.path.size() - 1));
        reply_.path(command.path());
        if (owner_.simulated_time) {
          take({request.command, load(request.path.data())});
        } else if (!requests_.push(request)) {
          answer(command.id(), compensation::MODEL_REFUSED, nullptr, "too many models at once; try again");
        }
        return false;
      }
      case compensation::MODEL_ACTIVATE:
        if (staged_ == nullptr) {
          answer(command.id(), compensation::MODEL_REFUSED, nullptr,
                 "nothing is staged; stage a model first");
          return false;
        }
        previous_ = active_;
        active_ = std::exchange(staged_, nullptr);
        answer(command.id(), compensation::MODEL_ACTIVE, active_, "");
        return true;
      case compensation::MODEL_ROLLBACK:
        active_ = std::exchange(previous_, nullptr);
        answer(command.id(), active_ != nullptr ? compensation::MODEL_ACTIVE : compensation::MODEL_NONE,
               active_, "");
        return true;
    }
    return false;
  }

  Component& owner_;
  Load load_;
  Inbox<compensation::ModelCommand> command_;
  Output<compensation::ModelStatus> status_;
  Model* active_ = nullptr;
  Model* staged_ = nullptr;
  Model* previous_ = nullptr;
  compensation::ModelStatus reply_;
  Ring<Request> requests_{8};                   // loop to loader
  Ring<Loaded> loaded_{8};                      // loader to loop
  std::vector<std::unique_ptr<Model>> models_;  // the loader's
  std::atomic<bool> ending_{false};
  std::thread loader_;
};

}  // namespace invar

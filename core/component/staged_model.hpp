// StagedModel: a model that a loop uses and that commands change - staged from a file, activated, rolled back, taken out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/base/fault.hpp"
#include "core/component/component.hpp"
#include "core/component/model_loader.hpp"
#include "idl/compensation.h"

namespace invar {

/// `Content` is whatever the loop evaluates. One model at a time, without transactions: a component with layers or trials
/// has commands of its own (components/compensation).
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
        loader_{owner, [load = std::move(load)](const std::filesystem::path& file,
                                                Model& model) { model.refusal = load(file, model); }},
        command_{owner, command_port},
        status_{owner, status_port, "state"} {}
  ~StagedModel() { close(); }
  StagedModel(const StagedModel&) = delete;
  StagedModel& operator=(const StagedModel&) = delete;

  /// Set-up: from the component's configure. An empty file: no model at first. Throws InputError.
  void open(const std::filesystem::path& file, const char* mend) {
    active_ = staged_ = nullptr;
    previous_.reset();
    if (!file.empty()) {
      Model* model = loader_.load(file);
      if (!model->refusal.empty()) throw InputError{file.string(), model->refusal, mend};
      active_ = model;
    }
    loader_.open();
  }
  /// From the component's cleanup.
  void close() noexcept {
    active_ = staged_ = nullptr;
    previous_.reset();
    loader_.close();
  }
  /// From the component's activate: the next update says which model is in use (what is written before the first step may
  /// find no reader yet).
  void announce() noexcept { begins_ = true; }

  /// Takes commands; true when another model, or none, is active from now on. Real-time.
  bool update() noexcept {
    // Said a step later, when the component too no longer uses the earlier model.
    if (std::exchange(handles_models_, false)) loader_.use({active_, staged_, previous_.value_or(nullptr)});
    bool changed = false;
    if (std::exchange(begins_, false))
      answer(0, active_ != nullptr ? compensation::MODEL_ACTIVE : compensation::MODEL_NONE, active_, "");
    take_loaded();
    compensation::ModelCommand command;
    while (command_.take(command)) changed = obey(command) || changed;
    return changed;
  }
  /// Instead of `update`, where another component answers the commands meanwhile. Real-time.
  void stand_by() noexcept { command_.discard(); }
  /// The model in use; nullptr: none. Real-time.
  [[nodiscard]] Model* active() noexcept { return active_; }

 private:
  void answer(std::uint64_t command, compensation::ModelState state, const Model* model,
              const char* text) noexcept {
    owner_.stamp(reply_);
    reply_.component_id(owner_.id);
    reply_.command_id(command);
    reply_.state(state);
    reply_.model_id(model != nullptr ? model->id : 0);
    reply_.model_checksum(model != nullptr ? model->checksum : 0);
    reply_.text(text);
    status_.write(reply_);
  }
  void take_loaded() noexcept {
    typename ModelLoader<Model>::Loaded loaded;
    while (loader_.take(loaded)) {
      handles_models_ = true;
      if (!loaded.model->refusal.empty()) {
        answer(loaded.command, compensation::MODEL_REFUSED, loaded.model, loaded.model->refusal.c_str());
        continue;
      }
      staged_ = loaded.model;
      answer(loaded.command, compensation::MODEL_STAGED, staged_, "");
    }
  }
  bool obey(const compensation::ModelCommand& command) noexcept {
    handles_models_ = true;
    switch (command.kind()) {
      case compensation::MODEL_STAGE:
        reply_.path(command.path());
        if (!loader_.request(command.id(), {command.path().c_str(), command.path().size()}))
          answer(command.id(), compensation::MODEL_REFUSED, nullptr, "too many models at once; try again");
        take_loaded();
        return false;
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
        if (!previous_) {
          answer(command.id(), compensation::MODEL_REFUSED, active_, no_model_before);
          return false;
        }
        active_ = *std::exchange(previous_, std::nullopt);
        answer(command.id(), active_ != nullptr ? compensation::MODEL_ACTIVE : compensation::MODEL_NONE,
               active_, "");
        return true;
      case compensation::MODEL_CLEAR:
        previous_ = std::exchange(active_, nullptr);
        answer(command.id(), compensation::MODEL_NONE, nullptr, "");
        return true;
      case compensation::MODEL_KEEP:
      case compensation::MODEL_COMMIT:
        break;
    }
    answer(command.id(), compensation::MODEL_REFUSED, nullptr,
           "there are no transactions here; stage, activate, roll back or clear");
    return false;
  }

  Component& owner_;
  ModelLoader<Model> loader_;
  Inbox<compensation::ModelCommand> command_;
  Output<compensation::ModelStatus> status_;
  Model* active_ = nullptr;
  Model* staged_ = nullptr;
  std::optional<Model*> previous_;  // since the first change; a rollback uses it up
  bool begins_ = false;
  bool handles_models_ = false;  // something was loaded or changed
  compensation::ModelStatus reply_;
};

}  // namespace invar

#include "components/compensation/compensation.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/machine/machine_file.hpp"

namespace invar::compensation {

namespace {

constexpr const char* no_transaction =
    "there is no such transaction: the compensation was restarted, or rolled it back";

}  // namespace

bool Compensation::Stack::empty() const noexcept {
  return geometric == nullptr && std::all_of(thermal.begin(), thermal.end(), [](auto* m) { return !m; });
}

Compensation::Compensation(const Parameters& parameters)
    : parameters_{parameters},
      temperatures_{*this, parameters.zones, parameters.rate_filter},
      loader_{*this, [this](const std::filesystem::path& file, LiveModel& model) {
                load_live_model(file, limits_, model);
              }} {
  if (parameters.zones.size() > 31) throw InputError{"zones", "there are too many", "name those in use"};
  for (std::size_t i = 0; i < static_cast<std::size_t>(parameters.axes); ++i)
    axes_.push_back(std::make_unique<Axis>(*this, i));
  if (!parameters.machine.empty()) limits_.machine = machine::load_machine(parameters.machine, 1);
  limits_.axes = static_cast<int>(parameters.axes);
  limits_.bound = parameters.bound;
  limits_.steepest = parameters.steepest;
  limits_.largest_sigma = parameters.largest_sigma;
  limits_.zones = parameters.zones;
}

Compensation::~Compensation() = default;

void Compensation::configure() {
  active_ = transaction_start_ = {};
  before_.reset();
  staged_ = nullptr;
  transaction_ = 0;
  kept_refusal_.clear();
  const bool keeps = keeps_ && !parameters_.state.empty();
  if (keeps)
    start_with_kept();
  else
    start_with_named();
  kept_.open(keeps ? parameters_.state : "");
  loader_.open([this] { kept_.write_waiting(); });
}

/// Puts a sound model into its layer; why not, if not.
const char* Compensation::put_into(Stack& stack, LiveModel& model) const noexcept {
  if (!model.refusal.empty()) return model.refusal.c_str();
  if (const char* why = why_not_above(model, stack); why != nullptr) return why;
  if (model.is_volumetric())
    stack.geometric = &model;
  else
    stack.thermal[model.axis] = &model;
  return nullptr;
}

void Compensation::start_with_named() {
  for (const auto* file : {&parameters_.model, &parameters_.thermal_model}) {
    if (file->empty()) continue;
    if (const char* why = put_into(active_, *loader_.load(*file)); why != nullptr)
      throw InputError{file->string(), why, "calibrate again"};
  }
}

/// Throws InputError for a model that is not the one that was kept, or none for this machine.
Compensation::Stack Compensation::stack_of(const std::vector<KeptModels::Entry>& entries) {
  Stack stack;
  for (const auto& entry : entries) {
    LiveModel& model = *loader_.load(entry.file);
    const char* why = put_into(stack, model);
    if (why == nullptr && model.checksum != entry.checksum) why = "it is not the one that was kept";
    if (why != nullptr) throw InputError{entry.file.string(), why, "calibrate again"};
  }
  return stack;
}

/// All of the kept models or none: a part of them would correct for another machine.
void Compensation::start_with_kept() {
  try {
    const auto kept = KeptModels::read(parameters_.state);
    if (!kept.any) return start_with_named();
    active_ = stack_of(kept.models);
    try {
      if (kept.before) before_ = stack_of(*kept.before);
    } catch (const InputError&) {  // a rollback is refused; what is in use stands
    }
  } catch (const InputError& error) {
    kept_refusal_ = std::string{"the kept model is refused: "} + error.what();
    start_with_named();
  }
}

void Compensation::keep() noexcept {
  const auto of = [](const Stack& stack) {
    return KeptModels::Selection{stack.geometric, stack.thermal[0], stack.thermal[1], stack.thermal[2]};
  };
  KeptModels::Selections models{of(active_), std::nullopt};
  if (before_) models.before = of(*before_);
  kept_.keep(models);
}

void Compensation::cleanup() noexcept {
  active_ = transaction_start_ = {};
  before_.reset();
  staged_ = nullptr;
  transaction_ = 0;
  loader_.close();  // what is waiting is kept first
}

void Compensation::activate() {
  if (transaction_ != 0) active_ = transaction_start_;  // its owner is told by the status
  transaction_ = 0;
  handles_models_ = true;
  temperatures_.forget();
  condition_ = TEMPERATURE_UNUSED;
  set_states();
  outside_at_ = {INT64_MIN};
  started_ = now();
  easing_.setZero();
  blind_ = true;
  begins_ = true;
}

void Compensation::notify(event::Severity level, const char* text) noexcept {
  event::Notice notice;
  stamp(notice);
  notice.component_id(id);
  notice.level(level);
  notice.source(name.c_str());
  notice.text(text);
  notices_.write(notice);
}

void Compensation::publish_status() noexcept {
  stamp(reply_);
  reply_.component_id(id);
  reply_.transaction(transaction_);
  reply_.geometric_checksum(active_.geometric != nullptr ? active_.geometric->checksum : 0);
  for (std::size_t i = 0; i < 3; ++i)
    reply_.thermal_checksum()[i] = active_.thermal[i] != nullptr ? active_.thermal[i]->checksum : 0;
  reply_.condition(condition_);
  status_.write(reply_);
}

void Compensation::answer(std::uint64_t command, ModelState state, const LiveModel* model,
                          const char* text) noexcept {
  reply_.command_id(command);
  reply_.state(state);
  reply_.model_id(model != nullptr ? model->id : 0);
  reply_.model_checksum(model != nullptr ? model->checksum : 0);
  reply_.text(text);
  if (state == MODEL_REFUSED) notify(event::SEVERITY_FAULT, text);
  publish_status();
}

/// Why a thermal model may not stand above the geometric model of the stack; nullptr: it may.
const char* Compensation::why_not_above(const LiveModel& model, const Stack& stack) noexcept {
  if (model.is_volumetric()) return nullptr;
  const std::uint32_t below = stack.geometric != nullptr ? stack.geometric->checksum : 0;
  if (model.above == below) return nullptr;
  if (model.above == 0)
    return "it describes the whole error of its axis, which the geometric model in use would count twice: "
           "calibrate it above that one";
  return "it was measured above another geometric model than the one in use: calibrate it again";
}

void Compensation::use(const Stack& stack) noexcept {
  handles_models_ = true;
  ease([&] {
    active_ = stack;
    for (LiveModel* model : active_.thermal)
      if (model != nullptr && model->lag > 0.0) model->lagged = temperatures_.trace().lagged(model->lag);
    set_temperatures();
    condition_ = judge(now());
    set_states();
  });
}

void Compensation::take_loaded() noexcept {
  ModelLoader<LiveModel>::Loaded loaded;
  while (loader_.take(loaded)) {
    handles_models_ = true;
    const LiveModel& model = *loaded.model;
    const char* why = model.refusal.empty() ? why_not_above(model, active_) : model.refusal.c_str();
    if (why == nullptr) staged_ = loaded.model;
    answer(loaded.command, why != nullptr ? MODEL_REFUSED : MODEL_STAGED, loaded.model,
           why != nullptr ? why : "");
  }
}

void Compensation::end_transaction() noexcept {
  transaction_ = 0;
  transaction_start_ = {};
}

void Compensation::change_to(const Stack& next) noexcept {
  if (transaction_ == 0) before_ = active_;
  use(next);
}

void Compensation::obey(const ModelCommand& command) noexcept {
  if (transaction_ != 0 && command.transaction() != transaction_) {
    answer(command.id(), MODEL_REFUSED, nullptr, "another calibration is under way; wait, or cancel it");
    return;
  }
  heard_ = now();
  if (command.kind() == MODEL_KEEP) {
    if (transaction_ == 0) answer(command.id(), MODEL_REFUSED, nullptr, no_transaction);
    return;
  }
  const bool changes = command.kind() == MODEL_ACTIVATE || command.kind() == MODEL_CLEAR;
  if (changes && command.transaction() != 0 && transaction_ == 0) {
    transaction_ = command.transaction();
    transaction_start_ = active_;
  }
  switch (command.kind()) {
    case MODEL_STAGE:
      reply_.path(command.path());
      if (!loader_.request(command.id(), {command.path().c_str(), command.path().size()}))
        answer(command.id(), MODEL_REFUSED, nullptr, "too many models at once; try again");
      take_loaded();
      return;
    case MODEL_ACTIVATE: {
      const char* why =
          staged_ == nullptr ? "nothing is staged; stage a model first" : why_not_above(*staged_, active_);
      if (why != nullptr) {
        answer(command.id(), MODEL_REFUSED, staged_, why);
        return;
      }
      Stack next = active_;
      LiveModel* model = std::exchange(staged_, nullptr);
      if (model->is_volumetric()) {
        next.geometric = model;
        for (LiveModel*& thermal : next.thermal) {
          if (thermal == nullptr || thermal->above == model->checksum) continue;
          thermal = nullptr;
          notify(event::SEVERITY_WARNING,
                 "the model of position and temperature was taken out: it was measured above another "
                 "geometric model");
        }
      } else {
        next.thermal[model->axis] = model;
      }
      change_to(next);
      if (transaction_ == 0) keep();
      answer(command.id(), MODEL_ACTIVE, model, "");
      return;
    }
    case MODEL_CLEAR: {
      Stack next = active_;
      next.thermal = {};
      if (command.path().size() == 0) next.geometric = nullptr;
      change_to(next);
      break;
    }
    case MODEL_ROLLBACK:
      if (command.transaction() != 0 && transaction_ == 0) {
        answer(command.id(), MODEL_REFUSED, nullptr, no_transaction);
        return;
      }
      if (transaction_ == 0 && !before_) {
        answer(command.id(), MODEL_REFUSED, nullptr, no_model_before);
        return;
      }
      use(transaction_ != 0 ? transaction_start_ : *std::exchange(before_, std::nullopt));
      end_transaction();
      break;
    case MODEL_COMMIT:
      if (transaction_ == 0) {
        answer(command.id(), MODEL_REFUSED, nullptr, no_transaction);
        return;
      }
      before_ = transaction_start_;
      end_transaction();
      break;
    case MODEL_KEEP:
      break;
  }
  if (transaction_ == 0) keep();
  answer(command.id(), active_.empty() ? MODEL_NONE : MODEL_ACTIVE, nullptr, "");
}

/// A transaction whose owner fell silent, or whose models go beyond the bound, is taken back.
void Compensation::watch_transaction(const Tick& tick) noexcept {
  if (transaction_ == 0) return;
  const char* why = nullptr;
  if (tick.now - heard_ > Duration::seconds(parameters_.transaction_timeout))
    why = "a calibration fell silent in the middle; its models were rolled back";
  else if (clamped_)
    why = "the correction went beyond the bound during a calibration; its models were rolled back";
  if (why == nullptr) return;
  use(transaction_start_);
  end_transaction();
  clamped_ = false;
  reply_.text(why);
  notify(event::SEVERITY_FAULT, why);
  publish_status();
}

/// Says which models are still in use; one that is in no place any more is given back.
void Compensation::say_in_use() noexcept {
  const auto& a = active_;
  const Stack b = before_.value_or(Stack{});
  const auto& t = transaction_start_;
  loader_.use({staged_, a.geometric, a.thermal[0], a.thermal[1], a.thermal[2], b.geometric, b.thermal[0],
               b.thermal[1], b.thermal[2], t.geometric, t.thermal[0], t.thermal[1], t.thermal[2]});
}

void Compensation::step(const Tick& tick) noexcept {
  if (std::exchange(handles_models_, false)) say_in_use();
  if (begins_) {
    begins_ = false;
    answer(0, active_.empty() ? MODEL_NONE : MODEL_ACTIVE, nullptr, kept_refusal_.c_str());
    if (!kept_refusal_.empty()) notify(event::SEVERITY_FAULT, kept_refusal_.c_str());
  }
  if (kept_.failed())
    notify(event::SEVERITY_FAULT,
           "the models in use could not be written to the folder `state`: the next start will not "
           "know them");
  take_loaded();
  ModelCommand command;
  while (command_.take(command)) obey(command);
  follow_temperature(tick);
  correct(tick);
  watch_transaction(tick);
}

}  // namespace invar::compensation

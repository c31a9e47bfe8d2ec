#include "components/compensation/compensation.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstring>

#include "core/compensation/geometric_file.hpp"

namespace invar::compensation {

namespace {

/// The checksum that seals the file, as a number for the wire.
std::uint32_t file_checksum(const std::filesystem::path& file) {
  const std::string seal = config::Yaml::load(file).root().text("checksum");
  std::uint32_t number = 0;
  (void)std::from_chars(seal.data(), seal.data() + seal.size(), number, 16);
  return number;
}

}  // namespace

struct Compensation::Axis {
  Axis(Compensation& owner, std::size_t number)
      : state{owner, std::string{"state_"} + "xyz"[number]},
        correction{owner, std::string{"correction_"} + "xyz"[number]} {}
  Input<stage::AxisState> state;
  Output<AxisCorrection> correction;
};

Compensation::Compensation(const Parameters& parameters) : parameters_{parameters} {
  for (std::size_t i = 0; i < static_cast<std::size_t>(parameters.axes); ++i)
    axes_.push_back(std::make_unique<Axis>(*this, i));
}

Compensation::~Compensation() { Compensation::cleanup(); }

void Compensation::configure() {
  active_ = staged_ = previous_ = nullptr;
  if (!parameters_.model.empty()) {
    const Model* model = load(parameters_.model);
    if (!model->refusal.empty())
      throw InputError{parameters_.model.string(), model->refusal, "calibrate again"};
    active_ = model;
  }
  ending_ = false;
  if (!simulated_time) loader_ = std::thread{[this] { run_loader(); }};
}

void Compensation::cleanup() noexcept {
  ending_ = true;
  if (loader_.joinable()) loader_.join();
  active_ = staged_ = previous_ = nullptr;
  models_.clear();
}

void Compensation::activate() {
  applied_.setZero();
  easing_ = true;  // from no correction to the model's, at the rate limit
  answer(0, active_ != nullptr ? MODEL_ACTIVE : MODEL_NONE, active_, "");
}

/// Why this model must not move the stage; empty: nothing. Looks at a grid over the travels.
std::string Compensation::refusal(const metrology::GeometricModel& model) const {
  if (model.chain.axes != static_cast<int>(axes_.size()))
    return "the model is of a machine with " + std::to_string(model.chain.axes) + " axes, this one has " +
           std::to_string(axes_.size());
  constexpr int steps = 20;
  Eigen::Vector3d middle;
  for (int i = 0; i < 3; ++i)
    middle[i] =
        (model.travel[static_cast<std::size_t>(i)].lower + model.travel[static_cast<std::size_t>(i)].upper) /
        2;
  for (int i = 0; i <= steps; ++i)
    for (int k = 0; k <= steps; ++k) {
      Eigen::Vector3d at = middle;
      at.x() = model.travel[0].lower + model.travel[0].width() * i / steps;
      at.y() = model.travel[1].lower + model.travel[1].width() * k / steps;
      const Eigen::Vector3d error = model.error(at, model.tool);
      if (!error.allFinite() || error.cwiseAbs().maxCoeff() > parameters_.bound)
        return "its correction is beyond the bound of " + std::to_string(parameters_.bound * 1e6) + " um";
    }
  if (const Eigen::Vector3d sigma = model.sigma_at(middle, model.tool);
      !(sigma.head(model.chain.axes).maxCoeff() <= parameters_.largest_sigma))
    return "it is not certain enough at mid travel";
  return {};
}

Compensation::Model* Compensation::load(const std::filesystem::path& file) {
  auto model = std::make_unique<Model>();
  try {
    model->geometric = load_geometric(file);
    model->checksum = file_checksum(file);
    model->refusal = refusal(model->geometric);
  } catch (const std::exception& error) {
    model->refusal = error.what();
  }
  models_.push_back(std::move(model));
  models_.back()->id = models_.size();
  return models_.back().get();
}

void Compensation::run_loader() {
  Request request;
  while (!ending_) {
    while (requests_.pop(request)) loaded_.push({request.command, load(request.path.data())});
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

void Compensation::answer(std::uint64_t command, ModelState state, const Model* model,
                          const char* text) noexcept {
  reply_.cell(cell);
  reply_.component_id(id);
  reply_.at().time_ns(now().ns);
  reply_.command_id(command);
  reply_.state(state);
  reply_.model_id(model != nullptr ? model->id : 0);
  reply_.model_checksum(model != nullptr ? model->checksum : 0);
  reply_.text(text);
  status_.write(reply_);
}

void Compensation::take_loaded(const Loaded& loaded) noexcept {
  if (!loaded.model->refusal.empty()) {
    answer(loaded.command, MODEL_REFUSED, loaded.model, loaded.model->refusal.c_str());
    return;
  }
  staged_ = loaded.model;
  answer(loaded.command, MODEL_STAGED, staged_, "");
}

void Compensation::obey(const ModelCommand& command) noexcept {
  switch (command.kind()) {
    case MODEL_STAGE: {
      Request request;
      request.command = command.id();
      std::memcpy(request.path.data(), command.path().c_str(),
                  std::min(command.path().size(), request.path.size() - 1));
      reply_.path(command.path());
      if (simulated_time) {
        take_loaded({request.command, load(request.path.data())});
      } else if (!requests_.push(request)) {
        answer(command.id(), MODEL_REFUSED, nullptr, "too many models at once; try again");
      }
      break;
    }
    case MODEL_ACTIVATE:
      if (staged_ == nullptr) {
        answer(command.id(), MODEL_REFUSED, nullptr, "nothing is staged; stage a model first");
        break;
      }
      previous_ = active_;
      active_ = std::exchange(staged_, nullptr);
      easing_ = true;
      answer(command.id(), MODEL_ACTIVE, active_, "");
      break;
    case MODEL_ROLLBACK:
      active_ = std::exchange(previous_, nullptr);
      easing_ = true;
      answer(command.id(), active_ != nullptr ? MODEL_ACTIVE : MODEL_NONE, active_, "");
      break;
  }
}

void Compensation::correct(const Tick& tick) noexcept {
  Eigen::Vector3d wanted = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma = Eigen::Vector3d::Zero();
  bool stale = false;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto* state = axes_[i]->state.latest();
    stale =
        stale || state == nullptr || axes_[i]->state.age(tick.now) > Duration::seconds(20.0 * tick.period);
    if (state != nullptr) setpoint_[static_cast<Eigen::Index>(i)] = state->setpoint_position();
  }
  if (active_ != nullptr && !stale) {
    const auto& model = active_->geometric;
    // Second step of the fixed point: the error where the machine is really sent (metrology.md section 5).
    const Eigen::Vector3d first = model.error(setpoint_, model.tool);
    wanted = -model.error(setpoint_ - first, model.tool);
    sigma = model.sigma_at(setpoint_, model.tool);
  } else if (active_ != nullptr) {
    wanted = applied_;  // no position to correct for: the last correction holds
  }
  const Eigen::Vector3d before = applied_;
  const double most = parameters_.rate_limit * tick.period;
  if (easing_) {
    const Eigen::Vector3d rest = wanted - applied_;
    applied_ += rest.cwiseMax(-most).cwiseMin(most);
    easing_ = rest.cwiseAbs().maxCoeff() > most;
  } else {
    applied_ = wanted;
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    AxisCorrection sample;
    sample.cell(cell);
    sample.axis(static_cast<std::uint32_t>(i));
    sample.at().time_ns(tick.now.ns);
    sample.at().cycle(tick.cycle);
    sample.correction(applied_[k]);
    sample.rate((applied_[k] - before[k]) / tick.period);
    sample.sigma(sigma[k]);
    sample.layer_count(1);
    sample.contribution()[0] = applied_[k];
    sample.layer_sigma()[0] = sigma[k];
    sample.model_id(active_ != nullptr ? active_->id : 0);
    sample.model_checksum(active_ != nullptr ? active_->checksum : 0);
    sample.stale(stale);
    sample.limited(easing_);
    axes_[i]->correction.write(sample);
  }
}

void Compensation::step(const Tick& tick) noexcept {
  Loaded loaded;
  while (loaded_.pop(loaded)) take_loaded(loaded);
  ModelCommand command;
  while (command_.take(command)) obey(command);
  correct(tick);
}

}  // namespace invar::compensation

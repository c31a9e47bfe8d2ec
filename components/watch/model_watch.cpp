#include "components/watch/model_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/model/model_file.hpp"

namespace invar::watch {

ModelWatch::ModelWatch(const Parameters& parameters)
    : parameters_{parameters},
      model_{*this,
             [this](const std::filesystem::path& file, Staged::Model& model) { return load(file, model); },
             "model", "model_status"} {}

std::string ModelWatch::load(const std::filesystem::path& file, Staged::Model& staged) const {
  const auto model = model::load(file);
  if (model.plant != physics::Plant::axis)
    return "it is a model of plant " + std::string{physics::name_of(model.plant)} + ", not of an axis";
  staged.content = physics::ForceBalance{
      model, {.stretch = parameters_.stretch, .slowest = parameters_.slowest, .noise = parameters_.noise}};
  return {};
}

void ModelWatch::activate() {
  history_.clear();
  last_cycle_ = 0;
  gaps_ = 0;
  parted_ = false;
  above_ = below_ = 0;
  if (auto* model = model_.active()) model->content.reset();
  model_.announce();
}

void ModelWatch::step(const Tick& tick) noexcept {
  if (model_.update()) {  // what another model left open is no longer the question
    history_.clear();
    if (parted_) notify(event::SEVERITY_NOTE, "the axis is compared with another model from now on");
    parted_ = false;
    above_ = below_ = 0;
  }
  const auto* state = state_.latest();
  auto* model = model_.active();
  if (state == nullptr || model == nullptr || state->at().cycle() == last_cycle_) return;
  const bool follows = state->at().cycle() == last_cycle_ + 1;
  last_cycle_ = state->at().cycle();
  gaps_ = follows ? 0 : gaps_ + 1;
  if (gaps_ > 100) fail("the watch needs every cycle of its axis: put it into the loop of the stage");
  if (!follows || !state->enabled()) {
    model->content.reset();
    return;
  }
  if (!model->content.add({state->position(), state->current()}, tick.period)) return;
  history_.add(model->content.missing());
  judge();
}

void ModelWatch::judge() noexcept {
  const auto stretches = [&](double seconds) {
    return static_cast<std::size_t>(std::lround(seconds / parameters_.stretch));
  };
  const std::size_t newest = stretches(parameters_.time);
  const double force = history_.rms(newest);
  over_noise_ = history_.rms_over_sigma(newest);
  const bool was_parted = parted_;
  above_ = over_noise_ > parameters_.parts || parted_ ? above_ + 1 : 0;
  below_ = over_noise_ < parameters_.agrees ? below_ + 1 : 0;
  if (!parted_)
    parted_ = above_ >= newest;
  else if (below_ >= stretches(parameters_.quiet))
    parted_ = false;
  if (parted_ && !was_parted) {
    const auto found = history_.locate(above_);
    char text[400];
    std::snprintf(
        text, sizeof text,
        "axis and model part: %.3g N RMS over %.3g s of motion, %.2g times the bound of noise and sigmas. "
        "Missing: %s, goes with %s (%.3g %s, %.0f %%)%s%s%s%s; record and diagnose",
        force, parameters_.time, over_noise_, found.site.data(), found.depends_on.data(), found.strength,
        found.unit.data(), 100.0 * found.share, found.rival.empty() ? "" : "; cannot be told from ",
        found.rival_site.data() != nullptr ? found.rival_site.data() : "",
        found.rival.empty() ? "" : " with ", found.rival.data() != nullptr ? found.rival.data() : "");
    notify(event::SEVERITY_WARNING, text);
  } else if (!parted_ && was_parted) {
    notify(event::SEVERITY_NOTE, "axis and model agree again");
  }
}

void ModelWatch::notify(event::Severity level, const char* text) noexcept {
  stamp(notice_);
  notice_.component_id(id);
  notice_.level(level);
  notice_.source(name.c_str());
  notice_.text(text);
  notices_.write(notice_);
}

}  // namespace invar::watch

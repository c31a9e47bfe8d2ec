#include "components/compensation/compensation.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

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

Compensation::Compensation(const Parameters& parameters)
    : parameters_{parameters},
      model_{*this,
             [this](const std::filesystem::path& file, Staged::Model& model) {
               model.content = load_geometric(file);
               model.checksum = file_checksum(file);
               return refusal(model.content);
             },
             "model", "status"} {
  for (std::size_t i = 0; i < static_cast<std::size_t>(parameters.axes); ++i)
    axes_.push_back(std::make_unique<Axis>(*this, i));
}

Compensation::~Compensation() = default;

void Compensation::activate() {
  applied_.setZero();
  easing_ = true;  // from no correction to the model's, at the rate limit
  model_.announce();
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
  const auto* active = model_.active();
  if (active != nullptr && !stale) {
    const auto& model = active->content;
    // Second step of the fixed point: the error where the machine is really sent (metrology.md section 5).
    const Eigen::Vector3d first = model.error(setpoint_, model.tool);
    wanted = -model.error(setpoint_ - first, model.tool);
    sigma = model.sigma_at(setpoint_, model.tool);
  } else if (active != nullptr) {
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
    sample.model_id(active != nullptr ? active->id : 0);
    sample.model_checksum(active != nullptr ? active->checksum : 0);
    sample.stale(stale);
    sample.limited(easing_);
    axes_[i]->correction.write(sample);
  }
}

void Compensation::step(const Tick& tick) noexcept {
  if (model_.update()) easing_ = true;
  correct(tick);
}

}  // namespace invar::compensation

// Thermal nodes from heater powers and ambient temperature.
#include <algorithm>
#include <cmath>

#include "core/physics/simulate_plants.hpp"

namespace invar::physics {

namespace {

class Nodes final : public Simulation {
 public:
  Nodes(const Model& structure, const Record& inputs) : time_{inputs.time} {
    const auto take = [&](const std::string& name) {
      const auto* values = inputs.find(name);
      return values == nullptr ? std::vector<double>{} : bridged(inputs.time, *values);
    };
    for (const auto& heater : structure.thermal.heaters) {
      powers_.push_back(take(heater.name));
      if (powers_.back().empty()) powers_.back().assign(time_.size(), 0.0);
    }
    ambient_ = take("ambient");
    speed_ = take("speed");
    motor_current_ = take("motor_current");
    for (const auto& node : structure.thermal.nodes) {
      const auto* values = inputs.find(node);
      start_.push_back(values == nullptr || values->empty() ? std::nan("") : values->front());
    }
  }

  void run(const Model& model, Outputs& outputs) const override {
    auto plant = make_thermal(model);
    const double room = model.value("ambient", 20.0);
    outputs.resize(plant.nodes());
    for (auto& output : outputs) output.resize(time_.size());
    plant.set_time(time_.front());
    // Nodes start in balance with the air unless the record says otherwise.
    for (std::size_t i = 0; i < plant.nodes(); ++i) {
      const double air = ambient_.empty() ? room : ambient_.front();
      plant.set_temperature(i, std::isfinite(start_[i]) ? start_[i] : air);
    }
    std::vector<double> powers(powers_.size());
    for (std::size_t row = 0; row < time_.size(); ++row) {
      for (std::size_t i = 0; i < plant.nodes(); ++i) outputs[i][row] = plant.reading(i);
      if (row + 1 == time_.size()) break;
      for (std::size_t h = 0; h < powers.size(); ++h) powers[h] = powers_[h][row];
      plant.step({powers, ambient_.empty() ? room : ambient_[row], speed_.empty() ? 0.0 : speed_[row],
                  motor_current_.empty() ? 0.0 : motor_current_[row]},
                 time_[row + 1] - time_[row]);
    }
  }

 private:
  std::vector<double> time_, ambient_, speed_, motor_current_, start_;
  std::vector<std::vector<double>> powers_;
};

}  // namespace

std::unique_ptr<Simulation> prepare_thermal(const Model& structure, const Record& inputs) {
  return std::make_unique<Nodes>(structure, inputs);
}

}  // namespace invar::physics

#include "core/compensation/component_file.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/base/index.hpp"
#include "core/compensation/chain_file.hpp"
#include "core/compensation/fusion_file.hpp"

namespace invar::compensation {

using metrology::error_motion_count;
using metrology::ErrorMotionNetwork;
using metrology::ErrorMotionNetworks;
using metrology::is_rotation;

namespace {

constexpr std::size_t most_states = 8;

}  // namespace

void write_components(ModelText& text, const ErrorMotionNetworks& model) {
  text.comment("Error = actual minus commanded position of the tool in the workpiece frame; m, rad.");
  text.comment("Components by ISO 230-1, measured one by one; squareness by ISO sign.");
  write_chain(text, model.chain, model.travel, model.tool);
  text.text("outside", "end values are held");
  write_squareness(text, model.squareness, model.squareness_sigma);
  write_reversal(text, model.reversal);
  if (!model.states.empty()) {
    text.comment(
        "States: inputs of error motions beside the position, counted from 0; degC, heating rates in K/s.");
    text.open_list("states");
    for (const auto& state : model.states) text.item().text("name", state.name).range("range", state.range);
    text.close();
  }
  text.comment(
      "Gaussian networks, the axis' position [m] first; `sigma` inside the ranges, `slope` an input scale.");
  text.open("components");
  for (int c = 0; c < error_motion_count; ++c) {
    const auto& component = model.components[index(c)];
    if (!component) continue;
    text.open(std::string{metrology::iso_name(c)});
    text.text("unit", is_rotation(c) ? "rad" : "m");
    if (!component->states.empty())
      text.numbers("states", std::vector<double>(component->states.begin(), component->states.end()));
    text.number("sigma", component->sigma).number("slope", component->slope);
    write_network(text, "network", component->network);
    text.close();
  }
  text.close();
}

ErrorMotionNetworks read_components(const config::Node& root) {
  ErrorMotionNetworks model;
  for (const char* key : {"identified_from", "outside"}) root[key].accept_all();
  read_chain(root, model.chain, model.travel, model.tool);
  read_squareness(root, model.squareness, model.squareness_sigma);
  if (root["reversal"].exists()) read_reversal(root, model.chain, model.travel, model.reversal);
  for (const auto& node : root["states"].children()) {
    metrology::MachineState state{node.text("name"), {}};
    const auto ends = exactly(node.required("range"), 2, "1");
    state.range = {ends[0], std::max(ends[0], ends[1])};
    model.states.push_back(std::move(state));
  }
  if (model.states.size() > most_states) root["states"].fault("there are more than 8");
  const config::Node components = root.required("components");
  for (int c = 0; c < error_motion_count; ++c) {
    const config::Node one = components[metrology::iso_name(c)];
    if (!one.exists()) continue;
    if (!model.chain.has(metrology::axis_of(c))) {
      one.fault("the chain has no such axis", "remove it");
      continue;
    }
    const char* unit = is_rotation(c) ? "rad" : "m";
    if (one.text("unit") != unit) one["unit"].fault("a wrong unit", std::string{"it is "} + unit);
    ErrorMotionNetwork component;
    for (const double state : one["states"].as_numbers("1")) {
      if (!(state >= 0.0 && state < static_cast<double>(model.states.size())) || state != std::floor(state)) {
        one["states"].fault("names a state that is not there", "calibrate again");
        continue;
      }
      component.states.push_back(static_cast<std::size_t>(state));
    }
    component.sigma = one.number("sigma", unit, Range::not_negative());
    component.slope = one.number("slope", unit, Range::not_negative());
    component.network = read_network(one.required("network"));
    if (component.states.size() > metrology::most_states_of_an_error_motion ||
        component.network.inputs() != static_cast<Eigen::Index>(1 + component.states.size())) {
      one.fault("the network has another number of inputs than the states", "calibrate again");
      continue;
    }
    model.components[index(c)] = std::move(component);
  }
  return model;
}

}  // namespace invar::compensation

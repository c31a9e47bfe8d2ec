#include "core/machine/machine_file.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace invar::machine {

namespace {

using config::Node;
using metrology::ErrorFunction;

constexpr Range machine_length{-100.0, 100.0};  // m; beyond it somebody wrote millimetres

metrology::Chain read_chain(const Node& node, int least_axes) {
  metrology::Chain chain;
  const std::size_t known = node.fault_count();
  const auto names = node.as_texts();
  if (!node.exists() || node.fault_count() > known) return chain;
  if (names.size() < static_cast<std::size_t>(least_axes) || names.size() > 3) {
    node.fault(std::string{"a chain has "} + (least_axes < 2 ? "one, " : "") +
                   "two or three axes, this one has " + std::to_string(names.size()),
               "write [y, x, z] or [y, x]");
    return chain;
  }
  chain.axes = 0;
  for (const auto& name : names) {
    const auto axis = metrology::axis_named(name);
    if (!axis) {
      node.fault("`" + name + "` is no axis of a chain", "use x, y and z");
    } else if (chain.has(*axis)) {
      node.fault("axis `" + name + "` stands twice in the chain", "name each axis once");
    } else {
      chain.order[static_cast<std::size_t>(chain.axes++)] = *axis;
    }
  }
  return chain;
}

ErrorFunction read_function(const Node& node, const std::string& unit) {
  std::vector<double> polynomial;
  std::vector<ErrorFunction::Harmonic> harmonics;
  std::vector<double> positions;
  std::vector<double> values;
  if (node.exists() && !node.is_map()) node.fault("a map is expected here", "write {polynomial: [...]}");
  if (const Node terms = node["polynomial"]; terms.exists()) polynomial = terms.as_numbers("");
  for (const Node& one : node["harmonics"].children())
    harmonics.push_back({one.number("amplitude", unit), one.number("period", "m", Range::positive()),
                         one.number("phase", "rad", {}, 0.0)});
  if (const Node table = node["table"]; table.exists()) {
    positions = table.required("position").as_numbers("m");
    values = table.required("value").as_numbers(unit);
    if (positions.size() != values.size() || positions.size() < 2 ||
        std::adjacent_find(positions.begin(), positions.end(), std::greater_equal<>{}) != positions.end()) {
      table.fault("a table needs two or more ascending positions and one value for each",
                  "write {position: [0, 0.1], value: [0, 1e-6]}");
      positions.clear();
      values.clear();
    }
  }
  return {std::move(polynomial), std::move(harmonics), std::move(positions), std::move(values)};
}

void read_each_axis(const Node& node, const metrology::Chain& chain, const std::string& unit, Range range,
                    std::array<double, 3>& into) {
  for (const Node& child : node.children()) {
    const auto axis = metrology::axis_named(child.key());
    if (!axis || !chain.has(*axis))
      child.fault("`" + child.key() + "` is no axis of this machine", "use the axes of its chain");
    else
      into[static_cast<std::size_t>(*axis)] = child.as_number(unit, range);
  }
}

metrology::MachineErrors read_errors(const Node& node, const metrology::Chain& chain) {
  metrology::MachineErrors errors;
  for (int i = 0; i < metrology::error_motion_count; ++i) {
    const Node child = node[metrology::iso_name(i)];
    if (!child.exists()) continue;
    if (!chain.has(metrology::axis_of(i)))
      child.fault("this machine has no axis " + metrology::axis_letter(metrology::axis_of(i)), "remove it");
    errors.functions[static_cast<std::size_t>(i)] =
        read_function(child, metrology::is_rotation(i) ? "rad" : "m");
  }
  for (int pair = 0; pair < metrology::squareness_count; ++pair) {
    const Node child = node[metrology::squareness_iso_name(pair)];
    if (!child.exists()) continue;
    errors.squareness[static_cast<std::size_t>(pair)] =
        metrology::squareness_cosine_from_angle(pair, child.as_number("rad", {-0.1, 0.1}));
  }
  for (const Node& child : node["reversal"].children()) {
    const auto axis = metrology::axis_named(child.key());
    if (!axis || !chain.has(*axis))
      child.fault("`" + child.key() + "` is no axis of this machine", "use the axes of its chain");
    else
      errors.reversal[static_cast<std::size_t>(*axis)] =
          child.is_map() && !child.has("value") ? read_function(child, "m")
                                                : ErrorFunction{child.as_number("m", {-1e-3, 1e-3})};
  }
  read_each_axis(node["expansion"], chain, "1/K", {-1e-3, 1e-3}, errors.expansion);
  read_each_axis(node["bending"], chain, "m/K", {-1e-3, 1e-3}, errors.bending);
  read_each_axis(node["base_expansion"], chain, "1/K", {-1e-3, 1e-3}, errors.base_expansion);
  errors.scale_lag = node.number("scale_lag", "s", {0.0, 1e5}, 0.0);
  errors.reference_temperature = node.number("reference_temperature", "degC", {-50.0, 200.0}, 20.0);
  return errors;
}

}  // namespace

metrology::Machine read_machine(const config::Node& root, int least_axes) {
  (void)root.integer("invar_machine", 1, 1);
  metrology::Machine machine;
  const std::size_t known = root.fault_count();
  machine.chain = read_chain(root.required("chain"), least_axes);
  if (root.fault_count() > known) {  // the rest is told by the chain
    for (const char* key : {"travel", "tool", "resolution", "errors"}) root[key].accept_all();
    return machine;
  }
  const Node travel = root.required("travel");
  for (int axis = 0; axis < metrology::axis_count; ++axis) {
    if (!machine.chain.has(axis)) {
      if (travel.is_map() && travel.has(metrology::axis_letter(axis)))
        travel[metrology::axis_letter(axis)].fault("the chain has no axis " + metrology::axis_letter(axis),
                                                   "remove it, or name it in the chain");
      continue;
    }
    const Node range = travel.required(metrology::axis_letter(axis));
    if (!range.exists()) continue;
    machine.travel[static_cast<std::size_t>(axis)] = range.as_range("m");
    const Range r = machine.travel[static_cast<std::size_t>(axis)];
    if (!machine_length.contains(r.lower) || !machine_length.contains(r.upper))
      range.fault("a travel beyond 100 m", "write it in m");
  }
  std::array<double, 3> tool{};
  for (const Node& child : root["tool"].children()) {
    if (const auto axis = metrology::axis_named(child.key()))
      tool[static_cast<std::size_t>(*axis)] = child.as_number("m", {-10.0, 10.0});
    else
      child.fault("unknown key", "use x, y and z");
  }
  machine.tool = {tool[0], tool[1], tool[2]};
  read_each_axis(root["resolution"], machine.chain, "m", {0.0, 1e-2}, machine.resolution);
  if (const Node errors = root["errors"]; errors.exists())
    machine.errors = read_errors(errors, machine.chain);
  return machine;
}

metrology::Machine load_machine(const std::filesystem::path& file, int least_axes) {
  const auto yaml = config::Yaml::load(file);
  const auto machine = read_machine(yaml.root(), least_axes);
  yaml.finish();
  return machine;
}

}  // namespace invar::machine

#include "core/compensation/geometric_file.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/base/index.hpp"
#include "core/compensation/chain_file.hpp"

namespace invar::compensation {

namespace {

using metrology::axis_of;
using metrology::error_motion_count;
using metrology::GeometricModel;
using metrology::is_rotation;

constexpr double most_translation = 0.1;  // m; rad for rotations: beyond it a model is refused

}  // namespace

void write_geometric(ModelText& text, const GeometricModel& model) {
  text.comment("Error = actual minus commanded position of the tool in the workpiece frame; m, rad.");
  text.comment(
      "Components by ISO 230-1; squareness by ISO sign; the frame is fixed by zero error at the origin.");
  write_chain(text, model.chain, model.travel, model.tool);
  text.text("outside", "end values are held");
  write_reversal(text, model.reversal);
  if (model.reference_temperature) {
    text.comment("All else holds at the reference; an axis grows by expansion * (T - reference) * position.");
    text.open("temperature").number("reference", *model.reference_temperature).text("unit", "degC");
    text.numbers("expansion", model.expansion.data(), 3);
    text.numbers("expansion_sigma", model.expansion_sigma.data(), 3);
    text.close();
  }
  write_squareness(text, model.squareness, model.squareness_sigma);
  text.comment("Uniform cubic B-splines over `interval` [m] of the moving axis: intervals + 3 coefficients,");
  text.comment("the standard deviation at each knot.");
  text.open("components");
  for (int c = 0; c < error_motion_count; ++c) {
    if (model.coefficients[index(c)].size() == 0) continue;
    text.open(std::string{metrology::iso_name(c)});
    text.text("unit", is_rotation(c) ? "rad" : "m");
    text.range("interval", model.splines[index(axis_of(c))].interval());
    text.numbers("coefficients", model.coefficients[index(c)]);
    text.numbers("sigma", model.sigma[index(c)]);
    text.close();
  }
  text.close();
  text.comment(
      "Standard deviation of the field [m] at nodes over the travels, x fastest, less rigid motions.");
  text.open("field_sigma");
  for (int k = 0; k < 3; ++k)
    text.integer("nodes_" + metrology::axis_letter(k), model.field_sigma.count[index(k)]);
  for (int k = 0; k < 3; ++k) {
    if (!model.chain.has(k)) continue;
    std::vector<double> values;
    for (const auto& sigma : model.field_sigma.values) values.push_back(sigma[k]);
    text.numbers("sigma_" + metrology::axis_letter(k), values);
  }
  text.close();
}

GeometricModel read_geometric(const config::Node& root) {
  GeometricModel model;
  for (const char* key : {"identified_from", "outside", "identification"}) root[key].accept_all();
  read_chain(root, model.chain, model.travel, model.tool);
  read_reversal(root, model.chain, model.travel, model.reversal);
  if (const config::Node temperature = root["temperature"]; temperature.exists()) {
    model.reference_temperature = temperature.number("reference", "degC", {-50.0, 200.0});
    (void)temperature.choice("unit", {"degC"});
    const auto expansion = exactly(temperature.required("expansion"), 3, "1/K");
    const auto sigma = exactly(temperature.required("expansion_sigma"), 3, "1/K");
    for (std::size_t k = 0; k < 3; ++k) {
      model.expansion[k] = expansion[k];
      model.expansion_sigma[k] = sigma[k];
      if (std::abs(expansion[k]) > 1e-3)
        temperature["expansion"].fault("an expansion beyond 1e-3 1/K", "calibrate again");
    }
  }
  read_squareness(root, model.squareness, model.squareness_sigma);
  const config::Node components = root.required("components");
  for (int c = 0; c < error_motion_count; ++c) {
    const config::Node one = components[metrology::iso_name(c)];
    if (!one.exists()) continue;
    const char* unit = is_rotation(c) ? "rad" : "m";
    if (!model.chain.has(axis_of(c))) {
      one.fault("the chain has no such axis", "remove it");
      continue;
    }
    if (one.text("unit") != unit) one["unit"].fault("a wrong unit", std::string{"it is "} + unit);
    const Range interval = one.required("interval").as_range("m");
    auto values = one.required("coefficients").as_numbers(unit);
    if (values.size() < 4 || values.size() > 10'000) {
      one["coefficients"].fault("holds " + std::to_string(values.size()) + " numbers",
                                "a spline has at least 4");
      continue;
    }
    const Range allowed{-most_translation, most_translation};
    for (double& value : values)
      if (!allowed.contains(value)) {
        one["coefficients"].fault("a coefficient beyond 0.1 m or rad", "calibrate again");
        break;
      }
    const numerics::CubicBSpline spline{interval, static_cast<int>(values.size()) - 3};
    numerics::CubicBSpline& known = model.splines[index(axis_of(c))];
    const bool first = known.intervals() == 1;
    if (first) known = spline;
    if (known.intervals() != spline.intervals() || known.interval().lower != interval.lower ||
        known.interval().upper != interval.upper)
      one.fault("another spline than the axis' other components", "calibrate again");
    const auto sigma = exactly(one.required("sigma"), values.size() - 2, unit);
    model.coefficients[index(c)] =
        Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<long>(values.size()));
    model.sigma[index(c)] = Eigen::Map<const Eigen::VectorXd>(sigma.data(), static_cast<long>(sigma.size()));
  }
  const config::Node grid = root.required("field_sigma");
  std::size_t nodes = 1;
  for (int k = 0; k < 3; ++k) {
    model.field_sigma.count[index(k)] =
        static_cast<int>(grid.integer("nodes_" + metrology::axis_letter(k), 1, 100));
    nodes *= index(model.field_sigma.count[index(k)]);
    if (model.chain.has(k)) model.field_sigma.range[index(k)] = model.travel[index(k)];
  }
  model.field_sigma.values.assign(nodes, Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()));
  for (int k = 0; k < 3; ++k) {
    if (!model.chain.has(k)) continue;
    const auto values = exactly(grid.required("sigma_" + metrology::axis_letter(k)), nodes, "m");
    for (std::size_t i = 0; i < nodes; ++i) model.field_sigma.values[i][k] = values[i];
  }
  return model;
}

GeometricModel load_geometric(const std::filesystem::path& file) {
  const auto yaml = config::Yaml::load(file);
  (void)yaml.root().integer("invar_compensation", 1, 1);
  (void)yaml.root().choice("kind", {"geometric"});
  check_seal(yaml);
  const auto model = read_geometric(yaml.root());
  yaml.finish();
  return model;
}

}  // namespace invar::compensation

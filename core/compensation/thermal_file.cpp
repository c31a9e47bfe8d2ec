#include "core/compensation/thermal_file.hpp"

#include <array>
#include <cstdio>

#include "core/metrology/geometric/error_motions.hpp"

namespace invar::compensation {

using metrology::ThermalError;
using metrology::ThermalTerm;

void write_place(ModelText& text, const ThermalPlace& place) {
  if (place.axis)
    text.text("axis", std::string(1, metrology::axis_letters[static_cast<std::size_t>(*place.axis)]));
  if (place.above == 0) return;
  std::array<char, 16> digits{};
  std::snprintf(digits.data(), digits.size(), "%08x", place.above);
  text.comment("measured while the geometric model of this checksum was active: what that one leaves")
      .text("above", digits.data());
}

ThermalPlace read_place(const config::Node& root) {
  ThermalPlace place;
  if (root.has("axis")) {
    place.axis = metrology::axis_named(root.text("axis"));
    if (!place.axis) root["axis"].fault("is no axis", "write x, y or z");
  }
  if (root.has("above")) place.above = checksum_number(root.text("above"));
  return place;
}

void write_thermal(ModelText& text, const ThermalError& model) {
  text.comment("lengths m, temperatures degC, rates K/s; error = actual minus commanded position")
      .open("range")
      .range("x", model.x)
      .range("temperature", model.temperature)
      .range("heating_rate", model.heating_rate)
      .close()
      .number("lag", model.lag)
      .number("noise", model.noise)
      .comment("how fast the value may leave its end outside the ranges: per m, per K, per K/s")
      .open("slope")
      .number("x", model.slope_x)
      .number("temperature", model.slope_temperature)
      .number("heating_rate", model.slope_rate)
      .close();
  if (!model.zones.empty()) {
    text.comment("further thermistors; slope in m/K").open_list("zones");
    for (const auto& zone : model.zones)
      text.item().text("name", zone.name).range("range", zone.range).number("slope", zone.slope);
    text.close();
  }
  text.open_list("terms");
  for (const ThermalTerm& term : model.terms) {
    text.item().text("factor", name_of(term.factor));
    if (term.factor == metrology::ThermalFactor::zone) text.text("zone", model.zones[term.zone].name);
    text.number("first", term.first)
        .number("spacing", term.spacing)
        .integer("centres", term.weights.rows())
        .numbers("weights", Eigen::VectorXd{term.weights.reshaped()});
    if (term.trend.size() > 0)
      text.comment("times 1, u, 1 - u^2 with u from -1 to 1 over the range of x, for each factor")
          .numbers("trend", Eigen::VectorXd{term.trend.reshaped()});
  }
  text.close().open("sigma");
  const auto& axes = model.sigma_table.axes();
  text.numbers("counts",
               std::vector<double>{static_cast<double>(axes[0].count), static_cast<double>(axes[1].count),
                                   static_cast<double>(axes[2].count)})
      .numbers("values", model.sigma_table.values())
      .close();
}

namespace {

/// A range that may have no width (a temperature that never varied).
Range range_of(const config::Node& node) {
  const auto ends = exactly(node, 2, "1");
  if (ends[1] < ends[0]) node.fault("its upper end lies below its lower one");
  return {ends[0], std::max(ends[0], ends[1])};
}

}  // namespace

ThermalError read_thermal(const config::Node& root) {
  ThermalError model;
  const auto range = root.required("range");
  model.x = range_of(range.required("x"));
  model.temperature = range_of(range.required("temperature"));
  model.heating_rate = range_of(range.required("heating_rate"));
  model.lag = root.number("lag", "s", Range::not_negative());
  model.noise = root.number("noise", "m", Range::not_negative());
  const auto slope = root.required("slope");
  model.slope_x = slope.number("x", "1", Range::not_negative());
  model.slope_temperature = slope.number("temperature", "1", Range::not_negative());
  model.slope_rate = slope.number("heating_rate", "1", Range::not_negative());
  for (const auto& node : root["zones"].children())
    model.zones.push_back({node.text("name"), range_of(node.required("range")),
                           node.number("slope", "1", Range::not_negative())});
  if (model.zones.size() > metrology::most_zones) root["zones"].fault("there are more than 4");
  for (const auto& node : root.required("terms").children()) {
    ThermalTerm term;
    const auto factor = metrology::thermal_factor(node.text("factor"));
    if (!factor) {
      node["factor"].fault("is no factor of a thermal term");
      continue;
    }
    term.factor = *factor;
    if (term.factor == metrology::ThermalFactor::zone) {
      const std::string zone = node.text("zone");
      while (term.zone < model.zones.size() && model.zones[term.zone].name != zone) ++term.zone;
      if (term.zone == model.zones.size()) {
        node["zone"].fault("`" + zone + "` is no zone of this model");
        continue;
      }
    }
    term.first = node.number("first", "m");
    term.spacing = node.number("spacing", "m", Range::positive());
    const auto centres = node.integer("centres", 1, 10'000);
    const int factors = metrology::factor_count(term.factor);
    const auto weights = exactly(node.required("weights"), static_cast<std::size_t>(centres * factors), "m");
    term.weights = Eigen::Map<const Eigen::MatrixXd>(weights.data(), centres, factors);
    if (node.has("trend")) {
      const auto trend =
          exactly(node["trend"], static_cast<std::size_t>(metrology::trend_size * factors), "m");
      term.trend = Eigen::Map<const Eigen::MatrixXd>(trend.data(), metrology::trend_size, factors);
    }
    model.terms.push_back(std::move(term));
  }
  const auto sigma = root.required("sigma");
  const auto counts = exactly(sigma.required("counts"), 3, "1");
  std::array<numerics::GridAxis, 3> axes;
  const std::array<Range, 3> ranges{model.x, model.temperature, model.heating_rate};
  std::size_t total = 1;
  for (std::size_t d = 0; d < 3; ++d) {
    const double count = Range{1.0, 1000.0}.clamp(counts[d]);
    axes[d] = {ranges[d], static_cast<std::size_t>(count)};
    total *= axes[d].count;
  }
  model.sigma_table = numerics::LookupTable<3>{axes, exactly(sigma.required("values"), total, "m")};
  return model;
}

}  // namespace invar::compensation

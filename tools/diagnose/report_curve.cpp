// Words and units of curves without a name.
#include <algorithm>
#include <cmath>

#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"
#include "tools/diagnose/report.hpp"
#include "tools/report/page.hpp"

namespace invar::diagnose {

bool is_multiplied(const physics::Term& term) {
  if (term.curve.knots.empty() || term.with.empty() || term.with == "command") return false;  // added to that
  if (term.info->plant == physics::Plant::equations) return true;
  const auto known = physics::multipliers_of(*term.info);
  return std::find(known.begin(), known.end(), term.with) != known.end();
}

namespace {

/// The output that a place names: `level`, `output.level`.
std::string output_at(const Case& data, const std::string& place) {
  for (const auto& output : data.model.equations.outputs)
    if (physics::place_of_output(data.model.equations, output.name) == place) return output.name;
  return place;
}

}  // namespace

std::string unit_of_curve(const Case& data, const physics::Term& term) {
  using physics::Plant;
  const auto counted = [&](const char* unit) { return physics::counted_unit(data.model, unit); };
  switch (data.model.plant) {
    case Plant::axis:
      if (term.info->site == "force")
        return counted(term.with == "velocity"                                   ? "N s/m"
                       : term.with == "acceleration"                             ? "kg"
                       : term.curve.memory == physics::Curve::Memory::relaxation ? "N/m"
                                                                                 : "N");
      if (term.with == "command") return unit_of_variable(data, "current");
      return term.info->site == "measurement" ? counted("m") : "1";
    case Plant::thermal:
      if (term.with == "power") return "1";
      return term.info->site == "loss" || term.info->site == "exchange" ? "W/K"
             : term.info->site == "storage"                             ? "J/K"
                                                                        : "W";
    case Plant::error_map:
      if (term.with == "temperature") return "m/K";
      return term.with == "position" || (term.with.empty() && term.info->site != "kinematic") ? "1" : "m";
    case Plant::droplet:
      return term.with.empty() ? "m" : "1";
    default: {
      if (data.model.plant == Plant::equations)  // a state's rate counts in the user's own unit
        return term.info->site == "output" ? unit_of_variable(data, output_at(data, term.on)) : "";
      const auto* signal = data.model.signal(term.on);
      if (signal == nullptr || term.with.empty()) return signal != nullptr ? signal->unit : "";
      const bool is_speed = signal->unit == "m/s", by_speed = term.with == "velocity";
      return is_speed == by_speed ? "1" : by_speed ? "s" : "1/s";
    }
  }
}

std::string size_of_curve(const Case& data, const physics::Term& term) {
  const auto& curve = term.curve;
  const auto unit = unit_of_variable(data, curve.over);
  const auto knots = [&](const std::string& of) {
    return report::si(curve.knots.front(), of) + " to " + report::si(curve.knots.back(), of);
  };
  if (curve.memory == physics::Curve::Memory::stop)
    return "hysteresis over " + curve.over + ", elements that slip at " + knots(unit);
  if (curve.memory == physics::Curve::Memory::relaxation)
    return "creep over " + curve.over + ", time constants " + knots("s");
  double top = 0.0;
  for (const double v : curve.values) top = std::max(top, std::abs(v));
  const bool is_product = term.info->plant != physics::Plant::axis && is_multiplied(term);
  std::string text = "a curve over " + curve.over + (is_product ? " in proportion to " + term.with : "") +
                     ", up to " + report::si(top, unit_of_curve(data, term));
  if (curve.period > 0.0) text += ", that comes again every " + report::si(curve.period, unit);
  return text;
}

}  // namespace invar::diagnose

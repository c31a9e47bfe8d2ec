// Words and units of curves without a name.
#include <algorithm>
#include <cmath>

#include "core/base/quantity.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

std::string size_of_curve(const Case& data, const physics::Term& term) {
  const auto& curve = term.curve;
  const auto unit = unit_of_variable(data, curve.over);
  const auto knots = [&](const std::string& of) {
    return si(curve.knots.front(), of) + " to " + si(curve.knots.back(), of);
  };
  if (curve.memory == physics::Curve::Memory::stop)
    return "hysteresis over " + curve.over + ", elements that slip at " + knots(unit);
  if (curve.memory == physics::Curve::Memory::relaxation)
    return "creep over " + curve.over + ", time constants " + knots("s");
  double top = 0.0;
  for (const double v : curve.values) top = std::max(top, std::abs(v));
  const bool is_product = term.info->plant != physics::Plant::axis && is_multiplied(term);
  std::string text = "a curve over " + curve.over + (is_product ? " in proportion to " + term.with : "") +
                     ", up to " + si(top, unit_of_curve(data, term));
  if (curve.period > 0.0) text += ", that comes again every " + si(curve.period, unit);
  return text;
}

}  // namespace invar::diagnosis

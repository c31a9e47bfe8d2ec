#include "core/physics/expression_units.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

#include "core/base/unit.hpp"
#include "core/physics/expression.hpp"

namespace invar::physics {

namespace {

using Operation = Expressions::Operation;

/// What is known of a slot: its unit, the names that it is made of, and its value where it is a number.
struct Known {
  std::optional<Unit> unit;
  std::set<std::string> names;
  std::optional<double> value;
};

bool is_known(const Known& a) { return a.unit.has_value(); }

Unit power_of(const Unit& base, double exponent) {
  Unit unit;
  for (std::size_t i = 0; i < unit.dimension.size(); ++i) unit.dimension[i] = exponent * base.dimension[i];
  unit.factor = std::pow(base.factor, exponent);
  return unit;
}

Unit product(const Unit& a, const Unit& b, double power) {
  Unit unit = power_of(b, power);
  for (std::size_t i = 0; i < unit.dimension.size(); ++i) unit.dimension[i] += a.dimension[i];
  unit.factor *= a.factor;
  return unit;
}

/// Counts are pure numbers here, as angles are for every unit.
Unit without_counts(Unit unit) {
  unit.dimension.back() = 0.0;
  unit.offset = 0.0;
  return unit;
}

/// How two units go apart; nothing where they are one.
std::optional<UnitClash> difference(const Unit& a, const Unit& b) {
  if (!a.same_quantity(b)) return UnitClash{"measures something else than", false};
  const double ratio = a.factor / b.factor;
  if (std::abs(ratio - 1.0) < 1e-6) return std::nullopt;
  char text[64];
  std::snprintf(text, sizeof text, "counts in %g of the unit of", ratio);
  return UnitClash{text, true};
}

/// One formula, from its names to its value.
class Reader {
 public:
  Reader(const UnitsOfNames& units, const std::vector<std::string>& names)
      : units_{units}, expressions_{{}, names} {
    for (const auto& name : names) {
      Known known{std::nullopt, {name}, std::nullopt};
      if (const auto at = units.find(name); at != units.end()) known.unit = without_counts(at->second.unit);
      slots_.push_back(known);
    }
  }

  std::optional<UnitClash> clash(const std::string& formula, const std::optional<NamedUnit>& result) {
    const auto value = expressions_.add(Expressions::rates, formula, "");
    for (auto slot = slots_.size(); slot < expressions_.slots(); ++slot)
      slots_.push_back({std::nullopt, {}, expressions_.start()[slot]});
    for (const auto& step : expressions_.code(Expressions::fixed)) {
      slots_[step.to] = of(step);
      if (clash_) return clash_;
    }
    const auto& whole = slots_[value];
    if (result && is_known(whole))
      if (const auto apart = difference(*whole.unit, without_counts(result->unit)))
        return UnitClash{list(whole) + " " + apart->what + " " + result->text, apart->is_size};
    return std::nullopt;
  }

 private:
  [[nodiscard]] std::string list(const Known& known) const {
    std::string all;
    for (const auto& name : known.names) {
      const auto at = units_.find(name);
      all +=
          (all.empty() ? "`" : ", `") + name + "`" + (at != units_.end() ? " [" + at->second.text + "]" : "");
    }
    return known.names.size() > 1 ? "the combination of " + all : all;
  }

  /// Both must be one; the unit of either.
  std::optional<Unit> one_of(const Known& a, const Known& b) {
    if (!is_known(a)) return b.unit;
    if (is_known(b))
      if (const auto apart = difference(*a.unit, *b.unit))
        clash_ = {list(a) + " " + apart->what + " " + list(b) + ", beside which it stands", apart->is_size};
    return a.unit;
  }

  /// What takes a pure number, or an angle in rad.
  void expect_pure(const Known& a, const char* taker) {
    if (!is_known(a)) return;
    if (const auto apart = difference(*a.unit, Unit{}))
      clash_ = {list(a) + " " + apart->what + " " + taker, apart->is_size};
  }

  Known of(const Expressions::Instruction& step) {
    const Known &a = slots_[step.a], &b = slots_[step.b], &c = slots_[step.c];
    Known made{std::nullopt, a.names, std::nullopt};
    made.names.insert(b.names.begin(), b.names.end());
    made.names.insert(c.names.begin(), c.names.end());
    switch (step.operation) {
      case Operation::add:
      case Operation::subtract:
      case Operation::least:
      case Operation::most:
        made.unit = one_of(a, b);
        if (made.unit && !is_known(a)) made.names = b.names;  // they alone say what it counts in
        if (made.unit && !is_known(b)) made.names = a.names;
        break;
      case Operation::choose:
        made.unit = one_of(b, c);
        break;
      case Operation::less:
      case Operation::greater:
      case Operation::at_most:
      case Operation::at_least:
      case Operation::equal:
      case Operation::differs:
        (void)one_of(a, b);
        made.unit = Unit{};
        break;
      case Operation::both:
      case Operation::either:
      case Operation::sign:
        made.unit = Unit{};
        break;
      case Operation::multiply:
      case Operation::divide:
        if (is_known(a) && is_known(b))
          made.unit = product(*a.unit, *b.unit, step.operation == Operation::multiply ? 1.0 : -1.0);
        break;
      case Operation::power:
        if (b.value && is_known(a))
          made.unit = power_of(*a.unit, *b.value);
        else if (!b.names.empty())
          expect_pure(b, "a pure number, as an exponent is");
        break;
      case Operation::root:
        if (is_known(a)) made.unit = power_of(*a.unit, 0.5);
        break;
      case Operation::negate:
        made.unit = a.unit;
        if (a.value) made.value = -*a.value;
        break;
      case Operation::absolute:
        made.unit = a.unit;
        break;
      case Operation::sine:
      case Operation::cosine:
      case Operation::tangent:
        expect_pure(a, "an angle in rad");
        made.unit = Unit{};
        break;
      case Operation::sinh:
      case Operation::cosh:
      case Operation::tanh:
      case Operation::exponential:
        expect_pure(a, "the pure number that exp and its kin take");
        made.unit = Unit{};
        break;
      case Operation::arc_sine:
      case Operation::arc_cosine:
      case Operation::arc_tangent:
        expect_pure(a, "the pure number that an angle is of");
        made.unit = Unit{};
        break;
      case Operation::logarithm:
      case Operation::logarithm_2:
      case Operation::logarithm_10:
        made.unit = Unit{};  // of a ratio to one of the unit
        break;
    }
    return made;
  }

  const UnitsOfNames& units_;
  Expressions expressions_;
  std::vector<Known> slots_;
  std::optional<UnitClash> clash_;
};

}  // namespace

std::optional<UnitClash> clash_of_units(const std::string& formula, const UnitsOfNames& units,
                                        const std::vector<std::string>& names,
                                        const std::optional<NamedUnit>& result) {
  return Reader{units, names}.clash(formula, result);
}

}  // namespace invar::physics

#include "core/modbus/contract.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "core/base/unit.hpp"

namespace invar::modbus {

namespace {

/// From SI to the unit that the map is written in.
Conversion conversion_from_si(const std::string& unit) {
  const Unit to = parse_unit(unit).value_or(Unit{});
  return {1.0 / to.factor, -to.offset / to.factor};
}

std::string named(const RegisterNeed& need) { return "`" + need.name + "` [" + need.unit + "]"; }

/// Bounds that were converted may have lost their last digit.
bool contains_all(Range range, Range values) {
  const double slack = 1e-9 * std::max(std::abs(range.lower), std::abs(range.upper));
  return values.lower >= range.lower - slack && values.upper <= range.upper + slack;
}

}  // namespace

std::string RegisterNeed::need_word() const {
  if (need == Need::either) return "one of these";
  return need == Need::needed ? "needed" : "optional";
}

bool RegisterNeed::takes_unit(const std::string& other) const {
  if (unit == "flag") return conversion(other, "1").has_value();
  std::string rest = unit;
  for (;;) {
    const auto next = rest.find(" or ");
    if (conversion(other, rest.substr(0, next))) return true;
    if (next == std::string::npos) return false;
    rest.erase(0, next + 4);
  }
}

/// Whether the map has it; one that is there and wrong is a fault.
bool MapCheck::suits(const RegisterNeed& need) {
  const auto index = map_.find(need.name);
  if (!index) return false;
  const Register& reg = map_.registers[*index];
  const std::string is = "register `" + need.name + "`";
  if (!need.takes_unit(reg.unit))
    fault(key_,
          is + (need.unit == "flag"
                    ? " is in `" + reg.unit + "`, and is needed as a flag"
                    : " is in `" + reg.unit + "`, and is needed in a unit like `" + need.unit + "`"),
          "correct the register's `unit` in the map");
  if (need.access == RegisterNeed::Access::write && !reg.writable)
    fault(key_, is + " cannot be written", "give it `access: read_write` in the map");
  if (need.access == RegisterNeed::Access::read && !reg.readable)
    fault(key_, is + " cannot be read", "give it `access: read` in the map");
  return true;
}

void MapCheck::fits(const RegisterContract& contract) {
  for (auto row = contract.begin(); row != contract.end();) {
    const bool either = row->need == RegisterNeed::Need::either;
    bool found = row->need == RegisterNeed::Need::optional;
    std::string names;
    do {
      found = suits(*row) || found;
      names += (names.empty() ? "" : " or ") + named(*row);
      ++row;
    } while (either && row != contract.end() && row->need == RegisterNeed::Need::either);
    if (!found) missing_ += (missing_.empty() ? "" : ", ") + names;
  }
}

void MapCheck::takes(const std::string& name, Range values, const std::string& key) {
  const auto index = map_.find(name);
  if (!index) return;
  const Register& reg = map_.registers[*index];
  if (contains_all(reg.range, values)) return;
  const double asked = contains_all(reg.range, {values.upper, values.upper}) ? values.lower : values.upper;
  const Conversion shown = conversion_from_si(reg.unit);
  std::ostringstream what;
  what << "asks register `" << name << "` for " << shown(asked) << " " << reg.unit
       << ", and the map's range is " << shown(reg.range.lower) << " to " << shown(reg.range.upper);
  fault(key, what.str(), "stay inside, or correct the register's `range` if the device takes more");
}

void MapCheck::lets_go(const std::vector<std::string>& registers) {
  std::string names;
  for (const std::string& name : registers) {
    const auto index = map_.find(name);
    if (!index) continue;
    for (const CommLoss::Set& set : map_.comm_loss.set)
      if (set.reg == *index && set.value == 0.0) return;
    names += (names.empty() ? "`" : " or `") + name + "`";
  }
  if (names.empty()) return;
  fault(key_, "does not switch the device off when its master is lost",
        "set " + names + " to 0 under `comm_loss.set` of the map");
}

void MapCheck::fault(const std::string& key, const std::string& what, const std::string& mend) {
  faults_.push_back({key, what, mend});
}

void MapCheck::finish() {
  if (!missing_.empty())
    faults_.insert(faults_.begin(), {key_, "has no register " + missing_,
                                     "add what is missing (`invar types` says what each is), or name a " +
                                         device_ + "'s register map"});
  if (!faults_.empty()) throw InputError{std::move(faults_)};
}

}  // namespace invar::modbus

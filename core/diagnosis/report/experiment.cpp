// What to record next, so that it tells what this recording does not.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/base/quantity.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/library.hpp"
#include "core/physics/temperatures.hpp"

namespace invar::diagnosis {

namespace {

/// The experiment that the file of the one term names for the other; null: none.
const char* told_apart(const physics::TermInfo& one, const physics::TermInfo& other) {
  for (const auto& pair : one.told_apart)
    if (pair.from == other.name) return pair.experiment;
  return nullptr;
}

/// How to find out whether an effect goes with this variable.
std::string varied(const std::string& variable) {
  if (variable == "time" || variable == "t")
    return "record the same motion twice, the second time after a pause";
  if (variable == "history" || variable == "frequency")
    return "record with long steps, each held until all is at rest, and then with quick changes";
  if (variable == "direction") return "cross the same places in both directions";
  if (variable == "image") return "print the same target in the middle and in the corners of the image";
  return "record with " + variable + " varied on its own and all else held";
}

/// The first of `one` that is not among `other`, what can be commanded before what cannot.
std::string only_in(const std::vector<std::string>& one, const std::vector<std::string>& other) {
  std::string first;
  for (const auto& variable : one)
    if (std::find(other.begin(), other.end(), variable) == other.end() && variable != "acceleration" &&
        (first.empty() || first == "history" || first == "frequency"))
      first = variable;
  return first;
}

}  // namespace

std::string separating_experiment(const Case& data, const physics::Term& at, const physics::Term& beside) {
  if (at.info == beside.info && data.model.plant == physics::Plant::error_map)
    return varied(std::string{physics::temperature_of(at)}) + ", and the other way round";
  if (at.info == beside.info && at.on == beside.on && at.with != beside.with)
    return varied(at.with.empty() ? beside.with : at.with);
  if (at.info == beside.info)
    return "record with one instrument more, between the " + place_of(data, at) + " and the " +
           place_of(data, beside) + ": it shows the effect of the one and not that of the other";
  if (const char* known = told_apart(*at.info, *beside.info)) return known;
  if (const char* known = told_apart(*beside.info, *at.info)) return known;
  const auto one = at.info->name, other = beside.info->name;
  const auto of_one = dependence(data, at), of_other = dependence(data, beside);
  for (const bool turned : {false, true}) {
    const auto variable = turned ? only_in(of_other, of_one) : only_in(of_one, of_other);
    if (variable.empty()) continue;
    return varied(variable) + ": " + readable(turned ? other : one) + " goes with it, " +
           readable(turned ? one : other) + " does not";
  }
  const auto shared = of_one.empty() ? std::string{"the excitation"} : of_one.front();
  return "record with " + shared + " at a third and at three times of its size: " + readable(one) + " and " +
         readable(other) + " grow with it in different ways";
}

namespace {

/// "1000 times what was believed, as of a prefix": by what a number is off where units are mistaken; else nothing.
std::string like_a_slip(double ratio) {
  constexpr double pi = std::numbers::pi;
  struct Slip {
    double ratio;
    const char* of;
  };
  constexpr std::array slips{Slip{100.0, "cm and m, or % and 1"},
                             Slip{1e3, "a prefix"},
                             Slip{1e6, "a prefix"},
                             Slip{60.0, "s and min"},
                             Slip{3600.0, "s and h"},
                             Slip{2.0 * pi, "turns and rad"},
                             Slip{180.0 / pi, "rad and deg"},
                             Slip{30.0 / pi, "rpm and rad/s"}};
  if (std::abs(ratio + 1.0) < 0.1) return "as of a sign";
  for (const auto& slip : slips)
    for (const bool is_part : {false, true})
      if (std::abs(ratio * (is_part ? slip.ratio : 1.0 / slip.ratio) - 1.0) < 0.05)
        return std::string{"as of "} + slip.of;
  return "";
}

/// Before anything is measured: columns that do not stand beside one another, and a number far from what was believed, are
/// first of all slips in a file.
std::string look_at_numbers(const Case& data, const Diagnosis& d) {
  if (!data.moved.empty()) return "First look at how the columns were put together. ";
  if (d.unexplained >= thresholds::slip_unless_left) return "";
  std::string text;
  for (const auto& one : moved_numbers(d, thresholds::far_moved)) {
    const auto slip = one.believed != 0.0 ? like_a_slip(one.value / one.believed) : std::string{};
    text += (text.empty() ? "" : ", ") + one.name +
            (slip.empty() ? "" : " (" + number(one.value / one.believed, 4) + " of it, " + slip + ")");
  }
  return text.empty()
             ? text
             : "First look at the value, unit, sign and sigma that the model's file gives for " + text + ". ";
}

std::string experiment_of(const Case& data, const Diagnosis& d) {
  if (d.is_partial)
    return d.budget > 0.0 ? "Run it again with a longer --budget." : "Let the diagnosis run to its end.";
  if (d.off_law && d.off_law->is_chief())
    return "Compare the controller block of the model's file with the drive: gains and their units, filter, "
           "rate, and the signal that is differentiated. The comments of invar diagnose --example axis give "
           "the control law.";
  std::string apart;
  for (const auto& finding : d.findings)
    for (const auto& a : finding.alternatives)
      if (a.explains_as_well())
        apart += (apart.empty() ? "To tell " : " To tell ") +
                 readable(name_beside(data, finding.term, a.term)) + " from " +
                 readable(name_beside(data, a.term, finding.term)) + ": " +
                 separating_experiment(data, finding.term, a.term) + ".";
  if (!apart.empty()) return apart;
  if (!d.findings.empty() && d.findings.back().term.curve.memory != physics::Curve::Memory::none)
    return "Record the same way at two speeds, with long rests between: hysteresis knows neither, and what "
           "creeps "
           "goes on in the rests.";
  const auto over = [&]() -> std::string {
    if (!d.findings.empty() && !d.findings.back().term.curve.over.empty())
      return d.findings.back().term.curve.over;
    return d.unexplained_over.empty() ? "" : d.unexplained_over.front();
  }();
  switch (d.verdict) {
    case Verdict::unknown_physics:
    case Verdict::partly_explained:
      if (over == "time" || over == "t")
        return "Record the same motion again: what has no name yet goes with time, so see whether it comes "
               "back.";
      if (over == "history")
        return "Record again with one input alone in steps, each held until all is at rest, and then in "
               "quick changes. The part without a name depends on the past; this shows for how long.";
      return "Record again with " + (over.empty() ? "one input" : over) +
             " varied on its own and all else held: what has no name yet goes with it, or with something "
             "that "
             "moved beside it.";
    case Verdict::no_mismatch:
      return "None is needed. An effect smaller than those listed as detectable would take a longer or a "
             "livelier recording.";
    case Verdict::parameters_only:
      return "Measure the parameter that moved on its own, or take over patched.yaml.";
    default:
      if (std::any_of(d.other_runs.begin(), d.other_runs.end(),
                      [&](const OtherRun& run) { return !worse_on(d, run).empty(); }))
        return "Do not take patched.yaml over yet: give all recordings together (--recording), so that one "
               "model has to explain them.";
      return (d.other_runs.empty()
                  ? std::string{"Simulate patched.yaml on a recording that was not used here (--check)"}
                  : std::string{"Take patched.yaml over: it does well on the other recording too"}) +
             (data.model.plant == physics::Plant::axis
                  ? "; then give it to the running stage (invar job apply)."
              : data.model.plant == physics::Plant::error_map
                  ? "; then give it to the running compensation (invar job apply)."
                  : ".");
  }
}

}  // namespace

std::string next_experiment(const Case& data, const Diagnosis& d) {
  if (d.is_partial || (d.off_law && d.off_law->is_chief())) return experiment_of(data, d);
  return look_at_numbers(data, d) + experiment_of(data, d);
}

}  // namespace invar::diagnosis

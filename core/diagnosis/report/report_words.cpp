// What the diagnosis says, in words that page and terminal share.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/quantity.hpp"
#include "core/diagnosis/dataset/shorten.hpp"
#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/evidence/odds.hpp"
#include "core/diagnosis/report/report.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/physics/counted_units.hpp"
#include "core/physics/equations_columns.hpp"
#include "core/physics/library.hpp"

namespace invar::diagnosis {

std::vector<std::string> dependence(const Case& data, const Finding& finding) {
  auto term = finding.term;
  if (finding.stand_in != nullptr) term.info = finding.stand_in;
  return dependence(data, term);
}

std::string title_of(const Finding& finding) {
  const auto& term = finding.term;
  if (term.info->is_curve) return "an effect without a name";
  const auto title = readable(term.info->name);
  if (term.info->plant != physics::Plant::equations) return title;
  // A law's name alone says nothing of a machine.
  if (term.info->joined_by.empty()) return title;
  return title + " " + std::string{term.info->joined_by} + " " + physics::goes_over(term);
}

namespace {

/// "2.4", "770": a ratio as one says it.
std::string times(double ratio) {
  return ratio >= 10.0 && ratio < 1e6 ? std::to_string(std::lround(ratio)) : number(ratio, 2);
}

/// What stands for a cause that has no name, and why it is not the name.
std::string nearest_of(const Diagnosis& d, const Finding& finding) {
  const double left = most_over_noise(d);
  return readable(finding.stand_in->name) + " fits best, but " +
         (left > thresholds::times_noise ? "leaves " + times(left) + " times the noise"
                                         : "another cause is likelier");
}

}  // namespace

std::string description_of(const Diagnosis& d, const Finding& finding) {
  if (finding.stand_in == nullptr) return std::string{finding.term.info->description};
  return "Nearest known term: " + nearest_of(d, finding) + "; patched.yaml has it. " +
         std::string{finding.stand_in->description};
}

std::string sizes_of(const Case& data, const Diagnosis& d, const Finding& finding) {
  const auto& info = *finding.term.info;
  if (finding.stand_in != nullptr) return nearest_of(d, finding) + "; patched.yaml has it";
  std::string text;
  for (std::size_t i = 0; i < info.parameter_count(); ++i)
    text += (i == 0 ? "" : ", ") + readable(info.parameters[i].name) + " " +
            with_sigma(finding.term.values[i], finding.sigmas[i], unit_of(data, finding.term, i));
  if (!finding.term.curve.knots.empty())
    text += (text.empty() ? "" : ", ") + size_of_curve(data, finding.term);
  return text;
}

namespace {

std::string of_a_cell(const DataCount& count) {
  std::string text;
  if (count.before_standstill > 0)
    text =
        std::to_string(count.before_standstill) +
        " rows at the beginning are left out: the loop ran before the recording did, and what its controller "
        "remembers is known where the axis stands still alone";
  if (count.behind_rest > 0)
    text += (text.empty() ? "" : "; ") + std::to_string(count.behind_rest) +
            " rows at the end are left out: half a second behind the last motion an axis that stands says no "
            "more";
  return text;
}

}  // namespace

std::string rows_read(const DataCount& count) {
  struct Part {
    std::size_t count;
    const char* one;
    const char* more;
  };
  const auto listed = [](std::initializer_list<Part> parts) {
    std::string text;
    for (const auto& part : parts)
      if (part.count > 0)
        text += (text.empty() ? "" : ", ") + std::to_string(part.count) +
                (part.count == 1 ? part.one : part.more);
    return text;
  };
  const auto left_out = listed({{count.missing, " missing value", " missing values"},
                                {count.outliers, " outlier", " outliers"},
                                {count.duplicates, " repeated row", " repeated rows"}});
  const auto changed = listed({{count.out_of_order, " row put in order", " rows put in order"},
                               {count.gaps, " gap bridged", " gaps bridged"}});
  return std::to_string(count.rows) + " rows read" + (left_out.empty() ? "" : "; left out: " + left_out) +
         (changed.empty() ? "" : "; " + changed);
}

std::string what_was_looked_at(const Case& data) {
  std::string cut = of_a_cell(data.count);
  if (const auto windows = how_windowed(data); !windows.empty()) cut += (cut.empty() ? "" : "; ") + windows;
  if (data.quiet_rows > 0)
    cut +=
        (cut.empty() ? "" : "; ") +
        std::string{"the inputs as recorded carry noise that the machine did not feel: their median over "} +
        std::to_string(data.quiet_rows) + " rows stands in their place";
  if (const auto lone = data.count.lone_inputs; lone > 0)
    cut += (cut.empty() ? "" : "; ") +
           (lone == 1 ? std::string{"one input value"} : std::to_string(lone) + " input values") +
           " far beyond all others, which the machine did not feel, " + (lone == 1 ? "is" : "are") +
           " left out";
  for (const auto& one : data.taken_in_si)
    cut += (cut.empty() ? "`" : "; `") + one.column + "` in " + one.unit + " is taken in SI, times " +
           number(one.factor, 4);
  if (data.count.left_to_chance > 0)
    cut += (cut.empty() ? "in " : "; in ") + std::to_string(data.count.left_to_chance) +
           " rows noise decides when the carriage sticks and slips: they are not judged";
  if (data.count.shortened == 0) return cut;
  return (cut.empty() ? "" : cut + "; ") + "a long recording: of " + std::to_string(data.count.rows) +
         " rows " + how_shortened(data.model) + " looked at, " + std::to_string(data.count.shortened) +
         " are not run through";
}

namespace {

std::string listed(const std::vector<MovedNumber>& moved) {
  std::string text;
  for (const auto& one : moved)
    text += (text.empty() ? "" : ", ") + one.name + " is " + si(one.value, one.unit, 4) + ", not " +
            si(one.believed, one.unit, 4) + " (" + times(one.sigmas) + " sigma of what was believed)";
  return text;
}

}  // namespace

std::vector<MovedNumber> moved_numbers(const Diagnosis& d, double least) {
  std::vector<MovedNumber> moved;
  for (const auto& f : d.best.free) {
    if (f.where == Freedom::Where::curve || !(f.sigma > 0.0)) continue;
    if (f.where == Freedom::Where::parameter && is_start(d.best.model.parameters[f.index])) continue;
    const double to = get(d.best.model, f), sigmas = std::abs(to - f.center) / f.sigma;
    if (!(sigmas > least)) continue;
    if (f.where == Freedom::Where::parameter) {
      const auto& own = d.best.model.parameters[f.index];
      moved.push_back({own.name, own.unit, to, f.center, sigmas});
    } else {
      const auto& info = *d.best.model.terms[f.term].info;
      const auto& p = info.parameters[f.index];
      moved.push_back(
          {readable(info.name) + (p.name == info.name ? "" : " " + std::string{p.name}),
           p.unit == "*" ? "" : physics::unit_of_parameter(d.best.model, d.best.model.terms[f.term], f.index),
           to, f.center, sigmas});
    }
  }
  return moved;
}

std::string beside_the_verdict(const Case& data, const Diagnosis& d) {
  const auto moved = d.findings.empty() ? std::string{} : listed(moved_numbers(d, thresholds::far_moved));
  std::string text;
  if (!moved.empty()) text = (d.findings.size() == 1 ? "with it " : "with them ") + moved;
  if (d.unexplained >= thresholds::much_left)
    text += (text.empty() ? "" : "; ") + std::string{"what remains is "} + times(d.unexplained) +
            " times the noise";
  if (d.off_law && d.off_law->is_beside())
    text += (text.empty() ? "" : "; ") + std::string{"the recorded current is "} + si(d.off_law->off, "A") +
            " RMS off what the controller makes of the recorded reference and position (" +
            number(100.0 * d.off_law->share, 2) + " % of the mismatch): look at the controller block";
  for (const auto& doubt : data.doubts) text += (text.empty() ? "" : "; ") + doubt;
  for (std::size_t o = 0; o < d.heldout.size(); ++o)
    if (const auto& row = d.heldout[o];
        row.after > 0.0 && data.given_noise[o] > thresholds::noise_overstated * row.after)
      text += (text.empty() ? "" : "; ") + std::string{"the noise of `"} + row.signal + "` is stated as " +
              si(data.given_noise[o], row.unit) + ", yet no more than " + si(row.after, row.unit) +
              " is left: look at its unit";
  const std::size_t values = data.count.rows * data.outputs.size();
  if (data.count.outliers > 0 && thresholds::one_in_outliers * data.count.outliers >= values)
    text +=
        (text.empty() ? "" : "; ") + std::to_string(data.count.outliers) + " of " + std::to_string(values) +
        " readings are left out as outliers, far more than slips of an instrument: look at what was recorded";
  return text.empty() ? text : "Mind: " + text + ".";
}

namespace {

/// Where else in the chain a finding may act as well.
std::string elsewhere(const Case& data, const Diagnosis& d) {
  std::string places;
  for (const auto& f : d.findings)
    for (const auto& a : f.alternatives)
      if (a.explains_as_well() && is_elsewhere(f.term, a.term))
        places += (places.empty() ? ", or the same at the " : " or the ") + place_of(data, a.term);
  return places;
}

}  // namespace

std::string why_ended(const Diagnosis& d) {
  return d.budget > 0.0 ? "The budget of " + number(d.budget) + " s ended" : "Stopped";
}

std::string not_tried(const Diagnosis& d) {
  std::string text;
  for (const auto& one : d.not_tried) text += (text.empty() ? "not tried: " : "; ") + one;
  return text;
}

namespace {

/// So far as it went: what was found until then.
std::string sentence_of_part(const Case& data, const Diagnosis& d) {
  const std::string ended = why_ended(d) + " before all was tried";
  if (d.findings.empty() && d.verdict == Verdict::unknown_physics)
    return "Not finished. " + ended + "; something is missing, as " + times(most_over_noise(d)) +
           " times the noise is left, and nothing named it until then.";
  if (d.findings.empty())
    return "Not finished, nothing can be said. " + ended +
           "; nothing was found until then, which does not say that nothing is missing.";
  auto whole = d;
  whole.is_partial = false;
  const bool has_rival = std::any_of(d.findings.begin(), d.findings.end(), [](const Finding& f) {
    return std::any_of(f.alternatives.begin(), f.alternatives.end(),
                       [](const Alternative& a) { return a.explains_as_well(); });
  });
  if (whole.verdict == Verdict::ambiguous && !has_rival) whole.verdict = Verdict::explained;
  return "Not finished. " + ended +
         ", and rivals may not have been weighed; so far: " + verdict_sentence(data, whole);
}

std::string names_of_findings(const Case& data, const Diagnosis& d) {
  std::string names;
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    const auto& finding = d.findings[i];
    names += (i == 0 ? "" : (i + 1 == d.findings.size() ? " and " : ", ")) + title_of(finding) + " (" +
             place_of(data, finding.term) + ")";
  }
  return names;
}

std::string names_of_rivals(const Case& data, const Diagnosis& d) {
  std::string also;
  for (const auto& f : d.findings)
    for (const auto& a : f.alternatives)
      if (a.explains_as_well())
        also +=
            (also.empty() ? "" : ", ") + readable(a.term.info->name) + " (" + place_of(data, a.term) + ")";
  return also;
}

std::string sentence_of_unknown(const Case& data, const Diagnosis& d) {
  if (d.off_law && d.off_law->is_chief())
    return "Unknown physics: the recorded current is not what the model's controller makes of the recorded "
           "reference and position. The part that goes with the motion differs by " +
           si(d.off_law->off, "A") + " RMS, and the current moves by " + si(d.off_law->all, "A") +
           ". Nothing behind the loop is judged.";
  if (d.findings.empty())
    return "Unknown physics: what the model leaves over follows what was recorded and its past, and neither "
           "a known term nor a curve describes it" +
           (d.suspect && !d.suspect->place.empty() ? "; it looks most like the " + d.suspect->place
                                                   : std::string{}) +
           ".";
  const auto& first = d.findings.front();
  if (first.stand_in != nullptr) {
    std::string places;
    for (const auto& f : d.findings)
      if (const auto place = place_of(data, f.term); places.find(place) == std::string::npos)
        places += (places.empty() ? "" : " and the ") + place;
    return "Unknown physics: something is missing, most likely at the " + places +
           ". Nearest known term: " + nearest_of(d, first) + ".";
  }
  return "Unknown physics: something is missing at the " + place_of(data, first.term) + " (" +
         site_of(data, first.term) + ") that goes with " +
         (first.term.curve.memory != physics::Curve::Memory::none ? "the history of " : "") +
         first.term.curve.over + (is_multiplied(first.term) ? " and " + first.term.with : "") +
         ", and no known term describes it.";
}

/// Does the model as it was given leave plainly more than the same model with its numbers fitted?
bool needs_other_numbers(const Diagnosis& d) {
  return std::any_of(d.heldout.begin(), d.heldout.end(), [](const FitRow& row) {
    return row.before > thresholds::worse_by_chance * row.retuned;
  });
}

}  // namespace

std::string verdict_sentence(const Case& data, const Diagnosis& d) {
  if (d.is_partial) return sentence_of_part(data, d);
  const std::string names = names_of_findings(data, d);
  switch (d.verdict) {
    case Verdict::no_mismatch:
      return "No mismatch: " +
             std::string{needs_other_numbers(d) ? "with its numbers fitted within what was believed, the"
                                                : "the"} +
             " model explains the recording to " +
             (d.unexplained >= 1.5 ? times(d.unexplained) + " times " : std::string{}) + "the noise.";
    case Verdict::parameters_only:
      return "Only parameters are off, no physics is missing: " + listed(moved_numbers(d, 3.0)) + ".";
    case Verdict::explained:
      return "Explained: the model leaves out " + names + elsewhere(data, d) + ".";
    case Verdict::partly_explained:
      return "Partly explained: the model leaves out " + names + elsewhere(data, d) + ", and something more.";
    case Verdict::ambiguous:
      return "Ambiguous: the recording shows " + names + ", but cannot tell it from " +
             names_of_rivals(data, d) + ".";
    case Verdict::unknown_physics:
      return sentence_of_unknown(data, d);
  }
  return "";
}

}  // namespace invar::diagnosis

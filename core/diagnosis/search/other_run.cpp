#include "core/diagnosis/search/other_run.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/dataset/variables.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/evidence/form.hpp"
#include "core/diagnosis/search/handed_over.hpp"
#include "core/diagnosis/segments/windows.hpp"
#include "core/diagnosis/thresholds.hpp"
#include "core/model/record_file.hpp"
#include "core/model/recording_file.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::diagnosis {

namespace {

std::size_t count(const std::vector<double>& values) {
  return static_cast<std::size_t>(
      std::count_if(values.begin(), values.end(), [](double v) { return std::isfinite(v); }));
}

/// measured - simulated of all outputs that are compared, each over the spread of what was measured.
Eigen::VectorXd differences(const OtherRun& run, const physics::Outputs& simulated) {
  std::vector<double> all;
  for (std::size_t o = 0; o < simulated.size(); ++o) {
    if (count(run.measured[o]) < thresholds::values_to_compare) continue;
    std::vector<double> values = run.measured[o];
    std::erase_if(values, [](double v) { return !std::isfinite(v); });
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const double spread = *high > *low ? *high - *low : 1.0;
    for (std::size_t i = 0; i < simulated[o].size(); ++i)
      if (std::isfinite(run.measured[o][i])) all.push_back((run.measured[o][i] - simulated[o][i]) / spread);
  }
  return Eigen::Map<Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
}

physics::Outputs simulated(const physics::Model& model, const physics::Record& inputs) {
  physics::Outputs outputs;
  physics::prepare(model, inputs)->run(model, outputs);
  return outputs;
}

/// The run from the initial state that brings this model nearest.
physics::Outputs from_best_start(const physics::Model& model, const OtherRun& run) {
  auto inputs = run.inputs;
  std::vector<double*> start;
  for (const auto& name : model.outputs())
    if (auto at = inputs.signals.find(name); at != inputs.signals.end() && std::isfinite(at->second.front()))
      start.push_back(&at->second.front());
  auto best = simulated(model, inputs);
  for (int step = 0; step < 5 && !start.empty(); ++step) {
    const auto from = differences(run, best);
    Eigen::MatrixXd slope(from.size(), static_cast<Eigen::Index>(start.size()));
    for (std::size_t k = 0; k < start.size(); ++k) {
      const double value = *start[k], by = 1e-3 * std::max(1.0, std::abs(value));
      *start[k] = value + by;
      slope.col(static_cast<Eigen::Index>(k)) = (differences(run, simulated(model, inputs)) - from) / by;
      *start[k] = value;
    }
    const Eigen::VectorXd change = numerics::least_squares(slope, -from);
    if (!change.allFinite()) break;
    std::vector<double> before;
    for (std::size_t k = 0; k < start.size(); ++k) {
      before.push_back(*start[k]);
      *start[k] += change(static_cast<Eigen::Index>(k));
    }
    auto next = simulated(model, inputs);
    if (!(differences(run, next).squaredNorm() < from.squaredNorm())) {
      for (std::size_t k = 0; k < start.size(); ++k) *start[k] = before[k];
      break;
    }
    best = std::move(next);
  }
  return best;
}

}  // namespace

OtherRun read_other_run(const physics::Model& model, const OtherRunFiles& files) {
  OtherRun run;
  run.name = files.inputs.filename().string();
  run.fits_start = files.fits_start;
  const bool has_own = !files.outputs.empty();
  const auto table = model::read_recording(files.inputs, model).front();
  run.inputs = model::to_record(table, model, !has_own).record;
  model::check_order(model, run.inputs, files.inputs);
  auto compared = table;
  if (has_own) {
    const auto own = recording::Table::read_columns(files.outputs, model::columns_of(model));
    if (own.rows() != table.rows())
      throw InputError{
          files.outputs.string(),
          "has " + std::to_string(own.rows()) + " rows, " + run.name + " has " + std::to_string(table.rows()),
          "give the outputs of the same rows"};
    compared.file = files.outputs;
    for (const auto& output : model.outputs()) {
      const auto& name = model.signal(output)->column;
      if (const auto* ours = compared.find(name)) {
        const auto place = ours - compared.columns.data();
        compared.columns.erase(compared.columns.begin() + place);
      }
      if (const auto* column = own.find(name)) compared.columns.push_back(*column);
    }
  }
  auto measured = model::to_record(compared, model, false).record.signals;
  bool any = false;
  for (const auto& output : model.outputs()) {
    auto& values = measured[output];
    values.resize(run.inputs.rows(), std::nan(""));
    any = any || count(values) >= thresholds::values_to_compare;
    run.measured.push_back(std::move(values));
  }
  if (!any)
    throw InputError{
        (has_own ? files.outputs : files.inputs).string(),
        "has fewer than " + std::to_string(thresholds::values_to_compare) + " values of each output",
        "give a recording with at least one of them"};
  return run;
}

namespace {

/// The run as the diagnosis would look at it, with the model as it was given.
Case case_of(const Case& data, const OtherRun& run) {
  Case other;
  other.model = data.model;
  std::erase_if(other.model.parameters, is_start);
  other.outputs = data.outputs;
  other.given_noise = data.given_noise;
  other.is_time_series = data.is_time_series;
  other.windows.are_long = data.windows.are_long;
  other.recordings.push_back({run.name, run.inputs, run.measured, physics::prepare(other.model, run.inputs)});
  return other;
}

/// What a model makes of each window from states of its own.
physics::Outputs from_own_starts(const Case& windows, const physics::Model& model) {
  auto own = windows;
  own.remembered = std::make_shared<Remembered>();
  own.model = model;
  std::erase_if(own.model.parameters, is_start);
  for (const auto& parameter : windows.model.parameters)
    if (is_start(parameter)) own.model.parameters.push_back(parameter);
  own.recordings.front().simulation = physics::prepare(own.model, own.recordings.front().inputs);
  estimate_starts(own);
  return simulate(own, own.model).front();
}

/// From where to where a variable goes there; nothing where it is not known.
std::optional<Range> range_of(const Case& other, const physics::Term& term) {
  if (other.model.plant == physics::Plant::equations) {
    const auto [low, high] = span_of(other, other.model, term.curve.over);
    return Range{low, high};
  }
  std::optional<Range> range;
  for (const double v : variable_values(other, 0, term.curve.over, term.on))
    if (std::isfinite(v))
      range = range ? Range{std::min(range->lower, v), std::max(range->upper, v)} : Range{v, v};
  return range;
}

/// A course over time is that of one recording, and one over anything else says nothing past its knots.
bool says_nothing_of(const Case& other, const physics::Term& term) {
  const auto& curve = term.curve;
  if (curve.knots.empty() || curve.period > 0.0 || curve.memory != physics::Curve::Memory::none) return false;
  if (is_over_time(term)) return true;
  const auto range = range_of(other, term);
  // Between two knots it goes straight, and so it may half a step beyond the last.
  const double beyond = curve.knots.size() > 1 ? 0.5 * (curve.knots[1] - curve.knots[0]) : 0.0;
  return range && (range->lower < curve.knots.front() - beyond || range->upper > curve.knots.back() + beyond);
}

std::vector<FitRow> rows_of(const Case& data, const Diagnosis& diagnosis, const OtherRun& run,
                            const physics::Outputs& after) {
  std::vector<FitRow> rows;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto n = count(run.measured[o]);
    if (n < thresholds::values_to_compare) continue;
    const auto rms = [&](const physics::Outputs& outputs) {
      double sum = 0.0;
      for (std::size_t i = 0; i < run.measured[o].size(); ++i)
        if (std::isfinite(run.measured[o][i])) sum += std::pow(run.measured[o][i] - outputs[o][i], 2);
      return std::sqrt(sum / static_cast<double>(n));
    };
    const auto& signal = *data.model.signal(data.outputs[o]);
    rows.push_back({signal.name, signal.unit == "degC" ? "K" : signal.unit, rms(run.before), rms(run.retuned),
                    rms(after), o < diagnosis.heldout.size() ? diagnosis.heldout[o].noise_floor : 0.0});
  }
  return rows;
}

bool errs_more(const std::vector<FitRow>& rows) {
  return is_worse(rows, &FitRow::after, &FitRow::retuned) || is_worse(rows, &FitRow::after, &FitRow::before);
}

}  // namespace

void compare(const Case& data, const Diagnosis& diagnosis, OtherRun& run) {
  auto other = case_of(data, run);
  if (data.windows.count > 0) cut_into_windows(other);
  const auto& terms = diagnosis.best.model.terms;
  for (std::size_t t = data.model.terms.size(); t < terms.size(); ++t)
    if (says_nothing_of(other, terms[t])) run.left_out.push_back(t);
  const bool windowed = other.windows.count > 0;
  if (windowed) {
    run.how_windowed = how_windowed(other);
    run.measured = other.recordings.front().measured;
  }
  const auto outputs_of = [&](const physics::Model& model) {
    return windowed         ? from_own_starts(other, model)
           : run.fits_start ? from_best_start(model, run)
                            : simulated(model, run.inputs);
  };
  run.before = outputs_of(data.model);
  run.retuned = outputs_of(diagnosis.retuned.model);
  run.after = outputs_of(best_without(data, diagnosis, run.left_out));
  run.fit = rows_of(data, diagnosis, run, run.after);
  run.is_worse_patched = errs_more(run.fit);
  run.is_worse = run.is_worse_patched || is_worse(run.fit, &FitRow::retuned, &FitRow::before);
  run.is_worse_with_them =
      !run.left_out.empty() && errs_more(rows_of(data, diagnosis, run, outputs_of(diagnosis.best.model)));
}

void check_on(const Case& data, Diagnosis& d, OtherRun run) {
  compare(data, d, run);
  // No fit saw these rows: what errs by more than noise there does not explain the machine.
  const bool leaves_more = std::any_of(run.fit.begin(), run.fit.end(), [](const FitRow& row) {
    return row.noise_floor > 0.0 && row.after > thresholds::times_noise * row.noise_floor;
  });
  if (leaves_more && d.verdict == Verdict::explained) d.verdict = Verdict::partly_explained;
  d.other_runs.push_back(std::move(run));
}

physics::Model best_without(const Case& data, const Diagnosis& diagnosis,
                            const std::vector<std::size_t>& terms) {
  auto model = diagnosis.best.model;
  if (terms.empty()) return model;
  const bool happened_once = std::all_of(
      terms.begin(), terms.end(), [&](std::size_t t) { return is_over_time(diagnosis.best.model.terms[t]); });
  if (!happened_once && data.model.terms.size() + terms.size() == model.terms.size())
    return diagnosis.retuned.model;
  for (std::size_t k = terms.size(); k-- > 0;) model = physics::without_term(std::move(model), terms[k]);
  // Rows that hold what happened once would lead the numbers astray again.
  if (happened_once) return model;
  return fit(data, diagnosis.weighing, model, data.model, Effort::follow(8)).model;
}

std::vector<std::size_t> of_one_recording(const Diagnosis& diagnosis) {
  std::vector<std::size_t> terms;
  for (const auto& run : diagnosis.other_runs)
    if (run.is_worse_with_them) terms.insert(terms.end(), run.left_out.begin(), run.left_out.end());
  std::sort(terms.begin(), terms.end());
  terms.erase(std::unique(terms.begin(), terms.end()), terms.end());
  return terms;
}

}  // namespace invar::diagnosis

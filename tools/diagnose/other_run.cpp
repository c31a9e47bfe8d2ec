#include "tools/diagnose/other_run.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/model/recording_file.hpp"

namespace invar::diagnose {

namespace {

constexpr std::size_t fewest = 8;  // values of an output that is worth a comparison; the start alone is none

std::size_t count(const std::vector<double>& values) {
  return static_cast<std::size_t>(
      std::count_if(values.begin(), values.end(), [](double v) { return std::isfinite(v); }));
}

/// measured - simulated of all outputs that are compared, each over the spread of what was measured.
Eigen::VectorXd differences(const OtherRun& run, const physics::Outputs& simulated) {
  std::vector<double> all;
  for (std::size_t o = 0; o < simulated.size(); ++o) {
    if (count(run.measured[o]) < fewest) continue;
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
    const Eigen::VectorXd change = slope.colPivHouseholderQr().solve(-from);
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
    const auto own = recording::Table::read(files.outputs);
    if (own.rows() != table.rows())
      throw InputError{
          files.outputs.string(),
          "has " + std::to_string(own.rows()) + " rows, " + run.name + " has " + std::to_string(table.rows()),
          "give the outputs of the same rows"};
    compared.file = files.outputs;
    for (const auto& output : model.outputs()) {
      const auto& name = model.signal(output)->column;
      std::erase_if(compared.columns, [&](const auto& column) { return column.name == name; });
      if (const auto* column = own.find(name)) compared.columns.push_back(*column);
    }
  }
  auto measured = model::to_record(compared, model, false).record.signals;
  bool any = false;
  for (const auto& output : model.outputs()) {
    auto& values = measured[output];
    values.resize(run.inputs.rows(), std::nan(""));
    any = any || count(values) >= fewest;
    run.measured.push_back(std::move(values));
  }
  if (!any)
    throw InputError{(has_own ? files.outputs : files.inputs).string(),
                     "has fewer than " + std::to_string(fewest) + " values of each output",
                     "give a recording with at least one of them"};
  return run;
}

void compare(const Case& data, const Diagnosis& diagnosis, OtherRun& run) {
  const auto outputs_of = [&](const physics::Model& model) {
    return run.fits_start ? from_best_start(model, run) : simulated(model, run.inputs);
  };
  run.before = outputs_of(data.model);
  run.retuned = outputs_of(diagnosis.retuned.model);
  run.after = outputs_of(diagnosis.best.model);
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto n = count(run.measured[o]);
    if (n < fewest) continue;
    const auto rms = [&](const physics::Outputs& outputs) {
      double sum = 0.0;
      for (std::size_t i = 0; i < run.measured[o].size(); ++i)
        if (std::isfinite(run.measured[o][i])) sum += std::pow(run.measured[o][i] - outputs[o][i], 2);
      return std::sqrt(sum / static_cast<double>(n));
    };
    const auto& signal = *data.model.signal(data.outputs[o]);
    run.fit.push_back({signal.name, signal.unit == "degC" ? "K" : signal.unit, rms(run.before),
                       rms(run.retuned), rms(run.after),
                       o < diagnosis.heldout.size() ? diagnosis.heldout[o].noise_floor : 0.0});
  }
}

}  // namespace invar::diagnose

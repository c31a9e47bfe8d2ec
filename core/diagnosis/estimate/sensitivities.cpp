#include "core/diagnosis/estimate/sensitivities.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/dataset/starts.hpp"

namespace invar::diagnosis {

using physics::Model;

namespace {

/// So many of the user's own equations run side by side.
constexpr std::size_t models_together = 8;

}  // namespace

void for_differences_of(const Case& data, const std::vector<Model>& models,
                        const std::function<void(std::size_t, const Eigen::VectorXd&)>& take) {
  const std::size_t threads = std::max(1U, std::thread::hardware_concurrency());
  const std::size_t together = data.model.plant == physics::Plant::equations ? models_together
                               : data.model.plant == physics::Plant::axis
                                   ? std::clamp<std::size_t>((models.size() + threads - 1) / threads, 1, 4)
                                   : 1;
  in_parallel((models.size() + together - 1) / together, [&](std::size_t group) {
    if (data.stop.stop_requested()) throw Stopped{};
    const std::size_t begin = group * together, end = std::min(models.size(), begin + together);
    std::vector<const Model*> some;
    for (std::size_t k = begin; k < end; ++k) some.push_back(&models[k]);
    std::vector<std::vector<physics::Outputs>> all(some.size(),
                                                   std::vector<physics::Outputs>(data.recordings.size()));
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      std::vector<physics::Outputs> outputs;
      data.recordings[r].simulation->run_all(some, outputs);
      for (std::size_t k = 0; k < some.size(); ++k) all[k][r] = std::move(outputs[k]);
    }
    for (std::size_t k = begin; k < end; ++k) take(k, differences(data, all[k - begin]));
  });
}

namespace {

/// Rows [first, last) of the residual column of one output.
struct RunRows {
  Eigen::Index first = 0, last = 0;
};

/// The rows of all outputs that the start `name` of a window moves: those of its recording from its restart to the next.
std::vector<RunRows> moved_by(const Case& data, const std::string& name) {
  const std::size_t which = std::stoul(name.substr(name.find(".start") + 6));
  std::vector<RunRows> rows;
  Eigen::Index at = 0;
  for (const auto& recording : data.recordings) {
    const auto& restarts = recording.inputs.restarts;
    const std::size_t first = recording.inputs.first_restart, n = recording.inputs.rows();
    for (std::size_t o = 0; o < data.outputs.size(); ++o, at += static_cast<Eigen::Index>(n))
      if (which >= first && which - first < restarts.size()) {
        const std::size_t k = which - first, end = k + 1 < restarts.size() ? restarts[k + 1] : n;
        rows.push_back({at + static_cast<Eigen::Index>(restarts[k]), at + static_cast<Eigen::Index>(end)});
      }
  }
  return rows;
}

}  // namespace

Columns sensitivities(const Case& data, const Model& model, const std::vector<Freedom>& free) {
  std::vector<Model> changed;
  std::vector<std::size_t> run_of(free.size());
  Eigen::VectorXd steps(static_cast<Eigen::Index>(free.size()));
  std::map<std::string, std::size_t> run_of_state;  // one run moves a state in all windows: they do not meet
  const auto is_window = [&](const Freedom& f) {
    return f.where == Freedom::Where::parameter && is_start(model.parameters[f.index]);
  };
  for (std::size_t j = 0; j < free.size(); ++j) {
    const double value = get(model, free[j]);
    // Equations that swing for long answer in phase: there a larger step would not be small.
    double step =
        (model.plant == physics::Plant::equations || is_window(free[j]) ? 1e-4 : 1e-2) * free[j].scale;
    if (value + step > free[j].bounds.upper) step = -step;
    steps(static_cast<Eigen::Index>(j)) = step;
    run_of[j] = changed.size();
    if (is_window(free[j])) {
      const auto& name = model.parameters[free[j].index].name;
      run_of[j] = run_of_state.try_emplace(name.substr(0, name.find(".start")), changed.size()).first->second;
    }
    if (run_of[j] == changed.size()) changed.push_back(model);
    set(changed[run_of[j]], free[j], value + step);
  }
  // How finely the user's own equations are run through goes with their numbers, in jumps: a small change is seen against a
  // run beside it that takes the same steps.
  const bool beside = model.plant == physics::Plant::equations;
  constexpr std::size_t group = models_together - 1;
  if (beside)
    for (std::size_t k = (changed.size() + group - 1) / group; k-- > 0;)
      changed.insert(changed.begin() + static_cast<std::ptrdiff_t>(k * group), model);
  const auto place = [&](std::size_t run) {
    return static_cast<Eigen::Index>(beside ? run + run / group + 1 : run);
  };
  const Eigen::VectorXd alone = beside ? Eigen::VectorXd{} : differences(data, simulate(data, model));
  Eigen::MatrixXd runs(rows_of(data), static_cast<Eigen::Index>(changed.size()));
  for_differences_of(data, changed, [&](std::size_t k, const Eigen::VectorXd& left) {
    runs.col(static_cast<Eigen::Index>(k)) = left;
  });
  std::vector<Columns::Stretch> stretches;
  std::vector<Eigen::Index> full_at;
  std::vector<Eigen::VectorXd> full;
  for (std::size_t j = 0; j < free.size(); ++j) {
    const auto to = static_cast<Eigen::Index>(j), from = place(run_of[j]);
    const Eigen::VectorXd moved =
        runs.col(from) - (beside ? runs.col(place(run_of[j] / group * group) - 1) : alone);
    const auto slope = [](double v) { return std::isfinite(v) ? v : 0.0; };
    if (!is_window(free[j])) {
      full.emplace_back((moved / steps(to)).unaryExpr(slope));
      full_at.push_back(to);
      continue;
    }
    for (const auto& [first, last] : moved_by(data, model.parameters[free[j].index].name))
      stretches.push_back({to, first, (moved.segment(first, last - first) / steps(to)).unaryExpr(slope)});
  }
  Eigen::MatrixXd columns(runs.rows(), static_cast<Eigen::Index>(full.size()));
  for (std::size_t k = 0; k < full.size(); ++k) columns.col(static_cast<Eigen::Index>(k)) = full[k];
  return {static_cast<Eigen::Index>(free.size()), std::move(columns), std::move(full_at),
          std::move(stretches)};
}

}  // namespace invar::diagnosis

#include "core/metrology/geometric/geometric_identification.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/contract.hpp"
#include "core/base/index.hpp"
#include "core/metrology/geometric/geometric_field.hpp"
#include "core/metrology/geometric/geometric_stages.hpp"
#include "core/metrology/geometric/geometric_waves.hpp"

namespace invar::metrology {

namespace {

/// The axes' travels, widened to hold every measured point.
std::array<Range, 3> ranges_of(const Machine& machine, const std::vector<CondensedLine>& lines) {
  std::array<Range, 3> ranges = machine.travel;
  for (const auto& line : lines) {
    for (const auto& point : line.points) {
      for (int k = 0; k < 3; ++k) {
        ranges[index(k)].lower = std::min(ranges[index(k)].lower, point[k]);
        ranges[index(k)].upper = std::max(ranges[index(k)].upper, point[k]);
      }
    }
  }
  return ranges;
}

/// Spline pieces of an axis: one a data interval of the line that resolves it finest.
int intervals_of(const std::vector<CondensedLine>& lines, int axis, Range range,
                 const IdentificationOptions& options) {
  double finest = range.width() / 8.0;
  for (const auto& line : lines) {
    if (const auto step = usual_step(line, axis)) finest = std::min(finest, *step);
  }
  return std::clamp(static_cast<int>(std::lround(range.width() / finest)), options.least_intervals,
                    std::max(options.least_intervals, options.most_intervals));
}

std::vector<Eigen::Vector3d> tools_of(const Machine& machine, const std::vector<CondensedLine>& lines) {
  std::vector<Eigen::Vector3d> tools{machine.tool};
  for (const auto& line : lines)
    for (const auto& tool : line.tools)
      if (std::none_of(tools.begin(), tools.end(), [&](const auto& t) { return (t - tool).norm() < 1e-7; }))
        tools.push_back(tool);
  return tools;
}

/// Log posterior of the misfit at the present prior: evidence plus a weak expectation about `expected`.
double misfit_score(double misfit, double expected, const Identification& work) {
  const auto equations = assemble(work.lines, work.rows, work.basis.size, misfit, work.point_weights);
  const double z = std::log(misfit / expected) / 1.5;
  return solve_mean(equations, work.basis, work.prior).log_evidence - 0.5 * z * z;
}

/// The top of the score over the log of the misfit, which has one: three places `step` apart are moved until the middle
/// one is the highest, then a parabola is laid through them.
double most_evident_misfit(const Identification& work, double expected, double step) {
  const double lowest = std::log(5e-9);
  const double highest = std::log(5e-6);
  const auto score = [&](double log_misfit) { return misfit_score(std::exp(log_misfit), expected, work); };
  double middle = std::clamp(std::log(work.misfit), lowest + step, highest - step);
  double at = score(middle);
  double below = score(middle - step);
  double above = score(middle + step);
  while (below > at && middle - 2.0 * step >= lowest) {
    middle -= step;
    above = at;
    at = below;
    below = score(middle - step);
  }
  while (above > at && middle + 2.0 * step <= highest) {
    middle += step;
    below = at;
    at = above;
    above = score(middle + step);
  }
  const double bend = below - 2.0 * at + above;
  const double top = bend < 0.0 ? std::clamp(0.5 * (below - above) / bend, -1.0, 1.0)
                                : (above > below ? 1.0 : -1.0);  // at an end of the range
  return std::exp(middle + top * step);
}

/// Points that stand off by more than four sigma are weakened; true when any weight moved.
bool weaken_outlying_points(Identification& work, const Eigen::VectorXd& unknowns) {
  constexpr double limit = 4.0;
  bool moved = false;
  for (std::size_t l = 0; l < work.lines.size(); ++l) {
    const CondensedLine& line = work.lines[l];
    Eigen::VectorXd rest = line.deviation - work.rows[l].remainder;
    Eigen::VectorXd chosen(static_cast<Eigen::Index>(work.rows[l].unknowns.size()));
    for (Eigen::Index i = 0; i < chosen.size(); ++i)
      chosen[i] = unknowns[work.rows[l].unknowns[index(static_cast<int>(i))]];
    rest -= work.rows[l].rows * chosen;
    double sum = 0.0;
    double mass = 0.0;
    for (Eigen::Index j = 0; j < rest.size(); ++j) {
      const double w =
          std::isfinite(rest[j]) ? 1.0 / (line.deviation_sigma[j] * line.deviation_sigma[j]) : 0.0;
      if (w > 0.0) sum += w * rest[j] * work.point_weights[l][j];
      mass += w * work.point_weights[l][j];
    }
    for (Eigen::Index j = 0; j < rest.size(); ++j) {
      if (!std::isfinite(rest[j])) continue;
      const double sigma = std::hypot(line.deviation_sigma[j], work.misfit);
      const double z = std::abs(rest[j] - sum / mass) / sigma;
      const double weight = z < limit ? 1.0 : std::pow(limit / z, 4.0);
      if (std::abs(weight - work.point_weights[l][j]) > 0.05) moved = true;
      work.point_weights[l][j] = weight;
    }
  }
  return moved;
}

/// Widens the posterior's covariance by what follows from not knowing the prior's strengths exactly. Of H^-1 = H^-1 M H^-1 +
/// H^-1 Q H^-1 the first part is what the noise moves, the second what only the prior holds: it grows by the mean of
/// exp(2 (log strength - its estimate)), error motion by error motion. And the unknowns themselves move with the strengths.
void widen_by_strengths(Identification& work) {
  constexpr double other_form =
      0.15;  // of a log strength: real curves are no draws of this prior (docs/explanation/geometric.md#estimator)
  const StrengthMatrix& strengths = work.strengths;
  const Eigen::MatrixXd& h = work.posterior.covariance;
  Eigen::MatrixXd product = h;  // H^-1 Q^(1/2), Q block diagonal, each block by its own growth
  for (const auto& block : work.basis.blocks) {
    const int kind = static_cast<int>(kind_of(block.motion));
    const int own = first_relative + block.motion;
    const double variance =
        strengths(kind, kind) + 2.0 * strengths(kind, own) + strengths(own, own) + other_form;
    const double growth = std::expm1(2.0 * std::min(variance, 0.5));
    const Eigen::LLT<Eigen::MatrixXd> prior{
        work.posterior.prior_covariance.block(block.first, block.first, block.size(), block.size())};
    const Eigen::MatrixXd columns = h.middleCols(block.first, block.size());
    product.middleCols(block.first, block.size()) =
        std::sqrt(growth) * prior.matrixL().solve(columns.transpose()).transpose();
  }
  product.rightCols(work.basis.size - work.basis.first_wave()).setZero();  // their prior is wide open
  const Eigen::MatrixXd effects = strength_effects(work.basis, work.prior, work.posterior);
  work.posterior.widened = h + product * product.transpose() + effects * strengths * effects.transpose();
}

/// Share of the unknowns in an error motion at a place: place and weight of each.
struct Share {
  std::vector<Eigen::Index> unknowns;
  std::vector<double> weights;
};
Share share_of(const GeometricBasis& basis, const GeometricBasis::Block& block, double q) {
  Share share;
  const int axis = axis_of(block.motion);
  const auto w = basis.splines[index(axis)].at(q);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(block.size());
  for (int k = 0; k < 4; ++k) row += w.value[index(k)] * block.coefficients.row(w.first + k);
  for (int i = 0; i < block.size(); ++i) {
    share.unknowns.push_back(block.first + i);
    share.weights.push_back(row[i]);
  }
  for (std::size_t i = 0; i < basis.waves.size() && is_positioning(block.motion); ++i) {
    if (basis.waves[i].axis != axis) continue;
    const Eigen::RowVector3d wave = basis.wave_row(basis.waves[i], q);
    for (int u = 0; u < wave_unknowns; ++u) {
      share.unknowns.push_back(basis.first_wave() + wave_unknowns * static_cast<int>(i) + u);
      share.weights.push_back(wave[u]);
    }
  }
  return share;
}

/// Component and field standard deviations from the posterior.
void fill_sigma(Identification& work) {
  GeometricModel& model = work.model;
  const Eigen::MatrixXd& all = work.posterior.widened;
  for (const auto& block : work.basis.blocks) {
    const auto& spline = model.splines[index(axis_of(block.motion))];
    Eigen::VectorXd& sigma = model.sigma[index(block.motion)];
    sigma.resize(spline.intervals() + 1);
    for (int i = 0; i <= spline.intervals(); ++i) {
      const Share share = share_of(work.basis, block, spline.interval().lower + i * spline.spacing());
      const Eigen::Map<const Eigen::VectorXd> row{share.weights.data(),
                                                  static_cast<Eigen::Index>(share.weights.size())};
      sigma[i] = std::sqrt(std::max(row.dot(all(share.unknowns, share.unknowns) * row), 0.0));
    }
  }
  for (std::size_t i = 0; i < work.basis.pairs.size(); ++i) {
    const Eigen::Index k = work.basis.first_squareness() + static_cast<Eigen::Index>(i);
    model.squareness_sigma[index(work.basis.pairs[i])] = std::sqrt(all(k, k));
  }
  constexpr int nodes = 9;
  SigmaGrid& grid = model.field_sigma;
  for (int k = 0; k < 3; ++k) {
    grid.range[index(k)] = model.chain.has(k) ? model.travel[index(k)] : Range{0.0, 1.0};
    grid.count[index(k)] = model.chain.has(k) ? nodes : 1;
  }
  const RigidPart rigid =
      rigid_part(work.basis, model.squareness, volume_grid(model.chain, model.travel, 5), model.tool);
  const FieldVariance variance{work.basis, model.squareness, rigid, all};
  grid.values.clear();
  for (Eigen::Vector3d position : volume_grid(model.chain, model.travel, nodes)) {
    // Beside the node, where no reading stands: on a measured point the model is surer than anywhere else.
    for (int k = 0; k < 3; ++k) {
      if (!model.chain.has(k)) continue;
      const Range r = model.travel[index(k)];
      position[k] +=
          (position[k] < r.lower + 0.5 * r.width() ? 0.35 : -0.35) * work.basis.splines[index(k)].spacing();
    }
    // What repeats but no smooth model explains is error of the machine too, at every point.
    Eigen::Vector3d sigma = (variance.at(position, model.tool).array() + work.misfit * work.misfit).sqrt();
    for (int k = 0; k < 3; ++k)
      if (!model.chain.has(k)) sigma[k] = std::numeric_limits<double>::infinity();
    grid.values.push_back(sigma);
  }
}

void fill_model(Identification& work, const Machine& machine, const std::array<Range, 3>& ranges) {
  GeometricModel& model = work.model;
  model.chain = machine.chain;
  model.travel = ranges;
  model.tool = machine.tool;
  take_unknowns(model, work.basis, work.posterior.mean);
  model.reversal = axis_reversals(work.lines, model.chain, model.travel);
  fill_sigma(work);
  if (work.basis.expanding.empty()) return;
  model.reference_temperature = work.basis.reference_temperature;
  for (std::size_t e = 0; e < work.basis.expanding.size(); ++e) {
    const Eigen::Index c = work.basis.first_expansion() + static_cast<Eigen::Index>(e);
    model.expansion[index(work.basis.expanding[e])] = work.posterior.mean[c];
    model.expansion_sigma[index(work.basis.expanding[e])] = std::sqrt(work.posterior.widened(c, c));
  }
}

void make_rows(Identification& work, const Squareness& squareness) {
  work.rows.clear();
  for (const auto& line : work.lines) work.rows.push_back(rows_of(line, work.basis, squareness));
}

/// Periodic errors beyond the smooth curves; true where there are more of them than before.
bool look_for_waves(Identification& work) {
  auto waves = find_waves(work.lines, work.rows, work.point_weights, work.misfit, work.basis, work.prior);
  if (waves.size() <= work.basis.waves.size()) return false;
  work.basis.set_waves(std::move(waves));
  update_wave_rows(work.lines, work.basis, work.rows);
  // Points stood off because of them.
  for (auto& weights : work.point_weights) weights.setOnes();
  work.equations = assemble(work.lines, work.rows, work.basis.size, work.misfit, work.point_weights);
  return true;
}

/// The prior that the readings make most evident, with what repeats but is not smooth, and the waves beside.
void search_prior(Identification& work, const GeometricPrior& expected, double misfit,
                  const std::function<void(double, const std::string&)>& say) {
  constexpr int most_rounds = 5;
  bool more = true;
  for (int round = 0; round < most_rounds; ++round) {
    say(0.2 + 0.15 * round, "searching the prior");
    const EvidentPrior found = most_evident(work.equations, work.basis, expected, work.prior);
    work.prior = found.prior;
    work.strengths = found.covariance;
    work.misfit = most_evident_misfit(work, misfit, round == 0 ? 0.8 : 0.4);
    work.equations = assemble(work.lines, work.rows, work.basis.size, work.misfit, work.point_weights);
    if (more && round + 1 < most_rounds) {
      say(0.3 + 0.15 * round, "looking for periods");
      more = look_for_waves(work);
      if (more) continue;
    }
    const auto mean = solve_mean(work.equations, work.basis, work.prior).mean;
    if (!weaken_outlying_points(work, mean) && round > 0) break;
    work.equations = assemble(work.lines, work.rows, work.basis.size, work.misfit, work.point_weights);
  }
}

}  // namespace

Eigen::VectorXd predicted_readings(const GeometricModel& model, const CondensedLine& line) {
  Eigen::VectorXd result(static_cast<Eigen::Index>(line.points.size()));
  const Eigen::Vector3d start = model.error(line.beam.start, line.beam.start_tool);
  for (std::size_t j = 0; j < line.points.size(); ++j)
    result[static_cast<Eigen::Index>(j)] =
        line.beam.direction.dot(model.error(line.points[j], line.tools[j]) - start);
  return result;
}

Identification identify(const Machine& machine, const std::vector<DisplacementLine>& lines,
                        const IdentificationOptions& options) {
  const auto say = [&](double part, const std::string& what) {
    if (options.progress) options.progress(part, what);
  };
  Identification work;
  say(0.05, "condensing the lines");
  work.lines = condense(lines, 0.0);
  INVAR_EXPECTS(!work.lines.empty(), lines.size());
  const auto ranges = ranges_of(machine, work.lines);
  std::array<int, 3> intervals{1, 1, 1};
  for (int k = 0; k < 3; ++k)
    if (machine.chain.has(k)) intervals[index(k)] = intervals_of(work.lines, k, ranges[index(k)], options);
  work.basis = make_basis(machine.chain, ranges, intervals, tools_of(machine, work.lines));
  double warmth = 0.0;
  double warm_lines = 0.0;
  for (const auto& line : work.lines) {
    if (!std::isfinite(line.temperature)) continue;
    warmth += line.temperature;
    warm_lines += 1.0;
  }
  if (warm_lines > 0.0) work.basis.add_expansion(warmth / warm_lines);
  work.basis.set_waves(options.waves);
  work.prior = options.prior;
  if (options.search_prior) work.prior.stretch = expected_stretch(ranges);
  work.misfit = options.misfit;
  double squares = 0.0;
  for (const auto& line : work.lines) {
    work.point_weights.emplace_back(Eigen::VectorXd::Ones(line.deviation.size()));
    squares += line.noise.noise * line.noise.noise;
  }
  work.noise = std::sqrt(squares / static_cast<double>(work.lines.size()));

  // The squareness is large and the field not linear in it: first find it roughly, then take exact directions there.
  make_rows(work, {});
  work.equations = assemble(work.lines, work.rows, work.basis.size, work.misfit);
  work.posterior = solve(work.equations, work.basis, work.prior);
  make_rows(work, work.basis.squareness(work.posterior.mean));
  work.equations = assemble(work.lines, work.rows, work.basis.size, work.misfit);

  const GeometricPrior expected = work.prior;
  work.strengths = options.strengths;
  if (options.search_prior) search_prior(work, expected, options.misfit, say);
  work.posterior = solve(work.equations, work.basis, work.prior);
  widen_by_strengths(work);
  if (options.method == IdentificationMethod::displacement) {
    // Steps that use each line once have an error beside the posterior's: where all lines at once would have put it.
    const Eigen::VectorXd mean = mean_in_stages(work.lines, work.rows, work.basis, expected, options.misfit);
    const Eigen::VectorXd off = mean - work.posterior.mean;
    work.posterior.mean = mean;
    work.posterior.covariance += off * off.transpose();
    work.posterior.widened += off * off.transpose();
  }
  say(0.9, "field and its deviation");
  fill_model(work, machine, ranges);
  return work;
}

}  // namespace invar::metrology

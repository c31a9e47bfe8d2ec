// The same made machines through the usual ways and through ours: what each fits, names, and claims where nothing is missing.
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "core/diagnosis/candidates/candidates.hpp"
#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/estimate/weighing.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/evidence/wander.hpp"
#include "core/diagnosis/search/diagnose.hpp"
#include "core/diagnosis/search/options.hpp"
#include "core/model/record_file.hpp"
#include "core/physics/simulation.hpp"
#include "tests/support/mismatch/marks.hpp"

namespace invar::test::mismatch {
namespace {

using diagnosis::Case;
using diagnosis::Fit;

/// What a method says of a machine.
struct Answer {
  std::vector<std::string> names;
  double fit = 0.0;
  bool claims = false;
};

Answer of_model(const Machine& machine, const Case& data, const physics::Model& model) {
  Answer answer;
  for (std::size_t t = data.model.terms.size(); t < model.terms.size(); ++t)
    answer.names.emplace_back(model.terms[t].info->name);
  answer.claims = !answer.names.empty();
  answer.fit = fit_on_test(machine, data.model, model);
  return answer;
}

/// The believed model with its own numbers refitted, every row alike.
Fit refitted(const Case& data, diagnosis::Weighing& weighing) {
  Fit best;
  best.model = data.model;
  for (int again = 0; again < 3; ++again) {
    weighing = diagnosis::weigh(data, diagnosis::simulate(data, best.model), diagnosis::Colour::white);
    best = diagnosis::fit(data, weighing, best.model, data.model, diagnosis::Effort::follow(10));
  }
  return best;
}

/// A Gaussian process over inputs, simulated outputs and their slopes, on what the refitted model leaves.
class ResidualProcess {
 public:
  ResidualProcess(const Case& data, const physics::Model& model) {
    std::vector<Eigen::RowVectorXd> rows;
    std::vector<std::vector<double>> rest(data.outputs.size());
    for (const auto& recording : data.recordings) {
      physics::Outputs simulated;
      recording.simulation->run(model, simulated);
      const auto features = features_of(recording.inputs, simulated);
      for (std::size_t i = 0; i < recording.inputs.rows(); ++i) {
        bool whole = features.row(static_cast<Eigen::Index>(i)).allFinite();
        for (const auto& measured : recording.measured) whole = whole && std::isfinite(measured[i]);
        if (!whole) continue;
        rows.emplace_back(features.row(static_cast<Eigen::Index>(i)));
        for (std::size_t o = 0; o < rest.size(); ++o)
          rest[o].push_back(recording.measured[o][i] - simulated[o][i]);
      }
    }
    constexpr std::size_t most = 350;
    const std::size_t every = std::max<std::size_t>(1, rows.size() / most);
    const auto n = static_cast<Eigen::Index>((rows.size() + every - 1) / every);
    points_.resize(n, rows.front().size());
    for (Eigen::Index i = 0; i < n; ++i) points_.row(i) = rows[static_cast<std::size_t>(i) * every];
    center_ = points_.colwise().mean();
    points_.rowwise() -= center_;
    scale_ = (points_.array().square().colwise().mean().sqrt() + 1e-300).inverse();
    points_.array().rowwise() *= scale_;
    for (const auto& values : rest) {
      Eigen::VectorXd y(n);
      for (Eigen::Index i = 0; i < n; ++i) y(i) = values[static_cast<std::size_t>(i) * every];
      learn(y);
    }
  }

  void correct(const physics::Record& inputs, physics::Outputs& simulated) const {
    Eigen::MatrixXd at = features_of(inputs, simulated);
    at.rowwise() -= center_;
    at.array().rowwise() *= scale_;
    for (std::size_t o = 0; o < outputs_.size(); ++o)
      for (Eigen::Index i = 0; i < at.rows(); ++i) {
        if (!at.row(i).allFinite()) continue;
        const Eigen::VectorXd distance = (points_.rowwise() - at.row(i)).rowwise().squaredNorm();
        const auto& [length, weights] = outputs_[o];
        simulated[o][static_cast<std::size_t>(i)] +=
            (-0.5 * distance / (length * length)).array().exp().matrix().dot(weights);
      }
  }

  [[nodiscard]] bool claims() const { return gain_ > diagnosis::thresholds::claim_margin; }

 private:
  static Eigen::MatrixXd features_of(const physics::Record& inputs, const physics::Outputs& simulated) {
    std::vector<const std::vector<double>*> columns;
    for (const auto& [name, values] : inputs.signals) columns.push_back(&values);
    const auto n = static_cast<Eigen::Index>(inputs.rows());
    const auto known = static_cast<Eigen::Index>(columns.size()),
               own = static_cast<Eigen::Index>(simulated.size());
    Eigen::MatrixXd features(n, known + 2 * own);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto row = static_cast<std::size_t>(i);
      for (Eigen::Index c = 0; c < known; ++c) features(i, c) = (*columns[static_cast<std::size_t>(c)])[row];
      for (Eigen::Index o = 0; o < own; ++o) {
        const auto& y = simulated[static_cast<std::size_t>(o)];
        features(i, known + 2 * o) = y[row];
        features(i, known + 2 * o + 1) = i > 0 ? y[row] - y[row - 1] : 0.0;
      }
    }
    return features;
  }

  void learn(const Eigen::VectorXd& y) {
    const auto n = y.size();
    const double power = y.squaredNorm() / static_cast<double>(n);
    const auto likelihood = [&](const Eigen::MatrixXd& k, Eigen::VectorXd& weights) {
      const Eigen::LLT<Eigen::MatrixXd> root{k};
      weights = root.solve(y);
      return -0.5 * y.dot(weights) - root.matrixLLT().diagonal().array().log().sum();
    };
    Eigen::VectorXd weights;
    const double white = likelihood(power * Eigen::MatrixXd::Identity(n, n), weights);
    double best = -1e300;
    Output chosen{1.0, Eigen::VectorXd::Zero(n)};
    for (const double length : {0.5, 1.0, 2.0, 4.0}) {
      Eigen::MatrixXd k(n, n);
      for (Eigen::Index i = 0; i < n; ++i)
        k.col(i) = (-0.5 / (length * length) * (points_.rowwise() - points_.row(i)).rowwise().squaredNorm())
                       .array()
                       .exp();
      for (const double share : {0.03, 0.3, 0.7}) {
        const Eigen::MatrixXd covariance =
            (1.0 - share) * power * k + (share * power + 1e-300) * Eigen::MatrixXd::Identity(n, n);
        if (const double score = likelihood(covariance, weights); score > best)
          best = score, chosen = {length, (1.0 - share) * power * weights};
      }
    }
    gain_ = std::max(gain_, best - white);
    if (best < white) chosen.weights.setZero();
    outputs_.push_back(std::move(chosen));
  }

  struct Output {
    double length;
    Eigen::VectorXd weights;
  };
  Eigen::MatrixXd points_;
  Eigen::RowVectorXd center_;
  Eigen::Array<double, 1, Eigen::Dynamic> scale_;
  std::vector<Output> outputs_;
  double gain_ = -1e300;
};

Answer gaussian_process(const Machine& machine, const Case& data, const Fit& refit) {
  const ResidualProcess process{data, refit.model};
  const auto inputs = model::to_record(machine.test_inputs, data.model, false).record;
  physics::Outputs outputs;
  physics::prepare(data.model, inputs)->run(refit.model, outputs);
  process.correct(inputs, outputs);
  Answer answer;
  answer.fit = fit_on_test(machine, data.model, outputs);
  answer.claims = process.claims();
  return answer;
}

/// Sequentially thresholded least squares over the first-order effect of every candidate (SINDy); the threshold by
/// cross-validation over five blocks of rows.
Answer sparse_regression(const Machine& machine, const Case& data, const diagnosis::Weighing& weighing,
                         const Fit& refit) {
  auto screened =
      diagnosis::screen(data, weighing, refit, diagnosis::named_starts(data, weighing, refit, {}), 60);
  std::erase_if(screened, [](const auto& s) { return s.columns.size() == 0; });
  Eigen::MatrixXd all = diagnosis::whitened(data, weighing, refit.columns).dense();
  const auto own = all.cols();
  std::vector<Eigen::Index> begins;
  for (const auto& s : screened) {
    begins.push_back(all.cols());
    const Eigen::MatrixXd columns = diagnosis::whitened(data, weighing, s.columns);
    all.conservativeResize(Eigen::NoChange, all.cols() + columns.cols());
    all.rightCols(columns.cols()) = columns;
  }
  begins.push_back(all.cols());
  const Eigen::RowVectorXd norms = all.colwise().norm().array() + 1e-300;
  all.array().rowwise() /= norms.array();
  const Eigen::VectorXd y = -refit.residual;
  const auto solve = [&](const Eigen::MatrixXd& gram, const Eigen::VectorXd& slope, double threshold) {
    std::vector<bool> kept(screened.size(), true);
    Eigen::VectorXd w = Eigen::VectorXd::Zero(all.cols());
    for (int pass = 0; pass < 8; ++pass) {
      std::vector<Eigen::Index> places;
      for (Eigen::Index c = 0; c < own; ++c) places.push_back(c);
      for (std::size_t s = 0; s < screened.size(); ++s)
        for (auto c = begins[s]; kept[s] && c < begins[s + 1]; ++c) places.push_back(c);
      Eigen::MatrixXd m = gram(places, places);
      m.diagonal().array() += 1e-8;
      const Eigen::VectorXd part = m.ldlt().solve(Eigen::VectorXd{slope(places)});
      w.setZero();
      for (std::size_t k = 0; k < places.size(); ++k) w(places[k]) = part(static_cast<Eigen::Index>(k));
      bool changed = false;
      for (std::size_t s = 0; s < screened.size(); ++s)
        if (kept[s] && w.segment(begins[s], begins[s + 1] - begins[s]).norm() < threshold)
          kept[s] = false, changed = true;
      if (!changed) break;
    }
    return w;
  };
  constexpr int folds = 5;
  const Eigen::Index length = all.rows() / folds;
  std::vector<Eigen::MatrixXd> grams;
  std::vector<Eigen::VectorXd> slopes;
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(all.cols(), all.cols());
  Eigen::VectorXd whole_slope = Eigen::VectorXd::Zero(all.cols());
  for (int f = 0; f < folds; ++f) {
    const auto block = all.middleRows(f * length, length);
    grams.emplace_back(block.transpose() * block);
    slopes.emplace_back(block.transpose() * y.segment(f * length, length));
    whole += grams.back(), whole_slope += slopes.back();
  }
  double least = 1e300, threshold = 0.0;
  for (double t = 0.5; t < 1e5; t *= 1.6) {
    double loss = 0.0;
    for (std::size_t f = 0; f < folds; ++f) {
      const Eigen::VectorXd w = solve(whole - grams[f], whole_slope - slopes[f], t);
      loss += w.dot(grams[f] * w) - 2.0 * w.dot(slopes[f]);
    }
    if (loss < least) least = loss, threshold = t;
  }
  const Eigen::VectorXd w = solve(whole, whole_slope, threshold);
  std::vector<const diagnosis::Screened*> chosen;
  for (std::size_t s = 0; s < screened.size(); ++s) {
    const auto count = begins[s + 1] - begins[s];
    const Eigen::VectorXd part = w.segment(begins[s], count);
    if (part.norm() == 0.0) continue;
    screened[s].strength = part.cwiseQuotient(norms.segment(begins[s], count).transpose());
    chosen.push_back(&screened[s]);
  }
  auto model = diagnosis::with(refit, chosen);
  for (Eigen::Index c = 0; c < own; ++c) {
    const auto& f = refit.free[static_cast<std::size_t>(c)];
    diagnosis::set(model, f, f.bounds.clamp(diagnosis::get(model, f) + w(c) / norms(c)));
  }
  return of_model(machine, data, model);
}

/// The candidate of most evidence, again and again, while the Bayesian information criterion falls.
Answer stepwise(const Machine& machine, const Case& data, diagnosis::Weighing weighing, Fit best) {
  for (int terms = 0; terms < 5; ++terms) {
    const auto screened =
        diagnosis::screen(data, weighing, best, diagnosis::named_starts(data, weighing, best, {}), 0);
    Fit next = best;
    for (std::size_t i = 0; i < std::min<std::size_t>(3, screened.size()); ++i)
      if (auto tried = diagnosis::fit_with(data, weighing, best, screened[i], diagnosis::Effort::follow(8));
          tried.evidence > next.evidence)
        next = std::move(tried);
    if (next.model.terms.size() == best.model.terms.size()) break;
    weighing = diagnosis::weigh(data, diagnosis::simulate(data, next.model), diagnosis::Colour::white);
    best = diagnosis::fit(data, weighing, next.model, data.model, diagnosis::Effort::follow(6), &next);
  }
  return of_model(machine, data, best.model);
}

Answer ours(const Machine& machine, Case data, bool refuses) {
  diagnosis::Options options;
  options.refuses = refuses;
  const auto d = diagnosis::diagnose(
      data, [](double, const std::string&) {}, options);
  return of_model(machine, data, d.best.model);
}

struct Sum {
  double fit = 0.0, named = 0.0, extra = 0.0;
  int cases = 0, missing = 0, nulls = 0, claimed = 0;

  void add(const Machine& machine, const Answer& answer) {
    if (machine.missing.empty()) {
      ++nulls, claimed += answer.claims ? 1 : 0;
      return;
    }
    ++cases, fit += std::isfinite(answer.fit) ? answer.fit : -1.0;  // a model that runs away
    for (const auto& name : answer.names)
      if (name != "unmodelled" && credit(machine, name) == 0.0) extra += 1.0;
    if (machine.missing.front().names.contains("unmodelled")) return;
    ++missing;
    for (const auto& term : machine.missing) {
      double most = 0.0;
      for (const auto& name : answer.names)
        if (const auto at = term.names.find(name); at != term.names.end()) most = std::max(most, at->second);
      named += most / static_cast<double>(machine.missing.size());
    }
  }
};

}  // namespace
}  // namespace invar::test::mismatch

int main(int argc, char** argv) {
  using namespace invar;
  using namespace invar::test::mismatch;
  CLI::App program{"Made machines through the usual ways of finding what is missing, and through ours"};
  std::vector<std::string> of = plants;
  unsigned seed = 1, nulls = 8;
  double size = 1.0;
  program.add_option("--plants", of, "these plants alone");
  program.add_option("--seed", seed, "of the first machine")->capture_default_str();
  program.add_option("--nulls", nulls, "machines of each plant in which nothing is missing")
      ->capture_default_str();
  program.add_option("--size", size, "of the effects against the usual ones")->capture_default_str();
  CLI11_PARSE(program, argc, argv);
  constexpr std::array methods{"refit only",
                               "Gaussian process of the residual",
                               "sparse regression, cross-validated",
                               "greedy stepwise, BIC",
                               "ours without refusing",
                               "ours"};
  std::array<Sum, methods.size()> sums;
  for (const auto& plant : of) {
    std::vector<std::string> list(nulls, "none");
    for (const auto& effect : effects(plant))
      if (effect != "none" && effect != "parameter") list.push_back(effect);
    unsigned number = 1000 * seed;
    for (const auto& effect : list) {
      Draw draw{++number};
      Trouble trouble;
      trouble.colour = draw.once_in(2.0) ? static_cast<Colour>(1 + draw.index(4)) : Colour::white;
      const auto machine = make(plant, effect, size, number, trouble);
      const auto data = case_of(machine);
      diagnosis::Weighing weighing;
      const auto refit = refitted(data, weighing);
      const std::array answers{of_model(machine, data, refit.model),
                               gaussian_process(machine, data, refit),
                               sparse_regression(machine, data, weighing, refit),
                               stepwise(machine, data, weighing, refit),
                               ours(machine, data, false),
                               ours(machine, data, true)};
      for (std::size_t m = 0; m < methods.size(); ++m) sums[m].add(machine, answers[m]);
      std::printf("%s %s:", plant.c_str(), effect.c_str());
      for (const auto& answer : answers) std::printf(" %.2f/%zu", answer.fit, answer.names.size());
      std::printf("\n");
      std::fflush(stdout);
    }
  }
  std::printf(
      "\n| method | fit on another run | right name | false terms a case | nulls with a claim |\n"
      "| --- | --- | --- | --- | --- |\n");
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const auto& s = sums[m];
    std::printf("| %s | %.3f | %.3f | %.2f | %d of %d |\n", methods[m], s.fit / std::max(1, s.cases),
                s.named / std::max(1, s.missing), s.extra / std::max(1, s.cases), s.claimed, s.nulls);
  }
}

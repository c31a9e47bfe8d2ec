#include "tools/diagnose/fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace invar::diagnose {

using physics::Model;
using physics::Role;

double get(const Model& model, const Freedom& f) {
  switch (f.where) {
    case Freedom::Where::parameter:
      return model.parameters[f.index].value;
    case Freedom::Where::term:
      return model.terms[f.term].values[f.index];
    case Freedom::Where::curve:
      return model.terms[f.term].curve.values[f.index];
  }
  return 0.0;
}

void set(Model& model, const Freedom& f, double value) {
  switch (f.where) {
    case Freedom::Where::parameter: {
      auto& parameter = model.parameters[f.index];
      parameter.value = value;
      for (auto& term : model.terms)
        for (std::size_t i = 0; i < term.info->parameter_count(); ++i)
          if (!term.given[i] && term.info->parameters[i].name == parameter.name) term.values[i] = value;
      break;
    }
    case Freedom::Where::term:
      model.terms[f.term].values[f.index] = value;
      break;
    case Freedom::Where::curve:
      model.terms[f.term].curve.values[f.index] = value;
      break;
  }
}

std::vector<Freedom> freedoms(const Model& model, const Model& believed) {
  std::vector<Freedom> free;
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    const auto& parameter = believed.parameters[i];
    if (parameter.sigma && *parameter.sigma == 0.0) continue;
    Freedom f;
    f.index = i;
    f.center = parameter.value;
    f.sigma = parameter.sigma.value_or(0.0);
    f.scale = parameter.sigma ? *parameter.sigma : std::max(0.05 * std::abs(parameter.value), 1e-9);
    f.bounds = parameter.bounds;
    free.push_back(f);
  }
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    const auto& term = model.terms[t];
    const bool is_nominal = t < believed.terms.size();
    for (std::size_t i = 0; i < term.curve.values.size(); ++i) {
      double size = 0.0;
      for (double v : term.curve.values) size = std::max(size, std::abs(v));
      Freedom f;
      f.where = Freedom::Where::curve, f.term = t, f.index = i;
      f.scale = std::max(0.1 * size, 1e-12);
      f.sigma = 10.0 * std::max(size, 1e-11);  // keeps knots where they are that no row visits
      free.push_back(f);
    }
    for (std::size_t i = 0; i < term.info->parameter_count(); ++i) {
      const auto& info = term.info->parameters[i];
      if (info.role == Role::reference) continue;
      if (!term.given[i] && model.find(info.name) != nullptr) continue;  // moves with the nominal one
      Freedom f;
      f.where = Freedom::Where::term, f.term = t, f.index = i;
      f.bounds = info.bounds;
      const double usual = std::abs(info.starts[0]);
      f.scale = info.role == Role::phase
                    ? 0.3
                    : std::max({0.1 * std::abs(term.values[i]), usual < 1e100 ? 0.02 * usual : 0.0, 1e-12});
      if (info.role == Role::shape &&
          (info.name == "pitch" || info.name == "frequency" || info.name == "period"))
        f.scale = 0.003 * std::abs(term.values[i]);
      if (info.name == "center") f.scale = 0.01;
      if (is_nominal) {
        const auto sigma = believed.terms[t].sigmas[i];
        if (sigma && *sigma == 0.0) continue;
        if (!sigma && !believed.terms[t].given[i]) continue;  // left out on purpose
        f.center = believed.terms[t].values[i];
        f.sigma = sigma.value_or(0.0);
        if (sigma) f.scale = *sigma;
      }
      free.push_back(f);
    }
  }
  return free;
}

std::vector<physics::Outputs> simulate(const Case& data, const Model& model) {
  std::vector<physics::Outputs> all(data.recordings.size());
  for (std::size_t r = 0; r < all.size(); ++r) data.recordings[r].simulation->run(model, all[r]);
  return all;
}

Weighing weigh(const Case& data, const std::vector<physics::Outputs>& simulated) {
  Weighing weighing;
  weighing.present.resize(data.recordings.size());
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    std::vector<std::vector<double>> series;
    std::size_t used = 0;
    for (std::size_t r = 0; r < data.recordings.size(); ++r) {
      const auto& measured = data.recordings[r].measured[o];
      std::vector<double> one(measured.size());
      std::vector<bool> present(measured.size());
      for (std::size_t i = 0; i < one.size(); ++i) {
        one[i] = measured[i] - simulated[r][o][i];
        present[i] = std::isfinite(one[i]);
        used += present[i] ? 1U : 0U;
      }
      series.push_back(std::move(one));
      weighing.present[r].push_back(std::move(present));
      weighing.rows += static_cast<Eigen::Index>(measured.size());
    }
    const std::size_t most = data.is_time_series ? std::min<std::size_t>(16, used / 150) : 0;
    auto filter = fit_whitening(series, most);
    // Hardly any values: nothing but the user's word says how good they are.
    if (used < 20 && std::isfinite(data.given_noise[o])) filter = {{}, data.given_noise[o]};
    weighing.filters.push_back(filter);
  }
  // In a loop the command repeats the noise of the reading.
  weighing.temper = data.model.controller && data.outputs.size() > 1 ? 0.5 : 1.0;
  return weighing;
}

Eigen::VectorXd residual(const Case& data, const Weighing& weighing,
                         const std::vector<physics::Outputs>& simulated) {
  Eigen::VectorXd out(weighing.rows);
  Eigen::Index at = 0;
  std::vector<double> r;
  for (std::size_t rec = 0; rec < data.recordings.size(); ++rec)
    for (std::size_t o = 0; o < data.outputs.size(); ++o) {
      const auto& measured = data.recordings[rec].measured[o];
      r.resize(measured.size());
      for (std::size_t i = 0; i < r.size(); ++i) {
        r[i] = measured[i] - simulated[rec][o][i];
        if (std::isnan(r[i]) && weighing.present[rec][o][i])
          r[i] = 1e3 * weighing.filters[o].sigma;  // ran away
      }
      whiten(weighing.filters[o], r, weighing.present[rec][o], out.data() + at);
      at += static_cast<Eigen::Index>(r.size());
    }
  return out.cwiseMax(-1e6).cwiseMin(1e6);
}

Eigen::VectorXd residual(const Case& data, const Weighing& weighing, const Model& model) {
  return residual(data, weighing, simulate(data, model));
}

Eigen::MatrixXd sensitivities(const Case& data, const Weighing& weighing, const Model& model,
                              const std::vector<Freedom>& free, const Eigen::VectorXd& at) {
  Eigen::MatrixXd columns(at.size(), static_cast<Eigen::Index>(free.size()));
  in_parallel(free.size(), [&](std::size_t j) {
    Model changed = model;
    const double value = get(model, free[j]);
    double step = 1e-2 * free[j].scale;
    if (value + step > free[j].bounds.upper) step = -step;
    set(changed, free[j], value + step);
    columns.col(static_cast<Eigen::Index>(j)) = (residual(data, weighing, changed) - at) / step;
  });
  return columns;
}

Fit fit(const Case& data, const Weighing& weighing, const Model& start, const Model& believed,
        int iterations) {
  Fit best;
  best.model = start;
  best.free = freedoms(start, believed);
  const auto n = static_cast<Eigen::Index>(best.free.size());
  const auto prior_cost = [&](const Model& model) {
    double sum = 0.0;
    for (const auto& f : best.free)
      if (f.sigma > 0.0) sum += std::pow((get(model, f) - f.center) / f.sigma, 2);
    return 0.5 * sum;
  };
  best.residual = residual(data, weighing, best.model);
  best.data_cost = 0.5 * weighing.temper * best.residual.squaredNorm();
  best.cost = best.data_cost + prior_cost(best.model);
  double damping = 1e-3;
  Eigen::MatrixXd hessian;
  bool converged = iterations == 0;
  for (int i = 0; i <= iterations; ++i) {
    const Eigen::MatrixXd j = sensitivities(data, weighing, best.model, best.free, best.residual);
    hessian = weighing.temper * (j.transpose() * j);
    Eigen::VectorXd gradient = weighing.temper * (j.transpose() * best.residual);
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto& f = best.free[static_cast<std::size_t>(k)];
      if (!(f.sigma > 0.0)) continue;
      hessian(k, k) += 1.0 / (f.sigma * f.sigma);
      gradient(k) += (get(best.model, f) - f.center) / (f.sigma * f.sigma);
    }
    if (converged || i == iterations) break;
    const double before = best.cost;
    bool better = false;
    for (int attempt = 0; attempt < 5 && !better; ++attempt) {
      Eigen::MatrixXd damped = hessian;
      for (Eigen::Index k = 0; k < n; ++k) damped(k, k) += damping * hessian(k, k) + 1e-300;
      const Eigen::VectorXd step = damped.ldlt().solve(-gradient);
      if (!step.allFinite()) break;
      Model tried = best.model;
      for (Eigen::Index k = 0; k < n; ++k) {
        const auto& f = best.free[static_cast<std::size_t>(k)];
        double by = step(k);
        // A shape is trusted to be linear only so far.
        if (f.where == Freedom::Where::term && f.sigma <= 0.0)
          by = std::clamp(by, -20.0 * f.scale, 20.0 * f.scale);
        set(tried, f, f.bounds.clamp(get(best.model, f) + by));
      }
      Eigen::VectorXd r = residual(data, weighing, tried);
      const double data_cost = 0.5 * weighing.temper * r.squaredNorm();
      const double cost = data_cost + prior_cost(tried);
      if (cost < best.cost) {
        best.model = std::move(tried);
        best.residual = std::move(r);
        best.cost = cost;
        best.data_cost = data_cost;
        damping = std::max(1e-9, 0.1 * damping);
        better = true;
      } else {
        damping *= 10.0;
      }
    }
    converged = !better || before - best.cost < 0.02 + 1e-5 * best.cost;
    if (!better) break;
    if (converged) i = std::max(i, iterations - 1);
  }
  // Numbers that the data do not move keep their prior and cost nothing.
  double complexity = 0.0;
  const double observations = std::max(10.0, weighing.temper * static_cast<double>(best.residual.size()));
  for (const auto& f : best.free)
    if (!(f.sigma > 0.0) || f.where == Freedom::Where::curve) complexity += 0.5 * std::log(observations);
  best.evidence = -best.cost - complexity;
  Eigen::MatrixXd regular = hessian;
  for (Eigen::Index k = 0; k < n; ++k) regular(k, k) = regular(k, k) * (1.0 + 1e-9) + 1e-300;
  const Eigen::MatrixXd covariance = regular.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  best.sigma = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  return best;
}

}  // namespace invar::diagnose

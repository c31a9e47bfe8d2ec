#include "core/metrology/geometric/geometric_equations.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

/// Precision of the prior in the gauge's coordinates, Q_k = N' K^-1 N, and what its derivatives need.
struct BlockPrior {
  Eigen::MatrixXd precision;  // Q_k
  Eigen::MatrixXd solved;     // K^-1 N
  double log_determinant = 0.0;
};

BlockPrior block_prior(const GeometricBasis& basis, const GeometricPrior& prior,
                       const GeometricBasis::Block& block) {
  const Eigen::LLT<Eigen::MatrixXd> factor{coefficient_covariance(basis, prior, block.motion)};
  BlockPrior result;
  result.solved = factor.solve(block.coefficients);
  result.precision = block.coefficients.transpose() * result.solved;
  result.precision = 0.5 * (result.precision + result.precision.transpose().eval());
  const Eigen::LLT<Eigen::MatrixXd> precision{result.precision};
  result.log_determinant = 2.0 * precision.matrixLLT().diagonal().array().log().sum();
  return result;
}

/// Of a wave, a squareness or an expansion, the unknowns after the blocks.
double constant_sd(const GeometricBasis& basis, const GeometricPrior& prior, int unknown) {
  if (unknown < basis.first_squareness()) {
    const int own = unknown - basis.first_wave();
    if (own % wave_unknowns < 2) return prior.wave_amplitude;
    const int axis = basis.waves[static_cast<std::size_t>(own / wave_unknowns)].axis;
    return prior.wave_turn / basis.splines[static_cast<std::size_t>(axis)].interval().width();
  }
  return unknown < basis.first_expansion() ? prior.squareness : prior.expansion;
}

/// H = A'C^-1 A + Q, factored; log|H| - log|Q|.
struct System {
  Eigen::LLT<Eigen::MatrixXd> factor;
  std::vector<BlockPrior> blocks;
  Eigen::VectorXd mean;
  double log_evidence = 0.0;
};

System build(const NormalEquations& equations, const GeometricBasis& basis, const GeometricPrior& prior) {
  System system;
  Eigen::MatrixXd h = equations.normal;
  double log_prior = 0.0;
  for (const auto& block : basis.blocks) {
    system.blocks.push_back(block_prior(basis, prior, block));
    h.block(block.first, block.first, block.size(), block.size()) += system.blocks.back().precision;
    log_prior += system.blocks.back().log_determinant;
  }
  for (int i = basis.first_wave(); i < basis.size; ++i) {
    const double sd = constant_sd(basis, prior, i);
    h(i, i) += 1.0 / (sd * sd);
    log_prior -= 2.0 * std::log(sd);
  }
  system.factor.compute(h);
  INVAR_EXPECTS(system.factor.info() == Eigen::Success, basis.size);
  system.mean = system.factor.solve(equations.right);
  const double log_h = 2.0 * system.factor.matrixLLT().diagonal().array().log().sum();
  system.log_evidence = -0.5 * (equations.constant - equations.right.dot(system.mean) + log_h - log_prior +
                                equations.log_misfit);
  return system;
}

}  // namespace

LineRows rows_of(const CondensedLine& line, const GeometricBasis& basis, const Squareness& squareness) {
  const auto points = static_cast<Eigen::Index>(line.points.size());
  const Eigen::RowVector3d beam = line.beam.direction.transpose();
  const Eigen::RowVectorXd start = beam * field_map(basis, squareness, line.beam.start, line.beam.start_tool);
  const double start_remainder = beam.dot(squareness_remainder(basis, squareness, line.beam.start));
  Eigen::MatrixXd all(points, basis.size);
  LineRows result;
  result.remainder.resize(points);
  for (Eigen::Index j = 0; j < points; ++j) {
    const auto i = static_cast<std::size_t>(j);
    all.row(j) = beam * field_map(basis, squareness, line.points[i], line.tools[i]) - start;
    result.remainder[j] = beam.dot(squareness_remainder(basis, squareness, line.points[i])) - start_remainder;
  }
  result.expansion = Eigen::VectorXd::Zero(basis.size);
  for (std::size_t e = 0; e < basis.expanding.size() && std::isfinite(line.temperature); ++e) {
    const int k = basis.expanding[e];
    result.expansion[basis.first_expansion() + static_cast<Eigen::Index>(e)] = beam[k] * beam[k];
    const double warmer = line.temperature - basis.reference_temperature;
    for (Eigen::Index j = 0; j < points; ++j)
      all(j, basis.first_expansion() + static_cast<Eigen::Index>(e)) =
          beam[k] * warmer * (line.points[static_cast<std::size_t>(j)][k] - line.beam.start[k]);
  }
  for (int c = 0; c < basis.size; ++c)
    if (all.col(c).cwiseAbs().maxCoeff() > 1e-14) result.unknowns.push_back(c);
  result.rows = all(Eigen::all, result.unknowns);
  return result;
}

void update_wave_rows(const std::vector<CondensedLine>& lines, const GeometricBasis& basis,
                      std::vector<LineRows>& rows) {
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const CondensedLine& line = lines[l];
    LineRows& own = rows[l];
    // The waves stand between the blocks and the constants, whose columns move behind them.
    const auto moved = basis.size - static_cast<int>(own.expansion.size());
    std::vector<int> unknowns;
    std::vector<Eigen::Index> kept;
    for (std::size_t i = 0; i < own.unknowns.size(); ++i) {
      const int u = own.unknowns[i];
      const bool constant = u >= basis.first_squareness() - moved;
      if (!constant && u >= basis.first_wave()) continue;
      unknowns.push_back(constant ? u + moved : u);
      kept.push_back(static_cast<Eigen::Index>(i));
    }
    std::vector<std::size_t> waves;
    for (std::size_t w = 0; w < basis.waves.size(); ++w)
      if (std::abs(line.beam.direction[basis.waves[w].axis]) > 1e-9) waves.push_back(w);
    Eigen::MatrixXd all(own.rows.rows(),
                        static_cast<Eigen::Index>(kept.size() + wave_unknowns * waves.size()));
    all.leftCols(static_cast<Eigen::Index>(kept.size())) = own.rows(Eigen::all, kept);
    for (std::size_t w = 0; w < waves.size(); ++w) {
      const AxisWave& wave = basis.waves[waves[w]];
      const double along = line.beam.direction[wave.axis];
      const Eigen::RowVector3d start = basis.wave_row(wave, line.beam.start[wave.axis]);
      const auto first = static_cast<Eigen::Index>(kept.size() + wave_unknowns * w);
      for (Eigen::Index j = 0; j < all.rows(); ++j)
        all.row(j).segment<3>(first) =
            along * (basis.wave_row(wave, line.points[static_cast<std::size_t>(j)][wave.axis]) - start);
      for (int u = 0; u < wave_unknowns; ++u)
        unknowns.push_back(basis.first_wave() + wave_unknowns * static_cast<int>(waves[w]) + u);
    }
    Eigen::VectorXd expansion = Eigen::VectorXd::Zero(basis.size);
    const auto constants = static_cast<Eigen::Index>(basis.expanding.size());
    expansion.tail(constants) = own.expansion.tail(constants);
    own.rows = std::move(all);
    own.unknowns = std::move(unknowns);
    own.expansion = std::move(expansion);
  }
}

Eigen::MatrixXd LineInformation::times(const Eigen::MatrixXd& columns) const {
  return mass.asDiagonal() * columns - cross * inner.solve(cross.transpose() * columns);
}

Eigen::MatrixXd LineInformation::square(const Eigen::MatrixXd& rows) const {
  Eigen::MatrixXd nuisances = cross.transpose() * rows;
  inner.matrixL().solveInPlace(nuisances);
  const Eigen::MatrixXd scaled = mass.cwiseSqrt().asDiagonal() * rows;
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(rows.cols(), rows.cols());
  result.selfadjointView<Eigen::Lower>().rankUpdate(scaled.transpose());
  result.selfadjointView<Eigen::Lower>().rankUpdate(nuisances.transpose(), -1.0);
  result.triangularView<Eigen::StrictlyUpper>() = result.transpose();
  return result;
}

LineInformation information_of(const CondensedLine& line, const LineRows& rows, double misfit,
                               const Eigen::VectorXd* points) {
  const auto log_determinant = [](const Eigen::LLT<Eigen::MatrixXd>& factor) {
    return 2.0 * factor.matrixLLT().diagonal().array().log().sum();
  };
  // About what the squareness' linear form leaves out.
  const Eigen::VectorXd& h = rows.remainder;
  const Eigen::VectorXd sum = line.sum - line.mass.cwiseProduct(h);
  const Eigen::VectorXd right = line.right - line.cross.transpose() * h;
  const double square = line.square - 2.0 * h.dot(line.sum) + h.dot(line.mass.cwiseProduct(h));
  // A point of weight w counts as if its reading had variance 1/w. Extra variance v at a point of mass m: its mean counts
  // m / (1 + m v), and the nuisances lose what it told of them.
  const Eigen::ArrayXd m = line.mass.array();
  Eigen::ArrayXd extra = Eigen::ArrayXd::Zero(m.size());
  if (points != nullptr) extra = (points->array().inverse() - 1.0) / m.max(1e-300);
  const auto inner_with = [&](const Eigen::ArrayXd& variance) -> Eigen::LLT<Eigen::MatrixXd> {
    const Eigen::VectorXd lost = variance / (1.0 + m * variance);
    return Eigen::LLT<Eigen::MatrixXd>{line.inner - line.cross.transpose() * lost.asDiagonal() * line.cross};
  };
  LineInformation result;
  const Eigen::ArrayXd all = extra + misfit * misfit;
  const Eigen::VectorXd share = 1.0 / (1.0 + m * all);
  const Eigen::VectorXd lost = all * share.array();
  result.mass = line.mass.cwiseProduct(share);
  result.cross = share.asDiagonal() * line.cross;
  result.inner = inner_with(all);
  const Eigen::VectorXd left = right - line.cross.transpose() * lost.cwiseProduct(sum);
  const Eigen::VectorXd nuisances = result.inner.solve(left);
  result.weighted = share.cwiseProduct(sum) - result.cross * nuisances;
  result.constant = square - sum.dot(lost.cwiseProduct(sum)) - left.dot(nuisances);
  if (misfit > 0.0)
    result.log_misfit = ((1.0 + m * all) / (1.0 + m * extra)).log().sum() + log_determinant(result.inner) -
                        log_determinant(inner_with(extra));
  return result;
}

NormalEquations assemble(const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
                         int unknowns, double misfit, const std::vector<Eigen::VectorXd>& points) {
  NormalEquations sum;
  sum.normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
  sum.right = Eigen::VectorXd::Zero(unknowns);
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const LineInformation line =
        information_of(lines[l], rows[l], misfit, points.empty() ? nullptr : &points[l]);
    sum.constant += line.constant;
    sum.log_misfit += line.log_misfit;
    const double expansion = lines[l].noise.expansion_information;
    if (expansion > 0.0) {
      sum.normal += rows[l].expansion * expansion * rows[l].expansion.transpose();
      sum.right += expansion * lines[l].noise.expansion * rows[l].expansion;
    }
    const Eigen::MatrixXd normal = line.square(rows[l].rows);
    const Eigen::VectorXd right = rows[l].rows.transpose() * line.weighted;
    const auto& columns = rows[l].unknowns;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      sum.right[columns[i]] += right[static_cast<Eigen::Index>(i)];
      for (std::size_t j = 0; j < columns.size(); ++j)
        sum.normal(columns[j], columns[i]) +=
            normal(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(i));
    }
  }
  return sum;
}

Posterior solve(const NormalEquations& equations, const GeometricBasis& basis, const GeometricPrior& prior) {
  const System system = build(equations, basis, prior);
  Posterior posterior;
  posterior.mean = system.mean;
  posterior.log_evidence = system.log_evidence;
  posterior.covariance = system.factor.solve(Eigen::MatrixXd::Identity(basis.size, basis.size));
  posterior.prior_covariance = Eigen::MatrixXd::Zero(basis.size, basis.size);
  for (std::size_t k = 0; k < basis.blocks.size(); ++k) {
    const auto& block = basis.blocks[k];
    posterior.prior_covariance.block(block.first, block.first, block.size(), block.size()) =
        numerics::solve_positive(system.blocks[k].precision,
                                 Eigen::MatrixXd::Identity(block.size(), block.size()));
  }
  for (int i = basis.first_wave(); i < basis.size; ++i)
    posterior.prior_covariance(i, i) = std::pow(constant_sd(basis, prior, i), 2);
  return posterior;
}

Posterior solve_mean(const NormalEquations& equations, const GeometricBasis& basis,
                     const GeometricPrior& prior) {
  const System system = build(equations, basis, prior);
  Posterior posterior;
  posterior.mean = system.mean;
  posterior.log_evidence = system.log_evidence;
  return posterior;
}

Eigen::LLT<Eigen::MatrixXd> factored(const NormalEquations& equations, const GeometricBasis& basis,
                                     const GeometricPrior& prior, Eigen::VectorXd& mean) {
  System system = build(equations, basis, prior);
  mean = system.mean;
  return std::move(system.factor);
}

Eigen::VectorXd told_by_others(const CondensedLine& line, const LineRows& rows, double misfit,
                               const Eigen::VectorXd& points, const Posterior& posterior) {
  // Without the line's own A'G A and A'w: (H - A'G A) theta = b - A'w. Its rows p = A theta then follow from the posterior
  // with it, S = A H^-1 A':  (I - S G) p = A theta_all - S w. The expansion that the line tells of is one more row.
  const LineInformation own = information_of(line, rows, misfit, &points);
  const Eigen::Index n = rows.rows.rows();
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(n + 1, posterior.mean.size());
  for (std::size_t i = 0; i < rows.unknowns.size(); ++i)
    all.col(rows.unknowns[i]).head(n) = rows.rows.col(static_cast<Eigen::Index>(i));
  all.row(n) = rows.expansion.transpose();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n + 1, n + 1);
  information.topLeftCorner(n, n) = own.times(Eigen::MatrixXd::Identity(n, n));
  information(n, n) = line.noise.expansion_information;
  Eigen::VectorXd weighted(n + 1);
  weighted << own.weighted, line.noise.expansion_information * line.noise.expansion;
  const Eigen::MatrixXd spread = all * posterior.covariance * all.transpose();
  const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(n + 1, n + 1) - spread * information;
  const Eigen::VectorXd told = numerics::solve_square(left, all * posterior.mean - spread * weighted);
  return told.head(n);
}

Evidence evidence(const NormalEquations& equations, const GeometricBasis& basis,
                  const GeometricPrior& prior) {
  const System system = build(equations, basis, prior);
  Evidence result;
  result.value = system.log_evidence;
  // What the readings tell about the unknowns once the prior is known: G = Q - Q H^-1 Q. In the coefficients of the splines,
  // W = K^-1 N Q^-1 G Q^-1 N' K^-1 = K^-1 N (Q^-1 - H^-1) N' K^-1, the precision of the coefficients' marginal data. Then
  //   dL/dh = 1/2 [ u' dK u - tr(dK W_kk) ],  u = K^-1 N theta_k,   F_hg = 1/2 sum_ab tr(W_ba dK_h,a W_ab dK_g,b).
  struct Part {
    std::size_t block;
    std::vector<int> strengths;
    Eigen::MatrixXd product;  // W(:, block) dK
  };
  std::vector<Eigen::Index> first;
  Eigen::Index all = 0;
  for (const auto& block : basis.blocks) {
    first.push_back(all);
    all += block.coefficients.rows();
  }
  Eigen::MatrixXd w = Eigen::MatrixXd::Zero(all, all);
  // Block by block, L^-1 has nothing above the diagonal: a third of the work of a plain inverse.
  std::vector<Eigen::MatrixXd> inverse_l;  // columns of a block, from its first row down
  for (const auto& block : basis.blocks) {
    const Eigen::Index below = basis.size - block.first;
    inverse_l.emplace_back(Eigen::MatrixXd::Identity(below, block.size()));
    system.factor.matrixLLT()
        .bottomRightCorner(below, below)
        .triangularView<Eigen::Lower>()
        .solveInPlace(inverse_l.back());
  }
  for (std::size_t b = 0; b < basis.blocks.size(); ++b) {
    const auto& own = basis.blocks[b];
    const Eigen::MatrixXd& right = system.blocks[b].solved;
    for (std::size_t a = 0; a <= b; ++a) {
      Eigen::MatrixXd middle = -inverse_l[a].bottomRows(inverse_l[b].rows()).transpose() * inverse_l[b];
      if (a == b)
        middle += numerics::solve_positive(system.blocks[b].precision,
                                           Eigen::MatrixXd::Identity(own.size(), own.size()));
      const Eigen::MatrixXd product = system.blocks[a].solved * middle * right.transpose();
      w.block(first[a], first[b], product.rows(), product.cols()) = product;
      if (a != b) w.block(first[b], first[a], product.cols(), product.rows()) = product.transpose();
    }
  }
  std::vector<Part> parts;
  for (std::size_t b = 0; b < basis.blocks.size(); ++b) {
    const auto& block = basis.blocks[b];
    const Eigen::Index n = block.coefficients.rows();
    const Eigen::VectorXd u = system.blocks[b].solved * system.mean.segment(block.first, block.size());
    for (auto& slope : coefficient_covariance_slopes(basis, prior, block.motion)) {
      const double change = 0.5 * (u.dot(slope.matrix * u) -
                                   slope.matrix.cwiseProduct(w.block(first[b], first[b], n, n)).sum());
      for (const int strength : slope.strengths) result.slope[strength] += change;
      parts.push_back({b, std::move(slope.strengths), w.middleCols(first[b], n) * slope.matrix});
    }
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const Eigen::Index at_i = first[parts[i].block];
      const Eigen::Index at_j = first[parts[j].block];
      const double sum =
          0.5 * parts[i]
                    .product.middleRows(at_j, parts[j].product.cols())
                    .cwiseProduct(parts[j].product.middleRows(at_i, parts[i].product.cols()).transpose())
                    .sum();
      for (const int h : parts[i].strengths) {
        for (const int g : parts[j].strengths) {
          result.information(h, g) += sum;
          if (i != j) result.information(g, h) += sum;
        }
      }
    }
  }
  return result;
}

Eigen::MatrixXd strength_effects(const GeometricBasis& basis, const GeometricPrior& prior,
                                 const Posterior& posterior) {
  // H theta = b and dQ = -N' K^-1 dK K^-1 N, so dtheta = H^-1 N' K^-1 dK K^-1 N theta.
  Eigen::MatrixXd effects = Eigen::MatrixXd::Zero(basis.size, strength_count);
  for (const auto& block : basis.blocks) {
    const BlockPrior own = block_prior(basis, prior, block);
    const Eigen::VectorXd u = own.solved * posterior.mean.segment(block.first, block.size());
    for (const auto& slope : coefficient_covariance_slopes(basis, prior, block.motion)) {
      const Eigen::VectorXd moved = posterior.covariance.middleCols(block.first, block.size()) *
                                    (own.solved.transpose() * (slope.matrix * u));
      for (const int strength : slope.strengths) effects.col(strength) += moved;
    }
  }
  return effects;
}

}  // namespace invar::metrology

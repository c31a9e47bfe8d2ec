#include "core/diagnosis/locate/left_over.hpp"
#include "core/diagnosis/estimate/instrument_noise.hpp"
#include "core/diagnosis/thresholds.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "core/diagnosis/dataset/in_parallel.hpp"
#include "core/diagnosis/dataset/starts.hpp"
#include "core/diagnosis/segments/windows.hpp"

namespace invar::diagnosis {

namespace {

using Series = std::vector<double>;

Series rate_of(const Series& time, const Series& values) {
  Series rate(values.size(), 0.0);
  for (std::size_t i = 1; i + 1 < values.size(); ++i)
    rate[i] = (values[i + 1] - values[i - 1]) / (time[i + 1] - time[i - 1]);
  return rate;
}

/// The mean of the past, older rows less by exp(-1) every `rows`.
Series past_of(const Series& values, double rows) {
  Series past(values.size());
  double state = values.empty() ? 0.0 : values.front();
  for (std::size_t i = 0; i < values.size(); ++i) past[i] = state += (values[i] - state) / rows;
  return past;
}

/// What acts on the machine, whatever it answers: an answer holds the noise that is to be judged.
std::vector<Series> causes(const Case& data, const physics::Outputs& simulated, std::size_t recording) {
  const auto& inputs = data.recordings[recording].inputs;
  const auto& equations = data.model.equations;
  std::string decided;  // by the model's own controller, from readings
  for (const auto& input : equations.inputs)
    if (input.symbol == equations.controlled_input) decided = input.signal;
  std::vector<Series> all;
  for (const auto& [name, values] : inputs.signals) {
    if (std::find(data.outputs.begin(), data.outputs.end(), name) != data.outputs.end()) continue;
    if (name == decided) continue;
    all.push_back(physics::bridged(inputs.time, values));
    if (data.is_time_series && (name == "reference" || name == "true_position")) {
      all.push_back(rate_of(inputs.time, all.back()));
      all.push_back(rate_of(inputs.time, all.back()));
      Series direction = all[all.size() - 2];
      for (double& v : direction) v = static_cast<double>((v > 0.0) - (v < 0.0));
      all.push_back(std::move(direction));
    }
  }
  if (data.model.plant == physics::Plant::thermal || data.model.plant == physics::Plant::equations)
    all.insert(all.end(), simulated.begin(), simulated.end());
  return all;
}

/// Appends the columns, orthonormal to all before (Gram and Schmidt, twice): what hardly differs from them says nothing.
void append(Eigen::MatrixXd& basis, std::vector<Eigen::VectorXd>& columns) {
  Eigen::Index used = basis.cols();
  basis.conservativeResize(Eigen::NoChange, used + static_cast<Eigen::Index>(columns.size()));
  for (auto& column : columns) {
    const double size = column.norm();
    for (int pass = 0; pass < 2; ++pass)
      column -= basis.leftCols(used) * (basis.leftCols(used).transpose() * column);
    if (!(column.norm() > 1e-4 * size) || used * 6 > basis.rows()) continue;
    basis.col(used++) = column.normalized();
  }
  basis.conservativeResize(Eigen::NoChange, used);
}

/// What is recorded of the causes, and what surfaces over them.
struct Surface {
  std::vector<Eigen::VectorXd> causes;  // standardised, over all rows of all recordings
  Eigen::MatrixXd basis;                // orthonormal; constants and copies drop out
};

Surface surface(const Case& data, const std::vector<physics::Outputs>& simulated) {
  Eigen::Index rows = 0;
  for (const auto& recording : data.recordings) rows += static_cast<Eigen::Index>(recording.inputs.rows());
  std::vector<Eigen::VectorXd> direct, past;
  Eigen::Index at = 0;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    const auto own = causes(data, simulated[r], r);
    const auto n = static_cast<Eigen::Index>(data.recordings[r].inputs.rows());
    const auto put = [&](std::vector<Eigen::VectorXd>& columns, std::size_t k, const Series& values) {
      if (columns.size() <= k) columns.resize(k + 1, Eigen::VectorXd::Zero(rows));
      for (Eigen::Index i = 0; i < n; ++i) {
        const double v = values[static_cast<std::size_t>(i)];
        columns[k](at + i) = std::isfinite(v) ? v : 0.0;
      }
    };
    for (std::size_t k = 0; k < own.size(); ++k) {
      put(direct, k, own[k]);
      std::size_t memory = 0;
      if (data.is_time_series)
        for (const double span : {3.0, 20.0, 120.0}) put(past, 3 * k + memory++, past_of(own[k], span));
    }
    at += n;
  }
  const auto standardise = [](Eigen::VectorXd& column) {
    column.array() -= column.mean();
    const double size = std::sqrt(column.squaredNorm() / static_cast<double>(column.size()));
    column /= size > 1e-300 ? size : 1.0;
  };
  for (auto& column : direct) standardise(column);
  std::vector<Eigen::VectorXd> all{Eigen::VectorXd::Ones(rows)};
  all.insert(all.end(), direct.begin(), direct.end());
  for (std::size_t i = 0; i < direct.size(); ++i)
    for (std::size_t k = i; k < direct.size(); ++k) all.emplace_back(direct[i].cwiseProduct(direct[k]));
  all.insert(all.end(), past.begin(), past.end());
  Surface made{std::move(direct), Eigen::MatrixXd{rows, 0}};
  append(made.basis, all);
  return made;
}

/// Has this number one value everywhere, if the model is right? A term's does, and the user's own; not where a state began.
/// Beside names that idealise what a machine does its own numbers seem to change, but for equations, which say it all.
bool is_of_a_law(const Case& data, const Fit& fit, const Freedom& f) {
  const std::size_t given = data.model.terms.size();
  if (f.where == Freedom::Where::term) return f.term >= given;
  const bool is_alone = fit.model.terms.size() == given;
  return f.where == Freedom::Where::parameter && data.is_time_series &&
         (is_alone || data.model.plant == physics::Plant::equations) &&
         !is_initial(fit.model.parameters[f.index]);
}

/// What each number of a law does to an output, were it to change with time or with a cause: a law has the same numbers
/// everywhere, and one that is not the right one needs others here than there.
std::vector<Eigen::VectorXd> changing_effects(const Case& data, const Fit& fit, std::size_t output,
                                              const std::vector<Eigen::VectorXd>& causes) {
  Eigen::Index rows = 0;
  for (const auto& recording : data.recordings) rows += static_cast<Eigen::Index>(recording.inputs.rows());
  constexpr std::size_t most_products = 120;  // beyond, a machine of many states takes minutes
  std::vector<Eigen::VectorXd> all;
  for (std::size_t k = 0; k < fit.free.size() && fit.columns.rows() > 0; ++k) {
    const auto& f = fit.free[k];
    if (!is_of_a_law(data, fit, f)) continue;
    const Eigen::VectorXd column = fit.columns.col(static_cast<Eigen::Index>(k));
    Eigen::VectorXd effect(rows);
    Eigen::Index from = 0, to = 0;
    for (const auto& recording : data.recordings) {
      const auto n = static_cast<Eigen::Index>(recording.inputs.rows());
      const auto o = static_cast<Eigen::Index>(output),
                 outputs = static_cast<Eigen::Index>(data.outputs.size());
      for (Eigen::Index i = 0; i < n; ++i) {
        const double v = column(from + o * n + i);
        effect(to + i) = std::isfinite(v) ? v : 0.0;
      }
      from += outputs * n, to += n;
    }
    all.push_back(effect);
    if (causes.size() * fit.free.size() > most_products) continue;
    for (const auto& cause : causes) {
      all.emplace_back(effect.cwiseProduct(cause));
      all.emplace_back(effect.cwiseProduct(cause).cwiseProduct(cause));
    }
  }
  return all;
}

}  // namespace

namespace {

/// Rows from which on something can be said of their neighbours and their loudness.
constexpr int enough_rows = 300;

/// measured - simulated of one output, recording by recording; values off by more than six sigma are brought nearer.
std::vector<Series> left_of(const Case& data, const std::vector<physics::Outputs>& simulated,
                            std::size_t output) {
  std::vector<Series> left;
  Series values;
  for (std::size_t r = 0; r < data.recordings.size(); ++r) {
    left.push_back(data.recordings[r].measured[output]);
    for (std::size_t i = 0; i < left[r].size(); ++i) left[r][i] -= simulated[r][output][i];
    values.insert(values.end(), left[r].begin(), left[r].end());
  }
  const double level = median(values), most = 6.0 * robust_sigma(values);
  for (auto& one : left)
    for (double& v : one) v = std::clamp(v - level, -most, most);
  return left;
}

struct MeanSquare {
  double square = 0.0, rows = 0.0;
};

MeanSquare mean_square(const std::vector<Series>& all) {
  MeanSquare mean;
  for (const auto& one : all)
    for (double v : one)
      if (std::isfinite(v)) mean.square += v * v, mean.rows += 1.0;
  mean.square /= mean.rows;
  return mean;
}

/// Is a good part of what is left made by the steps of a reading? That goes with the output itself as a saw does.
bool is_rounding(const Case& data, const std::vector<Series>& left, std::size_t output) {
  double step = 0.0;
  for (const auto& recording : data.recordings)
    step = std::max(step, counting_step(recording.measured[output]));
  return step * step / 12.0 > thresholds::made_by_rounding * mean_square(left).square;
}

/// What the user gave, or what cannot be told from the row before, whichever is more.
double noise_of(const Case& data, const Weighing& weighing, std::size_t output) {
  return std::fmax(data.given_noise[output], weighing.filters[output].sigma);
}

/// A share of the power that something explains, beyond what it explains of the same series shifted against the
/// recording; each recording is turned round by the share of itself that `share_at` is given. 0: no more than chance.
template <class ShareAt>
double beyond_chance(ShareAt share_at) {
  constexpr int shifts = 30;
  std::array<double, shifts + 1> shares{};  // as it stands first
  in_parallel(shares.size(), [&](std::size_t k) {
    shares[k] = share_at(k == 0 ? 0.0 : 0.1 + 0.8 * (static_cast<double>(k) - 0.5) / shifts);
  });
  double mean = 0.0, square = 0.0, largest = 0.0;
  for (std::size_t k = 1; k < shares.size(); ++k) {
    mean += shares[k] / shifts, square += shares[k] * shares[k] / shifts;
    largest = std::max(largest, shares[k]);
  }
  const double spread = std::sqrt(std::max(0.0, square - mean * mean)), now = shares[0];
  return now > std::max(largest, mean + 4.0 * spread) && mean < 1.0 ? (now - mean) / (1.0 - mean) : 0.0;
}

/// The series one behind the other, each turned round; the mean taken away, 0 where nothing was measured.
Eigen::VectorXd turned(const std::vector<Series>& left, double shift) {
  Series all;
  for (const auto& one : left) {
    const std::size_t n = one.size(), by = static_cast<std::size_t>(shift * static_cast<double>(n));
    for (std::size_t i = 0; i < n; ++i) all.push_back(one[(i + by) % n]);
  }
  Eigen::VectorXd column = Eigen::Map<Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
  column = column.unaryExpr([](double v) { return std::isfinite(v) ? v : 0.0; }).eval();
  column.array() -= column.mean();
  return column;
}

/// The share that a smooth surface takes.
double share_on(const Eigen::MatrixXd& basis, const Eigen::VectorXd& column) {
  const double all = column.squaredNorm();
  return all > 0.0 ? (basis.transpose() * column).squaredNorm() / all : 0.0;
}

/// The share that goes with a variable in whatever way, as fine as it may be: rows that are neighbours in its order are
/// alike, though recorded at other times (von Neumann's ratio).
double share_along(const std::vector<Eigen::Index>& order, const Eigen::VectorXd& column) {
  const double all = 2.0 * column.squaredNorm();
  double apart = 0.0;
  for (std::size_t i = 1; i < order.size(); ++i)
    apart += std::pow(column(order[i]) - column(order[i - 1]), 2);
  return all > 0.0 ? 1.0 - apart / all : 0.0;
}

}  // namespace

std::vector<double> followed_share(const Case& data, const Fit& fit) {
  const auto simulated = simulate(data, fit.model);
  auto [causes, common] = surface(data, simulated);
  std::vector<std::vector<Eigen::Index>> orders;
  for (const auto& cause : causes) {
    auto& order = orders.emplace_back(static_cast<std::size_t>(cause.size()));
    std::iota(order.begin(), order.end(), 0);
    // Rows of one value stand as if shuffled: neighbours in time are alike by the colour of the noise alone.
    const auto shuffled = [](Eigen::Index i) { return static_cast<std::uint32_t>(i) * 2654435761U; };
    std::sort(order.begin(), order.end(), [&](auto a, auto b) {
      return cause(a) != cause(b) ? cause(a) < cause(b) : shuffled(a) < shuffled(b);
    });
  }
  if (data.is_time_series) {
    Eigen::VectorXd time(common.rows());
    Eigen::Index at = 0;
    for (const auto& recording : data.recordings)
      for (double t : recording.inputs.time) time(at++) = t;
    time.array() -= time.mean();
    causes.emplace_back(time / std::max(1e-300, time.cwiseAbs().maxCoeff()));
  }
  std::vector<double> shares;
  // A few rows of a slow course go with anything.
  if (data.is_time_series && common.rows() < enough_rows)
    return std::vector<double>(data.outputs.size(), 0.0);
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto left = left_of(data, simulated, o);
    if (data.is_time_series &&
        mean_square(left).rows < enough_rows) {  // a few readings among many rows are no more
      shares.push_back(0.0);
      continue;
    }
    Eigen::MatrixXd basis = common;
    auto changing = changing_effects(data, fit, o, causes);
    append(basis, changing);
    double share = beyond_chance([&](double shift) { return share_on(basis, turned(left, shift)); });
    const bool has_saw = is_rounding(data, left, o);
    for (const auto& order : orders)
      if (!has_saw && order.size() >= enough_rows)
        share = std::max(
            share, beyond_chance([&](double shift) { return share_along(order, turned(left, shift)); }));
    shares.push_back(share);
  }
  return shares;
}

bool goes_with_recording(const Case& data, const Fit& with, const Fit& without) {
  if (data.model.controller) return false;
  const auto before = followed_share(data, without);
  if (!(*std::max_element(before.begin(), before.end()) > 0.1)) return false;
  const auto after = followed_share(data, with);
  for (std::size_t o = 0; o < before.size(); ++o)
    if (before[o] > 0.1 && after[o] < 0.5 * before[o]) return true;
  return false;
}

namespace {

/// Is what is `expected` of the rows' power a matter of how much is read? Noise of an instrument often grows with its reading.
bool goes_with_reading(const std::vector<physics::Outputs>& simulated, std::size_t output,
                       const Eigen::VectorXd& expected) {
  Eigen::VectorXd read(expected.size());
  Eigen::Index at = 0;
  for (const auto& outputs : simulated)
    for (const double v : outputs[output]) read(at++) = std::abs(v);
  read.array() -= read.mean();
  const Eigen::VectorXd power = expected.array() - expected.mean();
  return read.dot(power) > thresholds::goes_with_reading * read.norm() * power.norm();
}

/// Are rows that are `expected` to be loud alike from one to the next? Else their instrument is louder there.
bool is_related(const std::vector<Series>& left, const Eigen::VectorXd& expected, double loud) {
  double product = 0.0, square = 0.0, fourth = 0.0;
  Eigen::Index at = 0;
  for (const auto& one : left)
    for (std::size_t i = 0; i < one.size(); ++i, ++at) {
      if (i == 0 || expected(at) < loud || !std::isfinite(one[i]) || !std::isfinite(one[i - 1])) continue;
      const double both = one[i] * one[i - 1];
      product += both, square += one[i] * one[i], fourth += both * both;
    }
  // The sigma of the sum of products, for unrelated rows, is the square root of the sum of their squares.
  return std::abs(product) > thresholds::related_sigmas * std::sqrt(fourth) &&
         std::abs(product) > thresholds::related_share * square;
}

}  // namespace

bool is_louder_in_motion(const Case& data, const Fit& fit) {
  constexpr double least = 5.0;  // coarse steps of a reading make it half as loud again at most
  const auto simulated = simulate(data, fit.model);
  const auto basis = surface(data, simulated).basis;
  if (basis.rows() < enough_rows) return false;
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto left = left_of(data, simulated, o);
    auto power = left;
    for (auto& one : power)
      for (double& v : one) v *= v;
    if (!(beyond_chance([&](double shift) { return share_on(basis, turned(power, shift)); }) > 0.0)) continue;
    const Eigen::VectorXd now = turned(power, 0.0), expected = basis * (basis.transpose() * now);
    Series sorted(expected.data(), expected.data() + expected.size());
    std::sort(sorted.begin(), sorted.end());
    const double low = sorted[sorted.size() / 5], high = sorted[sorted.size() * 4 / 5];
    double quiet = 0.0, quiet_rows = 0.0, loud = 0.0, loud_rows = 0.0;
    Eigen::Index at = 0;
    for (const auto& one : power)
      for (double v : one) {
        const double e = expected(at++);
        if (!std::isfinite(v)) continue;
        if (e <= low) quiet += v, quiet_rows += 1.0;
        if (e >= high) loud += v, loud_rows += 1.0;
      }
    if (loud * quiet_rows > least * quiet * loud_rows &&
        (!goes_with_reading(simulated, o, expected) || is_related(left, expected, high)))
      return true;
  }
  return false;
}

std::vector<double> far_share(const Case& data, const Fit& fit, double times) {
  constexpr double trifle = 0.005;  // of what the output does: integration and rounding leave as much
  std::vector<double> shares(data.outputs.size(), 0.0);
  if (data.model.plant != physics::Plant::thermal && data.model.plant != physics::Plant::equations)
    return shares;
  const auto simulated = simulate(data, fit.model);
  const auto weighing = weigh(data, simulated);
  const auto spread = [](const std::vector<Series>& all) {
    double sum = 0.0, square = 0.0, rows = 0.0;
    for (const auto& one : all)
      for (double v : one)
        if (std::isfinite(v)) sum += v, square += v * v, rows += 1.0;
    return rows > enough_rows ? std::sqrt(std::max(0.0, square / rows - sum * sum / (rows * rows))) : 0.0;
  };
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    std::vector<Series> measured;
    for (const auto& recording : data.recordings) measured.push_back(recording.measured[o]);
    const double left = spread(left_of(data, simulated, o)), noise = noise_of(data, weighing, o);
    if (left > times * noise && left > trifle * spread(measured)) shares[o] = 1.0 - std::pow(noise / left, 2);
  }
  return shares;
}

std::vector<double> excess_over_noise(const Case& data, const Fit& fit) {
  constexpr double by_chance = 0.1;
  std::vector<double> all(data.outputs.size(), 0.0);
  if (!data.is_time_series || !data.model.equations.controlled_input.empty()) return all;
  const auto simulated = simulate(data, fit.model);
  const auto weighing = weigh(data, simulated);
  for (std::size_t o = 0; o < all.size(); ++o) {
    if (!std::isfinite(data.given_noise[o])) continue;
    const auto [square, rows] = mean_square(left_of(data, simulated, o));
    const double noise = noise_of(data, weighing, o);
    if (const double beyond = square / (noise * noise) - 1.0; rows > enough_rows / 2 && beyond > by_chance)
      all[o] = beyond;
  }
  return all;
}

bool is_above_noise(const Case& data, const Fit& fit) {
  // Who writes down his equations and his noise has said what a model that is whole leaves.
  const bool is_own =
      data.model.plant == physics::Plant::equations && data.model.equations.controlled_input.empty();
  const double most = is_own ? 1.25 : 2.0;
  const auto simulated = simulate(data, fit.model);
  for (std::size_t o = 0; o < data.outputs.size(); ++o) {
    const auto left = left_of(data, simulated, o);
    const auto [square, rows] = mean_square(left);
    // A loop repeats the noise of its reading, at some frequencies more than once; and what is white may be a worse
    // instrument than believed.
    if (data.is_time_series && rows > enough_rows && std::sqrt(square) > most * data.given_noise[o] &&
        independent_share(left) < 0.3)
      return true;
  }
  return false;
}

}  // namespace invar::diagnosis

#include "tools/history/drift.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace invar::tools {

namespace {

constexpr double sure = 0.01;  // chance below which a name moved, over all its places

/// The line through all values by least squares with their sigmas (alike where these are not known), and the variance a
/// second by which neighbours in time differ beyond it.
void tell_rate(NumberHistory& number, const std::vector<double>& times) {
  double sw = 0.0, st = 0.0, sv = 0.0;
  const auto weight = [&](std::size_t i) {
    return number.sigmas[i] > 0.0 ? 1.0 / (number.sigmas[i] * number.sigmas[i]) : 1.0;
  };
  for (std::size_t i = 0; i < times.size(); ++i)
    sw += weight(i), st += weight(i) * times[i], sv += weight(i) * number.values[i];
  double stt = 0.0, stv = 0.0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double t = times[i] - st / sw;
    stt += weight(i) * t * t;
    stv += weight(i) * t * (number.values[i] - sv / sw);
  }
  if (stt <= 0.0) return;
  number.rate = stv / stt;
  number.rate_sigma = number.sigmas.front() > 0.0 ? 1.0 / std::sqrt(stt) : 0.0;
  double wander = 0.0, count = 0.0;
  for (std::size_t i = 1; times.size() > 2 && i < times.size(); ++i) {
    const double seconds = times[i] - times[i - 1];
    if (!(seconds > 0.0)) continue;
    const double beyond = number.values[i] - number.values[i - 1] - number.rate * seconds;
    const double noise =
        number.sigmas[i] > 0.0 ? std::pow(std::hypot(number.sigmas[i], number.sigmas[i - 1]), 2) : 0.0;
    wander += (beyond * beyond - noise) / seconds;
    count += 1.0;
  }
  number.wander = count > 0.0 ? std::max(0.0, wander / count) : 0.0;
}

void judge(NameHistory& name) {
  double best = -1.0;
  double least_chance = 1.0;
  bool known = false, beyond = false;
  for (std::size_t k = 0; k < name.numbers.size(); ++k) {
    const NumberHistory& one = name.numbers[k];
    name.moved_rms += one.moved * one.moved / static_cast<double>(name.numbers.size());
    const double ratio = one.sigma > 0.0 ? std::abs(one.moved) / one.sigma : 0.0;
    if (one.sigma > 0.0) known = true;
    if (ratio > best) best = ratio, name.farthest = k;
    beyond = beyond || ratio > 1.0;
    least_chance = std::min(least_chance, one.chance);
  }
  name.moved_rms = std::sqrt(name.moved_rms);
  using Verdict = NameHistory::Verdict;
  name.verdict = !known                                                           ? Verdict::not_known
                 : least_chance * static_cast<double>(name.numbers.size()) < sure ? Verdict::moved
                 : beyond                                                         ? Verdict::more_than_sigma
                                                                                  : Verdict::still;
}

}  // namespace

std::vector<NameHistory> histories_of(const std::vector<std::vector<CalibratedNumber>>& numbers,
                                      const std::vector<double>& times) {
  std::vector<NameHistory> names;
  for (std::size_t k = 0; k < numbers.front().size(); ++k) {
    NumberHistory one;
    one.last = numbers.back()[k];
    for (const auto& calibration : numbers) {
      one.values.push_back(calibration[k].value);
      one.sigmas.push_back(calibration[k].sigma);
    }
    one.moved = one.values.back() - one.values.front();
    one.sigma = numbers.size() > 1 ? std::hypot(one.sigmas.front(), one.sigmas.back())
                                   : std::numeric_limits<double>::quiet_NaN();
    if (one.sigma > 0.0) one.chance = std::erfc(std::abs(one.moved) / one.sigma / std::numbers::sqrt2);
    tell_rate(one, times);
    auto at = std::find_if(names.begin(), names.end(),
                           [&](const NameHistory& n) { return n.name == one.last.name; });
    if (at == names.end()) {
      names.push_back({one.last.name, one.last.unit, one.last.is_error, {}, 0, 0.0, {}});
      at = names.end() - 1;
    }
    at->numbers.push_back(std::move(one));
  }
  for (NameHistory& name : names) judge(name);
  return names;
}

Due due_for(const std::vector<NameHistory>& names, double accuracy) {
  Due due;
  for (const NameHistory& name : names) {
    if (!name.is_error || name.numbers.front().values.size() < 2) continue;
    double still = 0.0, wander = 0.0, rate = 0.0;
    const auto n = static_cast<double>(name.numbers.size());
    for (const NumberHistory& one : name.numbers) {
      if (!std::isfinite(one.sigmas.back())) continue;
      still += one.sigmas.back() * one.sigmas.back() / n;
      wander += one.wander / n;
      // What a line claims to move by noise alone is in the sigma of its rate already.
      rate += std::max(one.rate * one.rate, one.rate_sigma * one.rate_sigma) / n;
    }
    // 4 (still + wander h + rate h^2) = accuracy^2
    const double room = 0.25 * accuracy * accuracy - still;
    double after = std::numeric_limits<double>::infinity();
    if (room <= 0.0)
      after = 0.0;
    else if (rate > 0.0)
      after = 2.0 * room / (wander + std::sqrt(wander * wander + 4.0 * rate * room));
    else if (wander > 0.0)
      after = room / wander;
    if (!due.known || after < due.after) due = {true, after, name.name, 2.0 * std::sqrt(still)};
  }
  return due;
}

}  // namespace invar::tools

#include "core/diagnosis/locate/lines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/diagnosis/dataset/statistics.hpp"

namespace invar::diagnosis {

std::vector<double> power_of(const Spectrum& spectrum, std::size_t bins) {
  std::vector<double> power(bins);
  for (std::size_t k = 0; k < bins; ++k) power[k] = std::norm(spectrum[k]);
  return power;
}

namespace {

/// The level of a power spectrum about each bin of from..to - 1, whatever peaks stand there.
std::vector<double> levels(const std::vector<double>& power, std::size_t from, std::size_t to) {
  std::vector<double> level(power.size(), 0.0);
  for (std::size_t block = from; block < to;) {
    const std::size_t half = std::max<std::size_t>(12, block / 4);
    const std::size_t a = block > half + from ? block - half : from, b = std::min(to, block + half);
    const double local = median(
        {power.begin() + static_cast<std::ptrdiff_t>(a), power.begin() + static_cast<std::ptrdiff_t>(b)});
    const std::size_t until = std::min(to, block + std::max<std::size_t>(1, half / 4));
    for (; block < until; ++block) level[block] = local;
  }
  return level;
}

}  // namespace

std::vector<double> peaks(const std::vector<double>& power, std::size_t from, std::size_t to,
                          std::size_t most) {
  std::vector<std::pair<double, double>> found;
  to = std::min(to, power.size() - 1);
  const auto level = levels(power, from, to);
  for (std::size_t k = std::max<std::size_t>(1, from); k + 1 < to; ++k)
    if (power[k] > power[k - 1] && power[k] >= power[k + 1] && level[k] > 0.0) {
      // The top of the parabola through three bins.
      const double bend = power[k - 1] - 2.0 * power[k] + power[k + 1];
      const double shift = bend < 0.0 ? 0.5 * (power[k - 1] - power[k + 1]) / bend : 0.0;
      found.emplace_back(power[k] / level[k], static_cast<double>(k) + shift);
    }
  std::sort(found.rbegin(), found.rend());
  std::vector<double> places;
  for (const auto& [height, place] : found) {
    if (places.size() >= most || height < 6.0) break;
    places.push_back(place);
  }
  return places;
}

namespace {

/// The spectrum of a series that waves for long, its bin `place` between the whole ones.
Complex between(const Spectrum& spectrum, double place) {
  const auto k = static_cast<std::size_t>(place);
  const Complex a = spectrum[k], b = spectrum[k + 1];
  if (!(std::abs(a) > 0.0) || !(std::abs(b) > 0.0)) return a;
  // Neighbours of a padded spectrum turn against each other: sizes and turns are interpolated apart.
  const double share = place - std::floor(place), turn = std::arg(b / a);
  return std::polar((1.0 - share) * std::abs(a) + share * std::abs(b), std::arg(a) + share * turn);
}

struct Square {
  double place = 0.0, phase = 0.0, gain = 0.0;  // bin, phase where the spectrum begins [rad]
};

/// The square wave about `place` that would explain most. Its odd waves count together, each with its size and phase and by
/// the noise where it stands: in a closed loop the higher ones may stand out more than the first. `answer`: the power of
/// the answer to a push, bin by bin.
Square square_at(const Spectrum& spectrum, const std::vector<double>& answer,
                 const std::vector<double>& level, double place) {
  constexpr int waves = 8, phases = 128;
  const auto top = static_cast<double>(level.size() - 2);
  double expected = 0.0;
  std::array<Complex, waves> part{};
  for (int wave = 0; wave < waves; ++wave) {
    const double order = 2.0 * wave + 1.0, bin = order * place;
    if (bin >= top) break;
    const auto k = static_cast<std::size_t>(bin);
    const double worth = level[k] > 0.0 ? answer[k] / level[k] : 0.0;
    part[static_cast<std::size_t>(wave)] = between(spectrum, bin) * worth * Complex{0.0, 1.0} / order;
    expected += answer[k] * worth / (order * order);
  }
  Square best{place, 0.0, 0.0};
  for (int i = 0; i < phases && expected > 0.0; ++i) {
    const double phase = 2.0 * std::numbers::pi * i / phases;
    const Complex back = std::polar(1.0, -phase), twice = back * back;
    Complex turn = back;
    double sum = 0.0;
    for (const auto& one : part) sum += (one * turn).real(), turn *= twice;
    if (const double gain = sum > 0.0 ? sum * sum / expected : 0.0; gain > best.gain)
      best.gain = gain, best.phase = phase;
  }
  return best;
}

/// Square waves of which a line of the spectrum may be the first, third, fifth or seventh wave, best first.
std::vector<Square> squares(const Spectrum& spectrum, const std::vector<double>& answer,
                            const std::vector<double>& level, const std::vector<double>& lines) {
  std::vector<Square> found;
  for (const double line : lines)
    for (const double order : {1.0, 3.0, 5.0, 7.0}) {
      if (line / order < 8.0) break;
      Square best;
      for (double off = -0.4; off < 0.41; off += 0.05)
        if (const auto one = square_at(spectrum, answer, level, line / order + off); one.gain > best.gain)
          best = one;
      const auto same = std::find_if(found.begin(), found.end(),
                                     [&](const Square& s) { return std::abs(s.place - best.place) < 2.0; });
      if (same == found.end())
        found.push_back(best);
      else if (best.gain > same->gain)
        *same = best;
    }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.gain > b.gain; });
  if (found.size() > 2) found.resize(2);
  return found;
}

}  // namespace

Lines lines_of(const std::vector<double>& time, std::vector<double> force,
               const std::vector<std::vector<double>>& responses) {
  Lines found;
  const std::size_t rows = force.size(), size = power_of_two(4 * rows);
  const double period = (time.back() - time.front()) / static_cast<double>(rows - 1);
  // Tapered: what a strong line leaks must not be the level that others, or itself, are held against.
  for (std::size_t i = 0; i < rows; ++i)
    force[i] *=
        1.0 - std::cos(2.0 * std::numbers::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(rows));
  const auto spectrum = transform(std::move(force), size);
  const auto power = power_of(spectrum, size / 2);
  const double hertz = 1.0 / (static_cast<double>(size) * period);
  const auto lines = peaks(power, 8, power.size(), 6);
  for (std::size_t k = 0; k < std::min<std::size_t>(3, lines.size()); ++k)
    found.frequency.push_back(lines[k] * hertz);
  const auto answer = answer_power(responses, size);
  // A slow wave is hardly narrower than its neighbourhood, and where a loop holds against it no peak stands out: the
  // frequency of the greatest likelihood stays as well.
  const double cycle = static_cast<double>(size) / static_cast<double>(rows);  // bins of one in the recording
  double likeliest = 0.0, place = 0.0;
  for (auto k = static_cast<std::size_t>(2.0 * cycle); k < power.size(); ++k)
    if (answer[k] > 0.0 && power[k] > likeliest * answer[k])
      likeliest = power[k] / answer[k], place = static_cast<double>(k);
  if (place > 0.0 &&
      std::none_of(lines.begin(), lines.begin() + std::min<std::ptrdiff_t>(3, std::ssize(lines)),
                   [&](double line) { return std::abs(line - place) < 0.5 * cycle; }))
    found.frequency.push_back(place * hertz);
  for (const auto& square : squares(spectrum, answer, levels(power, 8, power.size() - 1), lines)) {
    const double turns = square.place * hertz * time.front();
    found.squares.emplace_back(
        square.place * hertz,
        std::remainder(square.phase - 2.0 * std::numbers::pi * turns, 2.0 * std::numbers::pi));
  }
  return found;
}

}  // namespace invar::diagnosis

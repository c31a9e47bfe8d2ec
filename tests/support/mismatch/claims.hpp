// Claims of a diagnosis beside what was true: wrong names, and whether the stated probabilities mean what they say.
#pragma once

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/screen.hpp"

namespace invar::test::mismatch {

/// From here on a wrong name is a confident one.
inline constexpr double confident = 0.9;

class Claims {
 public:
  /// `credit` of the name: 1 right, 0.5 a relative, 0 wrong. What goes without a name is no claim.
  void add(const diagnosis::Finding& finding, double still_follows, double credit, const std::string& of,
           bool of_many) {
    if (!finding.term.curve.knots.empty() || finding.stand_in != nullptr) return;
    const double p = finding.probability, held = credit > 0.9 ? 1.0 : 0.0;
    auto& bin = bins_[static_cast<std::size_t>(std::min(9.0, 10.0 * p))];
    ++bin.count, bin.said += p, bin.held += held;
    brier_ += std::pow(p - held, 2);
    if (credit == 0.0) ++wrong_;
    if (credit == 0.0 && p >= confident) ++confident_wrong_;
    if (!file_.is_open()) return;
    double others = 0.0;
    for (const auto& a : finding.alternatives) others += std::exp(std::min(0.0, 0.5 * a.log_odds));
    file_ << of << ' ' << finding.term.info->name << ' ' << p << ' ' << others << ' ' << finding.gain << ' '
          << still_follows << ' ' << credit << ' ' << finding.other_shape << ' '
          << (of_many ? finding.share : 1.0) << ' ' << finding.relatives << '\n';
  }
  /// One line a claim is added to this file: case, name, probability, odds of the other names, gain, share left, credit,
  /// share that a freer shape explains better, share of the mismatch (1: the only
  /// one), odds of relatives.
  void write_to(const std::string& file) { file_.open(file, std::ios::app); }

  void print() const {
    int claims = 0;
    double off = 0.0;  // expected calibration error, times the claims
    for (const auto& bin : bins_) {
      claims += bin.count;
      off += std::abs(bin.said - bin.held);
      if (bin.count > 0)
        std::printf("said %.3f held %.3f of %d\n", bin.said / bin.count, bin.held / bin.count, bin.count);
    }
    if (claims == 0) return;
    std::printf(
        "Brier %.4f, expected calibration error %.4f over %d claims; %d wrong names, %d of them with %.1f or "
        "more\n",
        brier_ / claims, off / claims, claims, wrong_, confident_wrong_, confident);
  }

 private:
  struct Bin {
    int count = 0;
    double said = 0.0, held = 0.0;
  };
  std::array<Bin, 10> bins_{};
  double brier_ = 0.0;
  int wrong_ = 0, confident_wrong_ = 0;
  std::ofstream file_;
};

}  // namespace invar::test::mismatch

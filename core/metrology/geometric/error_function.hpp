// ErrorFunction: one error motion of a simulated machine as a function of its axis: polynomial, harmonics,
// table.
#pragma once

#include <vector>

namespace invar::metrology {

/// f(q) = sum_k c_k q^k + sum_h A_h sin(2 pi q / P_h + phi_h) + table(q), in m or rad; q in m. The table is
/// interpolated by cubic Hermite pieces (slopes by finite differences, end values held outside). Evaluation
/// is real-time: no allocation, no throw.
class ErrorFunction {
 public:
  struct Harmonic {
    double amplitude = 0.0;
    double period = 1.0;  // m
    double phase = 0.0;   // rad
  };

  ErrorFunction() = default;
  /// The same value everywhere.
  explicit ErrorFunction(double constant) : ErrorFunction{{constant}, {}} {}
  /// Precondition: periods above 0; table positions ascending, as many values as positions, none or at least
  /// two.
  ErrorFunction(std::vector<double> polynomial, std::vector<Harmonic> harmonics,
                std::vector<double> table_positions = {}, std::vector<double> table_values = {});

  [[nodiscard]] double operator()(double q) const noexcept;
  [[nodiscard]] bool is_zero() const noexcept {
    return polynomial_.empty() && harmonics_.empty() && positions_.empty();
  }

 private:
  std::vector<double> polynomial_;
  std::vector<Harmonic> harmonics_;
  std::vector<double> positions_;
  std::vector<double> values_;
  std::vector<double> slopes_;
};

}  // namespace invar::metrology

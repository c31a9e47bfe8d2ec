// Displacement lines: what a laser read, and each line condensed to the equations it gives.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

namespace invar::metrology {

/// One reading of a displacement line. All in m.
struct Reading {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // commanded
  Eigen::Vector3d tool = Eigen::Vector3d::Zero();      // offset of the reflector
  double displacement = 0.0;                           // along the beam, zero at the line's first reading
  int direction = 1;                                   // sense of the motion along the line, +1 or -1
  double temperature =
      std::numeric_limits<double>::quiet_NaN();  // degC, of the machine; NaN where not measured
};

/// The readings of one set-up of the laser, in the order of measurement.
struct DisplacementLine {
  std::string name;
  std::vector<Reading> readings;
};

/// From the first commanded point to the one farthest from it.
struct Beam {
  Eigen::Vector3d start = Eigen::Vector3d::Zero();  // m, with its tool offset below
  Eigen::Vector3d start_tool = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction =
      Eigen::Vector3d::Zero();  // unit vector in the machine frame; zero for a line without length
  double length = 0.0;          // m
};
Beam beam_of(const DisplacementLine& line);

/// How one line disturbs its readings y = mean of its point + reversal + drift + expansion + steps + noise.
struct LineNoise {
  double noise = 0.0;     // m, sd of one reading
  double degrees = 0.0;   // degrees of freedom behind it
  double reversal = 0.0;  // m, reading forward minus reading backward, mean over the line
  double drift = 0.0;     // m, end minus beginning of the measurement
  /// Expansion of the length along the beam [1/K], from temperatures that changed within the line, with its information
  /// (K^2). It reduces readings to the line's mean temperature. Information 0 where the temperature stood still.
  double expansion = 0.0;
  double expansion_information = 0.0;
  int readings = 0;
  int outliers = 0;
  std::vector<int> breaks;  // rows (of this line) before which the count jumped
};

/// Information of a line about its reversal [m], reading forward minus backward at `places` along the beam, straight in between.
/// -2 log likelihood = constant - 2 weighted'r + r' information r, all else marginalised. Empty where no place was read both
/// ways.
struct LineReversal {
  Eigen::VectorXd places;  // m from the start
  Eigen::VectorXd values;  // m, smoothed by what the lines expect together
  Eigen::MatrixXd information;
  Eigen::VectorXd weighted;
};

/// A line condensed without loss. The beam-wise errors at its J distinct points are e = d.(e(P_j) - e(S)). Its q nuisances n
/// are reversal, drift, steps, expansion and zero point, with their prior in `inner`:
///   -2 log likelihood = square - 2 sum'e - 2 right'n + e' mass e + 2 e' cross n + n' inner n.
/// Units 1/m^2, 1/m. `information_of` marginalises n and counts points that do not fit in.
struct CondensedLine {
  std::string name;
  Beam beam;
  std::vector<Eigen::Vector3d> points;  // J commanded positions
  std::vector<Eigen::Vector3d> tools;   // J
  double temperature =
      std::numeric_limits<double>::quiet_NaN();  // degC, mean over the readings; NaN: not measured
  Eigen::VectorXd mass;                          // J, diagonal
  Eigen::VectorXd sum;                           // J
  Eigen::MatrixXd cross;                         // J x q
  Eigen::MatrixXd inner;                         // q x q
  Eigen::VectorXd right;                         // q
  double square = 0.0;
  Eigen::VectorXd deviation;        // J, mean of reading minus nominal after the nuisances, m
  Eigen::VectorXd deviation_sigma;  // J, of that mean, m
  LineNoise noise;
  LineReversal reversal;
  std::vector<int> point_of;  // of each reading
  Eigen::VectorXd weights;    // of each reading, 0..1; 0 is rejected
};

/// Condenses all lines together, since repeats of all lines tell about noise and drift. Robust within each line
/// (repeats of one point must agree; Tukey weights); jumps of the count are found and bridged; the prior of drift
/// is pooled. `resolution` [m] bounds the noise from below by resolution/sqrt(12). Lines without length (all points
/// the same) are left out. Set-up only.
std::vector<CondensedLine> condense(const std::vector<DisplacementLine>& lines, double resolution);

}  // namespace invar::metrology

// Weighing: how residuals count, and the runs that they are taken from.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"
#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/estimate/columns.hpp"

namespace invar::diagnosis {

/// How residuals count: a filter for each output, and which rows belong to the fit.
struct Weighing {
  std::vector<Whitening> filters;                       // by output
  std::vector<std::vector<std::vector<bool>>> present;  // by recording, output, row
  Eigen::Index rows = 0;
  double left_of_inputs = 0.0;  // log likelihood, see Case
  double temper =
      1.0;  // what one nat of log likelihood counts: outputs of one loop tell the same thing twice
};

/// How the noise is taken to go on from row to row.
enum class Colour {
  fitted,  // as the residual does
  white,   // every row counts alike: right for looking for physics in a residual that is not noise yet
};

/// Rows that are measured; filters as fitted to the residuals of these simulations.
Weighing weigh(const Case& data, const std::vector<physics::Outputs>& simulated,
               Colour colour = Colour::fitted);

std::vector<physics::Outputs> simulate(const Case& data, const physics::Model& model);
/// The same of a model that nobody will ask for again; it pushes no other out of what is remembered.
std::vector<physics::Outputs> simulate_once(const Case& data, const physics::Model& model);
Eigen::VectorXd residual(const Case& data, const Weighing& weighing, const physics::Model& model);
Eigen::VectorXd residual(const Case& data, const Weighing& weighing,
                         const std::vector<physics::Outputs>& simulated);
/// measured - simulated through the filters of the weighing.
Eigen::VectorXd filtered(const Case& data, const Weighing& weighing, const Eigen::VectorXd& differences);
/// Each column through the filters of the weighing.
Eigen::MatrixXd whitened(const Case& data, const Weighing& weighing, const Eigen::MatrixXd& columns);
Columns whitened(const Case& data, const Weighing& weighing, const Columns& columns);
/// The residuals of all outputs of all recordings, one behind the other.
Eigen::Index rows_of(const Case& data);
/// measured - simulated of all recordings and outputs below one another; NaN where nothing was measured.
Eigen::VectorXd differences(const Case& data, const std::vector<physics::Outputs>& simulated);

}  // namespace invar::diagnosis

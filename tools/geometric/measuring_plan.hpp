// MeasuringPlan: line sets weighed against each other before anybody measures, and the page to take to the machine.
#pragma once

#include <filesystem>
#include <vector>

#include "core/metrology/geometric/line_plan.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

struct PlanChoice {
  bool searched = false;  // else the recipe
  std::vector<metrology::PlannedLine> lines;
  metrology::Effort effort;
  metrology::Expectation expectation;
  double minutes = 0.0;
  [[nodiscard]] double expected_rms() const { return expectation.knowledge.volumetric_rms; }
};

struct MeasuringPlan {
  std::filesystem::path machine_file;
  std::filesystem::path pilot;  // empty: noise and error motions are assumed
  metrology::Machine machine;
  metrology::GeometricPrior prior;
  double accuracy = 0.0;  // m, wanted RMS length of the error vector
  double noise = 1e-6;    // m, sd of one reading
  double motions = 0.0;   // m, rad: assumed RMS of the error motions, without a pilot
  double angles = 0.0;
  double misfit = 5e-8;  // m
  double setup_minutes = 15.0;
  double reading_seconds = 3.0;
  std::vector<PlanChoice> choices;
  const PlanChoice* best = nullptr;  // the quickest that meets the accuracy
};

/// The lines, with their steps, passes and set-up, and the expected result with and without each. Then the error motions that
/// stay open, and lines to check the result with. Precondition: there is a best choice.
report::Page plan_page(const MeasuringPlan& plan);

}  // namespace invar::tools

// Course: what a term without memory goes over, and what it does there, row by row.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

struct Course {
  std::string variable;
  std::vector<std::vector<double>> values, power;  // by recording and row; power: square of what it does
};

/// The course of a term in a thermal model or in own equations. No values where it remembers or its variable is not known.
Course course_of(const Case& data, const Diagnosis& d, const physics::Term& term);

}  // namespace invar::diagnosis

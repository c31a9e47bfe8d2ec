// Assumed terms: physics that the user names, fitted beside his own numbers whatever the search made of it.
#pragma once

#include <string>
#include <vector>

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// "coulomb_friction", "lag:x1", "periodic_disturbance:axis.force": a term and, where it could act at several, its place.
struct Wanted {
  std::string term,
      place;  // place: a report's site, or the node, signal, state or input on which the term acts; empty: any
};
Wanted wanted_of(const std::string& text);

/// Throws InputError, naming `option`, where the plant has no such term, or these recordings leave it no such place.
void check_wanted(const Case& data, const std::vector<Wanted>& wanted, const std::string& option);

/// Each wanted term fitted on top of the retuned model, at the place where it comes nearest, and held out as a finding is.
std::vector<Assumed> fit_assumed(const Case& data, const Diagnosis& d, const std::vector<Wanted>& wanted);

}  // namespace invar::diagnosis

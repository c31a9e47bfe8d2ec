// Names against each other: which of the claimed are needed, in which form, and what else would do nearly as well.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/search/options.hpp"

namespace invar::diagnosis {

/// By finding: other terms that were nearly as good in its place.
using Rivals = std::vector<std::vector<physics::Term>>;

/// Drops terms that the others make needless.
void prune(const Case& data, Diagnosis& d, Rivals& rivals, const std::set<std::string, std::less<>>& without);

/// Another law of the same variable where it does better, the other claims beside it.
void put_laws_right(const Case& data, Diagnosis& d, Rivals& rivals,
                    const std::set<std::string, std::less<>>& without);

/// Puts each rival in the place of its name, the other claims beside it; the best stays, the findings tell of the others.
void weigh_alternatives(const Case& data, Diagnosis& d, Rivals& rivals, Claims claims);

}  // namespace invar::diagnosis

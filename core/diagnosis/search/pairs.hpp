// Pairs: two effects that each do nothing alone may explain a recording together.
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/diagnosis/evidence/screen.hpp"

namespace invar::diagnosis {

/// Are the recordings of a model in the user's own equations short enough to follow more fits to their end?
bool is_quick(const Case& data);

struct JointClaim {
  Fit fit;  // the base and two terms, under filters of its own residual
  Weighing weighing;
  std::vector<std::vector<physics::Term>> rivals;  // of each: terms that did nearly as well in its place
};

struct Pairs {
  /// The pair that explains most, where both terms stand, where neither does it alone, and where the evidence and the size
  /// of what is left both say so.
  std::optional<JointClaim> claim;
  /// Single terms that explain as much as their pair. A search one by one need not come upon them: it goes by first order,
  /// from numbers that the missing effect led astray.
  std::vector<physics::Model> alone;
};

/// `rival`: what one by one came to, which a pair must clearly better.
Pairs claim_pair(const Case& data, const Fit& base, const std::set<std::string, std::less<>>& without,
                 const Fit* rival = nullptr);

/// The single terms that do most in short windows, each from states of its own: where one run goes another way than the
/// machine, first order along it names nothing. Models without those states; none where there are no windows.
std::vector<physics::Model> names_in_windows(const Case& data,
                                             const std::set<std::string, std::less<>>& without);

}  // namespace invar::diagnosis

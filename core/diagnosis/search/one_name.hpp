// One name: of single terms on top of a model, the one that explains most.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/evidence/loop_noise.hpp"
#include "core/diagnosis/evidence/screen.hpp"
#include "core/diagnosis/search/options.hpp"

namespace invar::diagnosis {

/// The case in which single names are sought.
struct Naming {
  const Case& data;
  const LoopNoise& noise;
  const Options& options;
  bool is_first = true;  // nothing is claimed yet
  double margin = 0.0;   // that a claim must gain
};

struct Shortlist {
  std::vector<Screened> screened;
  std::vector<Fit> fits;  // best first; the name is the last term
  std::vector<Rejection> impossible;
};

/// Candidates fitted on top of `base`. `alone`: models with one term that are known from elsewhere and have their turn too.
/// `fitting` is called once they are screened.
Shortlist shortlisted(const Naming& naming, const Weighing& weighing, const Fit& base,
                      const std::vector<physics::Model>& alone, const std::function<void()>& fitting);

struct OneName {
  std::size_t place = 0;  // in the short list
  Weighing weighing;      // that what it leaves asks for itself
  Fit with, without;
  double gain = 0.0;
};

/// The leader of the first few names of a short list, each followed to its end; nothing where none stands. Whether
/// its gain pays is for the caller to say.
std::optional<OneName> leader(const Naming& naming, const Fit& base, const std::vector<Fit>& fits);

}  // namespace invar::diagnosis

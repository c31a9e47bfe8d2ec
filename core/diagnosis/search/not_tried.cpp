#include "core/diagnosis/search/not_tried.hpp"

#include <algorithm>

#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

void add_once(std::vector<std::string>& all, const std::string& one) {
  if (std::find(all.begin(), all.end(), one) == all.end()) all.push_back(one);
}

void say_not_tried(Diagnosis& d, const std::vector<std::string>& not_tried) {
  for (const auto& one : not_tried) add_once(d.not_tried, one);
  d.is_partial = d.is_partial || !d.not_tried.empty();
  const auto is_not_tried = [&](const char* step) {
    return std::find(d.not_tried.begin(), d.not_tried.end(), step) != d.not_tried.end();
  };
  if (!d.is_partial) return;
  // Numbers that were not refitted to their end leave much where nothing is missing.
  if (d.findings.empty())
    d.verdict = !is_not_tried(own_numbers) && most_over_noise(d) > thresholds::times_noise
                    ? Verdict::unknown_physics
                    : Verdict::ambiguous;
  else if (is_not_tried(rivals_weighed) && d.verdict == Verdict::explained)
    d.verdict = Verdict::ambiguous;
}

}  // namespace invar::diagnosis

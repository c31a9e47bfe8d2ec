#include "core/diagnosis/search/not_tried.hpp"

#include <algorithm>

namespace invar::diagnosis {

void add_once(std::vector<std::string>& all, const std::string& one) {
  if (std::find(all.begin(), all.end(), one) == all.end()) all.push_back(one);
}

void say_not_tried(Diagnosis& d, const std::vector<std::string>& not_tried) {
  for (const auto& one : not_tried) add_once(d.not_tried, one);
  d.is_partial = d.is_partial || !d.not_tried.empty();
  const bool is_unweighed =
      std::find(d.not_tried.begin(), d.not_tried.end(), rivals_weighed) != d.not_tried.end();
  if (d.is_partial && (d.findings.empty() || (is_unweighed && d.verdict == Verdict::explained)))
    d.verdict = Verdict::ambiguous;
}

}  // namespace invar::diagnosis
